"""Hysteresis of the material: loops that know force and way, and neither time nor the largest deflection."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import least_squares

from bayesmembrane.physics.effects.base import FilmState
from bayesmembrane.physics.effects.hysteresis import WIDEST, Hysteresis, turned, way_of
from tests.generator_four.loss_laws import stopped
from tests.physics.effects.protocols import force, measured, path, staircase, two_speeds


def loop(d: np.ndarray, travel: float = 0.05, similar: float = 0.5, late: float = 0.0) -> np.ndarray:
    way = path(d)
    shape = (np.array([[v]]) for v in (travel, similar, late))
    return turned(*shape, d[None] / way.full_range, way)[0]


def carried(d: np.ndarray, elastic: np.ndarray, *shape: float, late: float = 0.0) -> np.ndarray:
    """(N,) of a film of these ``elastic`` forces (N,), with the coordinates ``shape`` and ``late``."""
    slope = elastic_slope(d, elastic)
    at = FilmState(force=elastic[None], slope=slope[None], deflection=d[None], path=path(d))
    return Hysteresis().carried(np.array([[*shape, late]]), elastic[None], at)[0]


def elastic_slope(d: np.ndarray, elastic: np.ndarray) -> np.ndarray:
    """(N,) the derivative of ``elastic`` (N,), which is a function of d alone."""
    at, first = np.unique(d, return_index=True)
    return np.interp(d, at, np.gradient(elastic[first], at))


def triangles(*ends: float, points: int = 200) -> np.ndarray:
    turns = [0.0, *ends]
    parts = [np.linspace(a, b, points)[1:] for a, b in pairwise(turns)]
    return np.concatenate(parts)


def test_it_is_the_same_at_any_speed() -> None:
    d = staircase()
    slow, quick = (measured(d, k * two_speeds(d)) for k in (1.0, 1e-3))
    evenly = measured(d, np.arange(d.size) + 1.0)
    assert np.array_equal(force(slow, "hysteresis"), force(quick, "hysteresis"))
    assert np.array_equal(force(slow, "hysteresis"), force(evenly, "hysteresis"))


def test_loading_lies_above_and_unloading_below_in_every_cycle() -> None:
    d = staircase()
    m = measured(d)
    level, travel, similar, grows, *_ = Hysteresis().typical
    change = force(m, "hysteresis", x=np.array([level, travel, similar, grows, 0.0, 0.0, 0.0])) / force(m) - 1
    for cycle in range(1, 5):
        deep = (m.cycle == cycle) & (m.deflection < 0.6 * np.max(d[m.cycle == cycle]))
        assert np.all(change[deep & (m.leg < 0)] < 0)
        late = (m.cycle == cycle) & (m.leg > 0) & (m.deflection > 0.5 * np.max(d[m.cycle == cycle]))
        assert np.all(change[late] > 0)
    assert np.all(np.abs(change) <= level * (m.deflection / np.max(m.deflection)) ** grows)


def test_repeated_cycles_become_one_closed_loop() -> None:
    z = loop(triangles(0.04, 0.001, 0.04, 0.001, 0.04, 0.001, 0.04, 0.001))
    legs = z.reshape(8, -1)
    assert legs[6] == pytest.approx(legs[4], abs=5e-3)
    assert legs[7] == pytest.approx(legs[5], abs=5e-3)
    assert np.mean(legs[6]) > np.mean(legs[7][::-1]) + 0.5


def test_a_small_loop_within_a_large_one_is_similar_or_flatter() -> None:
    """A small cycle turns as far as a large one if lengths go with the cycle, and less if they do not."""
    d = triangles(0.04, 0.02, 0.025, 0.02, 0.025, 0.02)
    small = slice(-398, None)
    scaled, fixed = (np.ptp(loop(d, 0.1, similar)[small]) for similar in (1.0, 0.0))
    assert scaled > 1.2 * fixed


def test_it_turns_to_one_in_e_at_the_length_times_what_is_left() -> None:
    d = triangles(1.0, 0.0, points=2001)
    z = loop(d, 0.1, 0.0)
    assert 1 - z[np.argmin(np.abs(d[:2000] - 0.1))] == pytest.approx(np.exp(-1), abs=2e-3)
    assert 1 + z[2000 + np.argmin(np.abs(d[2000:] - 0.8))] == pytest.approx(2 * np.exp(-1), abs=4e-3)
    assert np.all(np.abs(z) <= 1)


def test_the_law_of_dahl_is_followed() -> None:
    """dz/du = (s - z) / L, in steps of its exact solution, beside a force that grows with the deflection's cube."""
    d = triangles(0.03, 0.0, 0.04, 0.01, 0.04, 0.0, points=60)
    elastic, z = (d / 0.04) ** 3, np.zeros(d.size)
    for i, step in enumerate(np.diff(d)):
        z[i + 1] = np.sign(step) - (np.sign(step) - z[i]) * np.exp(-abs(step) / 3e-3)

    def rest(q: np.ndarray) -> np.ndarray:
        return carried(d, elastic, q[0], np.exp(q[1]), q[2], 0.0, 0.0, 0.0) - elastic * (1 + 0.05 * z)

    left = least_squares(rest, (0.04, np.log(0.05), 0.3), bounds=([0, np.log(2e-3), 0], [0.9, np.log(2.0), 1.0])).fun
    assert np.linalg.norm(left) < 0.02 * np.linalg.norm(0.05 * elastic * z)


