"""Where limited chains lock: against SciPy, against the growth of the force, and as a status."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from bayesmembrane.physics.materials.gent import Gent
from bayesmembrane.physics.mechanics import Status, request, solve
from bayesmembrane.physics.mechanics.locking import TABLE, locking_deflection
from tests.physics.mechanics.films import INNER, RADII

CASES = [(jm, l0, ratio) for jm in (0.5, 17.42, 100.0) for l0 in (1.0, 1.1) for ratio in (1.5, 3.5, 8.0)]


def inextensible(jm, l0, ratio):
    """Scaled deflection of the film with I1 = Jm + 3 everywhere, by adaptive integration and Brent's root."""

    def rates(t, y):
        s = y[0] ** 2
        b = jm + 3 - s
        l1 = np.sqrt((b + np.sqrt(b * b - 4 / s)) / 2)
        pull = (y[0] - 1 / (l1**2 * y[0] ** 3)) / (l1 - 1 / (l1**3 * y[0] ** 2))
        return [l1 * np.cos(y[1]) - y[0], -np.sin(y[1]) * pull, np.exp(t) * l1 * np.sin(y[1])]

    def end(th):
        with np.errstate(all="ignore"):
            return solve_ivp(rates, (0, np.log(ratio)), [l0, th, 0], method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]

    angles = np.linspace(0.05, 1.7, 60)
    above = np.array([end(th)[0] > l0 for th in angles])
    last = np.flatnonzero(above)[-1]
    return end(brentq(lambda th: end(th)[0] - l0, angles[last], angles[last + 1], xtol=1e-14))[2]


@pytest.mark.parametrize(("jm", "l0", "ratio"), CASES)
def test_locking_deflection_is_that_of_the_inextensible_film(jm, l0, ratio):
    assert float(locking_deflection(jm, l0, ratio)) == pytest.approx(inextensible(jm, l0, ratio), rel=1e-8)


@pytest.mark.parametrize("ratio", [1.5, 3.5, 8.0, 12.0])
@pytest.mark.parametrize("l0", [1.0, 1.02, 1.3])
def test_table_for_many_films_equals_the_search_and_rises(l0, ratio):
    jm = 2 * l0**2 + l0**-4 - 3 + np.geomspace(2e-3, 5e5, 101)
    many = locking_deflection(jm, l0, ratio)
    assert np.all(np.diff(many) > 0)
    for i in range(0, 101, 10):
        assert many[i] == pytest.approx(float(locking_deflection(jm[i], l0, ratio)), rel=1e-7)


def test_limits():
    assert locking_deflection(np.inf, 1.0, 3.5) == np.inf
    assert locking_deflection(0.5, 1.5, 3.5) == 0, "the pre-stretch alone locks"
    assert locking_deflection(np.full((2, 3), 10.0), 1.0, 3.5).shape == (2, 3)


@pytest.mark.parametrize(("jm", "l0"), [(17.42, 1.0), (2.0, 1.1), (300.0, 1.0)])
def test_force_grows_without_bound_towards_the_locking_deflection(jm, l0):
    lock = float(locking_deflection(jm, l0, 3.5)) * INNER / l0
    gaps = np.array([4e-3, 2e-3, 1e-3])
    force = solve(request(Gent, [5.0, jm], lock * (1 - gaps), prestretch=l0, **RADII)).force[0]
    assert force[1:] / force[:-1] == pytest.approx([2.0, 2.0], rel=0.01), "the force goes like 1/(lock - delta)"
    # The extrapolated pole of 1/F is the locking deflection.
    a, b = 1 / force[1], 1 / force[2]
    assert 2e-3 - 1e-3 * a / (a - b) == pytest.approx(0.0, abs=2e-5)


@pytest.mark.parametrize("solver", ["ritz", "shooting"])
@pytest.mark.parametrize(("jm", "l0"), [(17.42, 1.0), (2.0, 1.1)])
def test_locked_is_named_at_the_exact_deflection(jm, l0, solver):
    lock = float(locking_deflection(jm, l0, 3.5)) * INNER / l0
    d = lock * np.array([0.5, 0.9, 0.99, 1 - 1e-3, 1 - 1e-4, 1 + 1e-7, 1.1, 3.0])
    status = solve(request(Gent, [5.0, jm], d, prestretch=l0, solver=solver, **RADII)).status[0]
    assert status.tolist() == [Status.OK] * 5 + [Status.LOCKED] * 3


def test_every_film_of_a_batch_locks_on_its_own():
    jm = np.array([1.0, 17.42, 1e3, 0.01])
    curves = solve(request(Gent, np.stack([np.full(4, 5.0), jm], axis=1), np.array([0.05, 0.10, 0.11]), **RADII))
    lock = locking_deflection(jm, 1.0, 3.5) * INNER
    np.testing.assert_array_equal(curves.status == Status.LOCKED, curves.deflection >= lock[:, None])
    assert curves.ok.sum() == np.sum(curves.deflection < lock[:, None])


def test_a_collapsing_film_that_is_thrown_about_is_no_root():
    """A step too long for the collapse once led to the ring with a negative height, and the table to a traceback."""
    ratio, jm = 11.112034099332558, np.exp(TABLE[161]) + np.array([-1e-6, 0.0, 1e-6])
    found = np.array([locking_deflection([j, j], [1.0, 1.0 + 1e-12], ratio)[0] for j in jm])
    assert np.all(found > 0)
    assert np.all(np.diff(found) > 0)
    assert locking_deflection(jm, 1.0, ratio) == pytest.approx(found, rel=1e-6)
