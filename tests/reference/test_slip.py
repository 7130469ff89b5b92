"""Slip out of the outer clamp, solved exactly: a film with a wider stress-free ring, held at the clamp's radius."""

import numpy as np
import pytest
from scipy.integrate import solve_bvp
from scipy.optimize import least_squares

from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.registry import material
from bayesmembrane.physics.effects.clamp_slip import ClampSlip
from bayesmembrane.physics.mechanics import request
from bayesmembrane.physics.mechanics.film_law import film_law

R1, R2 = 0.010, 0.035
YEOH, FILM = material("yeoh"), np.array([8.0, -0.2, 0.03])


def slipped(slip: float, d: np.ndarray) -> np.ndarray:
    """F (N,) at deflections d (N,) m, which fall, of a film of stress-free radii R1 and R2 + slip with edges held at
    R1 and R2.
    """
    span, found = np.log((R2 + slip) / R1), []

    def rates(t: np.ndarray, y: np.ndarray) -> np.ndarray:
        l2, l1, th, _ = y
        _, p1, p2, p11, p12, _ = YEOH.derivatives(FILM, l1, l2)
        dl2 = l1 * np.cos(th) - l2
        dl1 = (p2 * np.cos(th) - p1 - p12 * dl2) / p11
        return np.array([dl2, dl1, -np.sin(th) * p2 / p1, R1 * np.exp(t) * l1 * np.sin(th)])

    t = np.linspace(0, span, 60)
    cone = d[0] / (R2 - R1)
    y = np.stack([np.ones(60), np.full(60, np.hypot(1, cone)), np.full(60, np.arctan(cone)), d[0] * t / span])
    for delta in d:
        ends = np.array([1.0, R2 / (R2 + slip), 0.0, delta])
        done = solve_bvp(
            rates,
            lambda a, b, e=ends: np.array([a[0], b[0], a[3], b[3]]) - e,
            t,
            y * np.array([[1], [1], [1], [delta / y[3, -1]]]),
            tol=1e-6,
            max_nodes=20000,
        )
        assert done.success
        t, y = done.x, done.y
        p1 = YEOH.derivatives(FILM, y[1, 0], y[0, 0])[1]
        found.append(2 * np.pi * R1 * p1 * np.sin(y[2, 0]))
    return np.array(found)


def at_once(slip: float, eased: float, d: np.ndarray) -> np.ndarray:
    """(1, N) excess length of a clamp that has slipped before the first deflection of d (N,), which is the largest."""
    said = {"slip": slip, "eased": eased, "jump": 1.0, "place": 0.0, "width": 1e-3}
    p = np.array([[said.get(c.name, 0.0) for c in ClampSlip.coordinates]])
    return ClampSlip().excess(p, d[None], Motion(d, None, float(d[0])))


@pytest.mark.parametrize(
    ("top", "usual", "most", "gains"),
    [(0.030, (0.95, 0.46), 0.03, 3.0), (0.050, (0.69, 0.95), 0.05, 3.0), (0.070, (0.76, 0.36), 0.09, 1.1)],
)
def test_excess_length_that_eases_stands_for_slip(
    top: float, usual: tuple[float, float], most: float, gains: float
) -> None:
    """To 3 and 5 % of its effect up to twice the width of the film, where by one number alone it is 9 and 19 %; beyond
    that hardly better than by one number.
    """
    d = np.linspace(top, 0.16 * top, 13)
    law, _ = film_law(request(YEOH, FILM, [1.2 * top], R1, R2), np.array([1.2 * top]))
    at_rest = slipped(0.0, d)
    assert at_rest == pytest.approx(law(d[None])[0][0], rel=1e-6)
    for slip in (1e-4, 2.5e-4):
        exact = slipped(slip, d)

        def missed(p: np.ndarray, exact: np.ndarray = exact, slip: float = slip) -> np.ndarray:
            excess = at_once(p[0] * slip / (R2 - R1), p[1], d)
            return np.asarray(law(d[None], excess)[0][0] - exact)

        best = least_squares(missed, [0.8, 0.4], diff_step=1e-4)
        even = least_squares(lambda p: missed(np.array([p[0], 0.0])), [0.8], diff_step=1e-4)
        assert best.x == pytest.approx(usual, abs=0.1)
        assert np.linalg.norm(best.fun) < most * np.linalg.norm(exact - at_rest)
        assert np.linalg.norm(even.fun) > gains * np.linalg.norm(best.fun)
