"""The sentences say what the numbers say."""

import math
from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from bayesmembrane.words import calibration as sentences
from bayesmembrane.words.calibration import Case
from bayesmembrane.words.seen import seen_on

GOOD = Case(
    name="Yeoh",
    end=0.0351,
    rmse=3.1e-3,
    own_noise=4e-3,
    extra_noise=0.8e-3,
    dominated=False,
    p_value=0.4,
    modulus=(17.2, 17.7, 18.1),
    thickness=50e-6,
    status="converged",
    ess=1034.0,
    wanted=1000.0,
    r_hat=1.004,
    failed=0.0,
    last=0.1,
    last_force=(12.0, 20.0, 60.0),
    lost={},
    loose={},
)
BAD = replace(GOOD, name="Gent", rmse=0.07, extra_noise=0.075, dominated=True, p_value=1e-9)


def test_one_material_that_describes_the_curve() -> None:
    told = sentences.answer([GOOD])
    assert told[0] == "Up to 35.1 mm, Yeoh (rms residual 3.10 mN) describes the curve within its noise of 4.00 mN."
    assert "17.7 N/m (90 %: 17.2 to 18.1) by Yeoh" in told[1]
    assert "0.354 MPa" in told[1]
    assert "At 100 mm, beyond the fitted range, the force would be 12.0 N to 60.0 N (Yeoh)" in told[2]
    assert "extrapolation" in told[2]
    assert told[3] == "Sampling converged (worst effective sample size 1034, worst R-hat 1.004)."
    assert sentences.warnings([GOOD]) == []


def test_the_answer_for_two_ranges_has_at_most_five_sentences_and_the_rest_is_in_the_details() -> None:
    long = [replace(c, end=0.0915) for c in (GOOD, BAD)]
    told = sentences.answer([GOOD, BAD, *long])
    assert 2 <= len(told) <= 5
    assert told[0].startswith("Up to 35.1 mm")
    assert told[1].startswith("Up to 91.5 mm")
    assert not set(told) & set(sentences.details([GOOD, BAD, *long]))


def test_ranges_of_films_and_strips_are_told_in_their_own_units() -> None:
    strip = replace(GOOD, end=0.075, how=seen_on(Uniaxial(), 50e-6))
    told = sentences.overview([strip, GOOD, replace(GOOD, end=0.0915)])
    assert told.endswith("fitted up to 35.1 and 91.5 mm of deflection and a stretch of 2.5.")


def test_extra_noise_that_dominates_means_that_the_model_misses_something() -> None:
    told = sentences.describes([GOOD, BAD])
    assert "Yeoh (rms residual 3.10 mN) describes the curve" in told
    assert "Gent (rms residual 70.0 mN) does not: its misfit exceeds the noise" in told
    assert "it misses something" in told
    alone = sentences.describes([BAD])
    assert "Gent (rms residual 70.0 mN) does not describe the curve" in alone
    assert "the noise of 4.00 mN" in alone


def test_when_no_material_fits_the_nearest_is_named() -> None:
    told = sentences.describes([BAD, replace(BAD, name="neo-Hookean", rmse=2.7), replace(BAD, name="Ogden", rmse=0.02)])
    assert "no material describes the curve" in told
    assert "the nearest is Ogden (rms residual 20.0 mN), then Gent (70.0 mN) and neo-Hookean (2.70 N)" in told


def test_a_small_misfit_beyond_the_noise_is_not_called_adequate() -> None:
    strained = replace(GOOD, p_value=1e-4)
    assert strained.verdict == "strained"
    assert "residuals are larger than the noise of 4.00 mN allows" in sentences.describes([strained])


def test_without_a_stated_noise_nothing_is_called_adequate() -> None:
    blind = replace(GOOD, own_noise=None, p_value=None)
    told = sentences.describes([blind, replace(blind, name="Gent", rmse=0.07)])
    assert "states no noise" in told
    assert "smallest root mean square residual has Yeoh" in told