def test_the_law_of_berg_is_followed() -> None:
    """f = f_s + u (s - f_s) / (x (1 - s f_s) + u), u the way since the reversal, f_s the friction there."""
    d = np.append(0.0, triangles(0.03, 0.0, 0.04, 0.01, 0.04, 0.0, points=60))
    z, at, turn, way = np.zeros(d.size), 0.0, 0.0, 1.0
    for i, step in enumerate(np.diff(d)):
        if np.sign(step) != way:
            at, turn, way = z[i], d[i], np.sign(step)
        u = abs(d[i + 1] - turn)
        z[i + 1] = at + u * (way - at) / (2e-3 * (1 - way * at) + u)
    assert loop(d, 2e-3 / 0.04, 0.0, 1.0) == pytest.approx(z, abs=1e-12)
    assert np.max(np.abs(loop(d, 2e-3 / 0.04, 0.0, 0.0) - z)) > 0.1


def test_what_turns_next_to_never_late_turns_exponentially() -> None:
    d = triangles(0.03, 0.0, 0.04, 0.01)
    for late in (1e-7, 1e-5):
        assert loop(d, late=late) == pytest.approx(loop(d, late=0.0), abs=1e-4)


def test_what_is_not_known_is_not_known_later_on_its_leg_nor_beyond() -> None:
    d = triangles(0.03, 0.0, 0.04, 0.0, points=50)
    elastic = (d / 0.04) ** 2
    elastic[70:75] = np.nan
    found = carried(d, elastic, 0.05, 0.05, 0.5, 0.0, 0.3, 0.5, late=0.5)
    assert np.all(np.isfinite(found[:70]))
    assert np.all(np.isnan(found[70:]))


