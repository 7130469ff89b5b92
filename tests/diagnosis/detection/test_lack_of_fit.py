import numpy as np
import pytest
from scipy.stats import kstest

from bayesmembrane.diagnosis.detection import lack_of_fit as of
from bayesmembrane.diagnosis.detection.lack_of_fit import LackOfFit
from bayesmembrane.diagnosis.reference.inferred import own_noise
from bayesmembrane.diagnosis.reference.noise import orthonormal, whitened
from bayesmembrane.diagnosis.reference.smooth import smooth_reference
from tests.diagnosis.curves import SD, correlated, measured, triangle, white_noise, without

N, SEEDS = 240, 150
D = triangle(N)
CURVE = measured(np.zeros(N))
SLOPES = np.vander(D / 0.04, 3)
BASIS = smooth_reference(CURVE)


def lack_of_fit(residual, slopes, basis, noise) -> LackOfFit:
    return of.lack_of_fit(whitened(residual, slopes, basis, noise))


def test_an_adequate_model_has_ratios_around_one_and_uniform_probabilities() -> None:
    rng = np.random.default_rng(5)
    fits = [
        lack_of_fit(without(SD * rng.standard_normal(N), SLOPES), SLOPES, BASIS, white_noise(CURVE))
        for _ in range(SEEDS)
    ]
    ratios = np.array([f.ratio for f in fits])
    extra = orthonormal(np.column_stack([BASIS, SLOPES])).shape[1] - 3
    assert ratios.mean() == pytest.approx(1.0, abs=4 * np.sqrt(2 / extra / SEEDS) + 2 / N)
    assert kstest([f.p_value for f in fits], "uniform").pvalue > 0.01
    assert np.mean([f.reduced_chi2 for f in fits]) == pytest.approx(1.0, abs=0.03)


def test_stated_noise_makes_it_a_chi_square() -> None:
    rng = np.random.default_rng(6)
    noise = own_noise(measured(np.zeros(N), covariance=SD**2 * np.eye(N)), BASIS)
    p = [lack_of_fit(without(SD * rng.standard_normal(N), SLOPES), SLOPES, BASIS, noise).p_value for _ in range(SEEDS)]
    assert kstest(p, "uniform").pvalue > 0.01
    assert lack_of_fit(without(1.5 * SD * rng.standard_normal(N), SLOPES), SLOPES, BASIS, noise).p_value < 1e-6


@pytest.mark.parametrize("rho", [0.0, 0.5])
def test_with_a_cautious_correlation_there_are_few_false_alarms(rho) -> None:
    rng = np.random.default_rng(7)
    p = []
    for _ in range(40):
        e = correlated(rng, CURVE.time, rho)
        noise = own_noise(measured(e), np.column_stack([BASIS, SLOPES])).cautious()
        w = noise.white(SLOPES)
        residual = e - SLOPES @ np.linalg.lstsq(w, noise.white(e), rcond=None)[0]
        p.append(lack_of_fit(residual, SLOPES, BASIS, noise).p_value)
    assert np.count_nonzero(np.array(p) < 0.01) <= 2


def test_a_kink_and_a_gap_between_legs_are_seen() -> None:
    rng = np.random.default_rng(8)
    noise = SD * rng.standard_normal(N)
    kink = 12 * SD * np.abs(D - 0.02) / 0.02
    gap = 1.5 * SD * CURVE.leg
    for fault in (kink, gap):
        assert lack_of_fit(without(noise + fault, SLOPES), SLOPES, BASIS, white_noise(CURVE)).p_value < 1e-5
    assert lack_of_fit(without(noise, SLOPES), SLOPES, BASIS, white_noise(CURVE)).p_value > 0.01


@pytest.mark.parametrize("points", [5, 12, 30, 90, 240])
def test_the_reference_leaves_points_to_judge_by(points) -> None:
    loading = smooth_reference(measured(np.zeros(points), np.linspace(0.001, 0.04, points)))
    assert orthonormal(loading).shape[1] <= max(points // 3, 1)
    cyclic = smooth_reference(measured(np.zeros(points)))
    assert np.all(np.isfinite(cyclic))
    assert orthonormal(cyclic).shape[1] < points
