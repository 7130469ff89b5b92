"""The energy and the effect of a published posterior, against their own definitions."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bayesmembrane.data.motion import Motion
from tests.studies.tape import HELD, Dashpot, Nonaffine
from tests.studies.vhb_data import RIG, TAPE


def nominal(l1: float, l2: float, p: np.ndarray) -> np.ndarray:
    """dW/dl1 of the 3-D energy, by complex steps."""
    x = l1 + 1e-30j
    z = 1 / (x * l2)
    first = x * x + l2**2 + z * z
    w = p[0] / 6 * first - p[0] * p[2] ** 2 * np.log(3 * p[2] ** 2 - first)
    w += p[1] * (x + 1 / x + l2 + 1 / l2 + z + 1 / z)
    return np.imag(w) / 1e-30


def test_stresses_are_slopes_of_the_energy() -> None:
    p = np.array([7.5, 17.0, 4.8])
    for l1, l2 in ((1.3, 0.9), (2.5, 0.7), (0.8, 1.9)):
        found = Nonaffine.derivatives(p, l1, l2)
        assert found[1] == pytest.approx(nominal(l1, l2, p), rel=1e-12)
        assert found[2] == pytest.approx(nominal(l2, l1, p), rel=1e-12)
        step = 1e-6
        higher, lower = (Nonaffine.derivatives(p, l1 + s, l2) for s in (step, -step))
        assert found[3] == pytest.approx((higher[1] - lower[1]) / (2 * step), rel=1e-7)
        assert found[4] == pytest.approx((higher[2] - lower[2]) / (2 * step), rel=1e-7)
        for k, slopes in enumerate(Nonaffine.sensitivities(p, l1, l2)):
            d = np.zeros(3)
            d[k] = 1e-6
            a, b = Nonaffine.derivatives(p + d, l1, l2), Nonaffine.derivatives(p - d, l1, l2)
            assert [(x - y) / 2e-6 for x, y in zip(a[:3], b[:3], strict=True)] == pytest.approx(slopes, rel=1e-6)


def test_what_is_held_is_the_centre_of_the_priors() -> None:
    gc, ge, lm = HELD
    x = np.array([c.prior.quantile(0.5) for c in Nonaffine.coordinates])
    assert Nonaffine.from_coordinates(x) == pytest.approx([gc * TAPE.thickness, ge * TAPE.thickness, lm])


def test_the_dashpot_solves_its_equation() -> None:
    t = np.linspace(0.0, 8.0, 161)
    stretch = np.where(t < 4, 0.5 * t, 2.0 - 0.5 * (t - 4))
    gamma, eta = 3.3e4, 7.4e5
    path = Motion(RIG.length * stretch, t, RIG.length * 2.0)
    found = Dashpot().remember(np.array([[gamma, eta]]), np.zeros((1, t.size)), path)[0]
    rates = (lambda _, q: gamma * 0.5 - q * gamma / eta), (lambda _, q: -gamma * 0.5 - q * gamma / eta)
    up = solve_ivp(rates[0], (0, 4), [0.0], rtol=1e-10, atol=1e-8)
    down = solve_ivp(rates[1], (4, 8), up.y[:, -1], rtol=1e-10, atol=1e-8)
    assert found[-1] == pytest.approx(RIG.width * TAPE.thickness * down.y[0, -1], rel=1e-7)
