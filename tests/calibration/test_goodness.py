import numpy as np
import pytest

from bayesmembrane.calibration.goodness import dominates, goodness
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.physics.rigs.annulus import Annulus

D = np.linspace(0.01, 0.05, 5)
R = np.array([0.1, -0.2, 0.1, 0.0, 0.3])


def curve(**noise: np.ndarray) -> Measurement:
    return Measurement(D, 10 * D + R, Annulus(0.01, 0.035), Specimen("film", 5e-5), **noise)  # type: ignore[arg-type]


def test_without_a_noise_of_its_own_there_is_no_chi_square() -> None:
    g = goodness(curve(), 10 * D, 2)
    assert (g.reduced_chi2, g.p_value, g.own_noise_N) == (None, None, None)
    assert g.loss_N == pytest.approx(np.sqrt(0.15))
    assert g.rmse_N == pytest.approx(np.sqrt(0.03))
    assert g.max_N == pytest.approx(0.3)


def test_chi_square_uses_the_stated_noise() -> None:
    sd = np.array([0.1, 0.1, 0.2, 0.1, 0.3])
    g = goodness(curve(force_sd=sd), 10 * D, 2)
    assert g.reduced_chi2 == pytest.approx((1 + 4 + 0.25 + 0 + 1) / 3)
    assert goodness(curve(covariance=np.diag(sd**2)), 10 * D, 2).reduced_chi2 == pytest.approx(g.reduced_chi2)
    assert goodness(curve(force_sd=sd), 10 * D, 5).reduced_chi2 is None
    assert g.p_value == pytest.approx(0.1003, abs=1e-3)


def test_extra_noise_dominates_when_it_is_larger() -> None:
    assert dominates(0.01, np.array([0.02, 0.03, 0.005]))
    assert not dominates(0.01, np.array([0.002, 0.03, 0.005]))
    assert not dominates(None, np.array([1.0]))