def test_friction_within_a_film_is_no_larger_than_what_is_foretold_of_its_force(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """However small the force is: a power of next to nothing is without bounds."""
    d = triangles(0.04, 0.0, 0.04, points=200)

    def most() -> float:
        return float(np.max(np.abs(carried(d, d / 0.04, 0.1, 2e-3, 0.0, -2.5, 0.0, 0.0) - d / 0.04)))

    assert most() <= 1.3 * 0.1 * WIDEST  # the slopes of a few points at a turn are not exact here
    monkeypatch.setattr("bayesmembrane.physics.effects.hysteresis.WIDEST", 1e9)
    assert most() > 2 * 0.1 * WIDEST


def test_a_film_at_rest_stays_where_it_is_and_jitter_is_no_way() -> None:
    rng = np.random.default_rng(3)
    rising = np.linspace(0.001, 0.04, 100)
    held = 0.04 - 1e-5 * rng.random(500)
    z = loop(np.concatenate([rising, held, np.linspace(0.0399, 0.001, 100)]))
    assert z[99:600] == pytest.approx(np.full(501, z[99]), abs=0.02)
    assert z[-1] < -0.5


def test_a_test_that_begins_with_unloading_has_a_start_too() -> None:
    z = loop(np.concatenate([np.linspace(0.04, 0.01, 50), np.linspace(0.011, 0.04, 50)]))
    assert np.all(np.isfinite(z))
    assert z[49] < -0.5 < 0.3 < z[-1]


@pytest.mark.parametrize(("grows", "power"), [(0.0, 1.0), (-1.0, 0.0)])
def test_the_width_of_a_loop_grows_with_a_power_of_the_deflection(grows: float, power: float) -> None:
    """Of a force in proportion to the deflection: with the force, or the same everywhere."""
    d = triangles(0.04, 0.0, points=400)
    width = np.abs(carried(d, d, 0.1, 2e-3, 0.0, grows, 0.0, 0.0) - d)
    low, high = (np.argmin(np.abs(d[500:] - x)) + 500 for x in (0.01, 0.03))
    assert width[high] / width[low] == pytest.approx(3.0**power, rel=0.05)


def test_a_steady_width_is_a_part_of_the_largest_force_so_far_and_no_film_pushes() -> None:
    d = triangles(0.02, 0.0, 0.04, 0.0, points=400)
    f = carried(d, d, 0.1, 2e-3, 0.0, 0.0, 1.0, 0.0)
    for leg, largest in ((1, 0.02), (3, 0.04)):
        part = slice(399 * leg, 399 * (leg + 1))
        pulled = (d[part] > 0.3 * largest) & (d[part] < 0.6 * largest)
        assert (d[part] - f[part])[pulled] == pytest.approx(np.full(np.count_nonzero(pulled), 0.1 * largest), rel=0.1)
    assert np.all(f >= 0)


def test_once_the_full_range_is_reached_a_way_counted_in_force_is_that_of_the_force() -> None:
    d = triangles(0.04, 0.01, 0.03, 0.0)
    elastic = (d / 0.04) ** 3
    at = FilmState(force=elastic[None], slope=elastic_slope(d, elastic)[None], deflection=d[None], path=path(d))
    come = way_of(np.ones((1, 1)), elastic[None], at)[0]
    later = slice(np.argmax(d), None)
    assert np.diff(come[later]) == pytest.approx(np.diff(elastic[later]), rel=1e-9)
    assert way_of(np.zeros((1, 1)), elastic[None], at)[0] == pytest.approx(d / 0.04)


@pytest.mark.parametrize("most", [0.25, 0.6])
def test_sliders_that_know_the_force_are_followed_better_by_a_way_in_force(most: float) -> None:
    """Iwan's law: springs in a row with sliders, driven by the elastic force of a film that stiffens."""
    d = triangles(0.03, 0.001, 0.04, 0.0, points=60)
    elastic = 0.3 * d / 0.04 + 0.7 * (d / 0.04) ** 3
    limits = np.geomspace(0.02, most, 6)
    sliders = 0.05 * np.mean([stopped(elastic, y) / y for y in limits], axis=0)
    beside = np.maximum(elastic + sliders, 0.0) - elastic  # a slack film does not push

    def left(by_force: float) -> float:
        def rest(q: np.ndarray) -> np.ndarray:
            return carried(d, elastic, q[0], np.exp(q[1]), *q[2:], by_force) - elastic - beside

        bounds = ([0.0, np.log(2e-3), 0.0, -2.5, 0.0], [0.9, np.log(2.0), 1.0, 1.0, 1.0])
        starts = ([0.05, np.log(t), 0.3, 0.0, 0.5] for t in (0.02, 0.2))
        return min(least_squares(rest, x, bounds=bounds).cost for x in starts) ** 0.5

    assert left(1.0) < 0.75 * left(0.0)
