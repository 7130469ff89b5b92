"""A lost length, and a force that stays in the film: what one law of the shift comes to at its ends."""

import numpy as np
import pytest

from bayesmembrane.data.motion import Motion
from bayesmembrane.physics.effects.permanent_set import PermanentSet
from tests.physics.effects.protocols import path

UP = np.linspace(0.0, 0.03, 121)[1:]
PATH = np.concatenate([UP, UP[-2::-1]])
BACK = slice(UP.size, None)


def shift(**said: float) -> np.ndarray:
    """(N,) m, of a film that is lifted once and let go."""
    usual = {"set": 1e-4, "exponent": 2.0, "repeated": 0.0, "saturation": 0.0, "creeps": 0.0}
    usual |= {"log_delay": -25.0} | said
    p = np.array([[usual[c.name] for c in PermanentSet.coordinates]])
    film = PermanentSet().deflect(p, PATH[None, :], path(PATH))[0]
    return np.asarray(PATH - film)


def test_a_lost_length_is_the_same_at_every_deflection() -> None:
    assert shift(rejoin=0.0, relieved=0.0)[BACK] == pytest.approx(1e-4)


@pytest.mark.parametrize("power", [2.0, 3.0])
def test_a_force_that_stays_in_the_film_is_the_same_at_every_deflection(power: float) -> None:
    """Of a film with F = x^n, whose slope rises to the power of n - 1: the force that it lacks, to first order."""
    lost = PATH**power - (PATH - shift(rejoin=0.0, relieved=power - 1.0, set=1e-7)) ** power
    taut = PATH[BACK] > 0.1 * UP[-1]
    assert np.ptp(lost[BACK][taut]) < 1e-3 * np.mean(lost[BACK][taut])
    length = PATH**power - (PATH - shift(rejoin=0.0, relieved=0.0, set=1e-7)) ** power
    assert np.ptp(length[BACK][taut]) > np.mean(length[BACK][taut])


@pytest.mark.parametrize("relieved", [0.0, 1.5])
def test_half_way_down_the_shift_is_the_set(relieved: float) -> None:
    """And at the largest deflection nothing is left of it where the curve is joined again."""
    found = shift(rejoin=1.0, relieved=relieved)
    half = UP.size + int(np.argmin(np.abs(PATH[BACK] - 0.5 * UP[-1])))
    assert found[half] == pytest.approx(0.5e-4)
    assert found[UP.size - 1] == pytest.approx(0.0, abs=1e-12)


def test_a_set_that_follows_late_grows_in_a_hold_and_comes_to_the_same() -> None:
    """Of a first-order law, z' = (G - z) / delay, beside an integration in small steps."""
    held = np.concatenate([UP, np.full(80, UP[-1])])
    there = Motion(held, np.arange(1.0, held.size + 1), UP[-1])
    late = float(np.log(12.0 * there.pace / UP[-1]))
    p = np.array(
        [[{"set": 1e-4, "exponent": 2.0, "log_delay": late}.get(c.name, 0.0) for c in PermanentSet.coordinates]]
    )
    found = held - PermanentSet().deflect(p, held[None, :], there)[0]
    fine = np.linspace(0.0, there.clock[-1], 200_001)
    grown = (np.interp(fine, there.clock, held) / UP[-1]) ** 2
    z, step = np.zeros(fine.size), fine[1]
    for i in range(1, fine.size):
        z[i] = z[i - 1] + step * (grown[i - 1] - z[i - 1]) / 12.0
    exact = 1e-4 * np.interp(there.clock, fine, z)
    assert found[2:] == pytest.approx(exact[2:], rel=0.02, abs=1e-7)
    assert found[-1] > 1.1 * found[UP.size - 1]