def test_a_run_that_did_not_converge_is_a_warning_with_its_reasons() -> None:
    poor = replace(GOOD, status="step limit", ess=412.0, r_hat=1.05)
    (warning,) = sentences.warnings([poor])
    assert warning == (
        "Yeoh up to 35.1 mm: sampling stopped early (step limit); the effective sample size is 412 instead of 1000 and "
        "R-hat is 1.050 instead of at most 1.01, so that the ensembles disagree."
    )
    assert "did not converge" in sentences.convergence([poor])
    assert "in 1 of 2 runs" in sentences.convergence([GOOD, poor])


def test_an_interrupted_run_with_enough_draws_still_gives_a_reason() -> None:
    (warning,) = sentences.warnings([replace(GOOD, status="interrupted")])
    assert "(interrupted); the chains are shorter than 50 autocorrelation times" in warning


@pytest.mark.parametrize(("share", "said"), [(0.0, False), (1e-3, False), (1.1e-3, True)])
def test_numerical_failures_are_told_above_a_thousandth(share: float, said: bool) -> None:
    assert bool(sentences.failures(replace(GOOD, failed=share))) is said


def test_extrapolation_that_is_not_possible_says_why() -> None:
    locked = replace(GOOD, last_force=(math.nan,) * 3, lost={"locked": 0.9, "not elliptic": 0.05})
    told = sentences.extrapolation([locked])
    assert "nothing can be said by Yeoh (locked for 90 %, not elliptic for 5 % of the draws)" in told
    assert "nan" not in told


def test_extrapolation_that_some_draws_do_not_reach_tells_their_share() -> None:
    told = sentences.extrapolation([replace(GOOD, lost={"locked": 0.12})])
    assert "12 % of the draws of Yeoh have no force there" in told


def test_extrapolation_by_materials_that_miss_the_points_is_not_to_be_relied_on() -> None:
    told = sentences.extrapolation([BAD, replace(BAD, name="Yeoh", last_force=(60.0, 100.0, 230.0))])
    assert "the materials give anything from 12.0 N (Gent) to 230 N (Yeoh)" in told
    assert "do not rely on it" in told


def test_the_stiffness_told_is_that_of_the_range_that_is_described_best() -> None:
    far = replace(BAD, end=0.0915, rmse=0.9, modulus=(9.0, 10.0, 11.0))
    assert "17.7 N/m" in " ".join(sentences.answer([BAD, far]))
    assert "10.0 N/m" in " ".join(sentences.details([BAD, far]))


def test_nothing_is_said_of_extrapolation_where_there_is_none() -> None:
    assert sentences.extrapolation([replace(GOOD, last=GOOD.end)]) == ""


def test_parameters_that_the_data_leave_open_are_named() -> None:
    told = sentences.unknown([replace(GOOD, loose={"c3/c1": 0.78})])
    assert told == "The data hardly determine c3/c1 of Yeoh (posterior 78 % as wide as the prior)."
    assert sentences.unknown([GOOD]) == ""


def test_two_solvers_that_agree_are_no_warning() -> None:
    assert sentences.disagreement("Yeoh", 0.0351, 3e-8) == ""
    assert "3.0e-05" in sentences.disagreement("Yeoh", 0.0351, 3e-5)


def test_points_beyond_the_fitted_range_are_counted() -> None:
    residual = np.array([[-1.0, 1.0, np.nan], [0.5, 2.0, np.nan], [1.0, 3.0, np.nan]])
    told = sentences.held_out("Yeoh", residual)
    assert told.startswith("Yeoh: of the 3 points beyond the fitted range 1 lie in the 90 % band")
    assert "by up to 2.00 N, and 1 points have no prediction." in told
    assert "no force can be predicted at any of the 3" in sentences.held_out("Yeoh", np.full((3, 3), np.nan))
