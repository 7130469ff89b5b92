"""What is said of a run."""

from dataclasses import replace

from bayesmembrane.calibration.quality import Quality
from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from bayesmembrane.words.sampling import sentences

GOOD = Quality("converged", 900, 1200.0, 1000.0, 61.0, 1.004, 0, 50000)


def test_nothing_is_said_of_a_good_run() -> None:
    assert sentences(GOOD) == ()


def test_what_is_not_converged_is_said_with_its_reason() -> None:
    short = replace(GOOD, ended="step limit", ess=300.0, lengths=20.0, r_hat=1.08)
    assert sentences(short) == (
        "Not converged (the limit of 900 steps): ESS 300 of 1000 wanted, 20 of 50 autocorrelation times walked, "
        "R-hat 1.080.",
    )
    (stopped,) = sentences(replace(short, ended="interrupted"))
    assert stopped.startswith("Not converged (the run was interrupted): ESS 300")


def test_failures_are_told_from_a_tenth_of_a_percent() -> None:
    assert sentences(replace(GOOD, failed=10, evaluated=10000)) == ()
    (sentence,) = sentences(replace(GOOD, failed=30, evaluated=10000))
    assert sentence.startswith("30 of 10000 draws (0.3 %)")


def test_noise_that_dominates_is_told_with_both_numbers() -> None:
    (sentence,) = sentences(replace(GOOD, own_noise=0.01, extra_noise=0.02))
    assert "(20 mN) exceeds what the measurement states (10 mN)" in sentence
    (sentence,) = sentences(replace(GOOD, own_noise=0.01, extra_noise=0.02), Uniaxial(0.05, 0.01).shown(1e-3))
    assert "(0.002 MPa) exceeds what the measurement states (0.001 MPa)" in sentence


def test_a_convexity_prior_that_decides_is_told() -> None:
    assert sentences(replace(GOOD, ruled_out=1.0)) == ()
    (sentence,) = sentences(replace(GOOD, ruled_out=10.24))
    assert sentence.startswith("The convexity prior decides, and not the data")
    assert "at least 10.2" in sentence
