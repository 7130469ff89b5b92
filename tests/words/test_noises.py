"""What is said of rankings that hang on the noise model."""

from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.calibration.quality import Quality
from bayesmembrane.comparison.evidence.estimate import BRIDGE, NESTED, together
from bayesmembrane.comparison.evidence.target import EvidenceEstimate
from bayesmembrane.comparison.leave_out.score import LeaveOneOut
from bayesmembrane.comparison.noises import NOISES, over_noises, several
from bayesmembrane.comparison.result import Comparison, Row, ranked
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.words.comparison import document, sentences
from bayesmembrane.words.noises import best_noise, contradicted, leaders, of_noise, summed
from bayesmembrane.words.sampling import smooth_sentence

GOOD = Quality("converged", 900, 1200.0, 1000.0, 61.0, 1.004, 0, 50000)
SMOOTH = replace(GOOD, alike=0.7, alike_p=0.002, noise="white")


def row(material: str, noise: str, z: float, quality: Quality = GOOD) -> Row:
    pair = {NESTED: EvidenceEstimate(z, 0.1, 1, 1.0), BRIDGE: EvidenceEstimate(z, 0.1, 1, 1.0)}
    loo = LeaveOneOut(z, 1.0, 0.01, np.full(10, z / 10), np.zeros(10), ())
    return Row(
        f"{material} ({noise}, reached)", hypothesis(material, noise=noise), together(pair), loo, quality=quality
    )


def table(yeoh: tuple[float, ...], gent: tuple[float, ...]) -> Comparison:
    values = (("yeoh", yeoh), ("gent", gent))
    return ranked([row(name, n, z) for name, zs in values for n, z in zip(NOISES, zs, strict=True)])


def test_a_hypothesis_is_worth_the_mean_over_its_noises() -> None:
    found = table((-10.0, -8.0, -9.0), (-15.0, -9.0, -8.0))
    first, second = over_noises(found)
    assert first.label == "yeoh"
    assert first.log_evidence == pytest.approx(np.log(np.mean(np.exp([-10.0, -8.0, -9.0]))))
    assert first.posterior_probability + second.posterior_probability == pytest.approx(1.0)
    ratio = np.exp(first.log_evidence - second.log_evidence)
    assert first.posterior_probability / second.posterior_probability == pytest.approx(ratio)
    assert 0.05 < first.sd < 0.1
    assert first.hypothesis.noise.name == "ar1"


def test_one_noise_model_has_no_sums() -> None:
    found = ranked([row("yeoh", "white", -10.0), row("gent", "white", -15.0)])
    assert not several(found)
    assert best_noise(found) is found
    assert of_noise(found) == ""
    assert document(found)["over_noises"] == []


def test_a_lead_that_hangs_on_the_noise_is_said() -> None:
    found = table((-10.0, -8.0, -9.0), (-15.0, -9.3, -8.0))
    told = leaders(found)
    assert told.startswith("The ranking hangs on the noise model: first is")
    assert "Yeoh by 5.0 under white noise" in told
    assert "Gent by 1.0 under white noise and smooth form errors" in told
    assert summed(found).startswith("Whatever the noise (")
    assert of_noise(found) in sentences(found)


def test_a_lead_that_does_not_is_said_with_where_it_decides_nothing() -> None:
    told = leaders(table((-10.0, -8.0, -7.0), (-15.0, -8.4, -12.0)))
    assert told.startswith("Yeoh is first under each noise model")
    assert told.endswith("which decides nothing under noise that remembers, AR(1).")


def test_a_ranking_on_a_noise_that_residuals_contradict_says_how_to_ask() -> None:
    found = ranked([row("yeoh", "white", -10.0, SMOOTH), row("gent", "white", -15.0)])
    told = contradicted(found)
    assert told.startswith("The ranking hangs on white noise, which the residuals contradict")
    assert "Yeoh (p = 0.002)" in told
    assert "--noise auto" in told
    assert told in sentences(found)
    assert document(found)["noise"] == told


def test_a_smooth_misfit_is_said_with_what_would_allow_for_it() -> None:
    assert smooth_sentence(GOOD) == ""
    told = smooth_sentence(SMOOTH)
    assert "neighbouring residuals are alike (correlation 0.70, p = 0.002)" in told
    assert told.endswith("--noise form.")
    assert "--noise" not in smooth_sentence(replace(SMOOTH, noise="form"))
