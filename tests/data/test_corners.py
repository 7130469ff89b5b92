"""Turns, stops and changes of the speed between readings: where they are, and where there are none."""

import numpy as np
import pytest

from bayesmembrane.data.corners import with_corners
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.motion import Motion
from bayesmembrane.physics.effects.friction import Friction
from bayesmembrane.physics.rigs.annulus import Annulus

KNOTS = 1e-3 * np.array([0, 17.13, 3.4, 3.4, 20.9, 30.9])
CLOCK = np.array([0, 17.13, 30.86, 42.2, 59.7, 109.7])
"""Up, back, at rest, up again, and on at a fifth of the speed."""


def moved(time: np.ndarray, way: np.ndarray) -> Measurement:
    return Measurement(way, 1e3 * way**2 + 1e-3, Annulus(0.010, 0.035), Specimen("film", 5e-5), time=time)


def read_at(time: np.ndarray) -> Measurement:
    return moved(time, np.interp(time, CLOCK, KNOTS))


@pytest.mark.parametrize("seed", range(5))
def test_corners_are_found_where_they_are(seed: int) -> None:
    """Of readings at uneven times, and with a deflection that is read to 1e-4 of a step."""
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.7, 1.0, 140))
    m = read_at(time[time < 109])
    noisy = moved(m.time, m.deflection + 5e-8 * rng.standard_normal(len(m)))
    found = with_corners(noisy)
    between = np.setdiff1d(np.arange(found.path.deflection.size), found.on_path)
    near = [np.min(np.abs(time - c)) > 0.1 for c in CLOCK[1:-1]]
    assert between.size >= np.count_nonzero(near)
    for c, x in zip(CLOCK[1:-1][near], KNOTS[1:-1][near], strict=True):
        k = between[np.argmin(np.abs(found.path.time[between] - c))]
        assert found.path.time[k] == pytest.approx(c, abs=2e-3)
        assert found.path.deflection[k] == pytest.approx(x, abs=1e-6)
    assert np.array_equal(found.path.deflection[found.on_path], noisy.deflection)
    assert np.array_equal(found.path.time[found.on_path], noisy.time)
    assert found.full_range == noisy.full_range


def test_a_disc_that_stopped_between_two_readings_rests_at_the_second() -> None:
    m = with_corners(read_at(np.linspace(0.0, 100.0, 331)))
    stands = (m.time > 30.86) & (m.time <= 42.2)
    assert np.array_equal(m.path.rests[m.on_path], stands)
    assert m.leg[np.searchsorted(m.time, 17.13)] == -1


def test_friction_after_a_turn_between_readings_is_that_of_the_motion() -> None:
    """Against the same guide read five hundred times as often."""
    coarse, fine = np.linspace(0.0, 100.0, 331), np.linspace(0.0, 100.0, 165_001)
    p = np.array([[0.02, 2e-4, 2e3, 1.0, 0.0]])
    m = with_corners(read_at(coarse))
    found = Friction().read(p, np.zeros((1, m.path.deflection.size)), m.path)[0, m.on_path]
    way = np.interp(fine, CLOCK, KNOTS)
    exact = Friction().read(p, np.zeros((1, fine.size)), Motion(way, fine, m.full_range))[0, ::500]
    plain = Friction().read(p, np.zeros((1, coarse.size)), read_at(coarse).path)[0]
    assert found == pytest.approx(exact, abs=2e-4)
    assert np.max(np.abs(plain - exact)) > 5e-3


@pytest.mark.parametrize("pause", [2.0, 60.0])
@pytest.mark.parametrize("read_twice", [False, True])
def test_a_pause_that_nobody_read_is_no_way_on(pause: float, read_twice: bool) -> None:
    """At the top, of which the export keeps one reading or two, and at zero between two cycles."""
    up, back = np.arange(0.0, 31.0), np.arange(29.0, -1.0, -1.0)
    cycle = np.concatenate([up, up[-1:] if read_twice else [], back])
    gaps = np.ones(cycle.size)
    gaps[31] = pause
    way, time = np.tile(cycle, 2), np.cumsum(np.tile(gaps, 2))
    time[cycle.size :] += pause
    m = moved(time, 1e-3 * way)
    assert with_corners(m) is m


def test_no_corner_is_made_up() -> None:
    """At readings, in sine waves, in noise, of a coarse encoder, and without times."""
    t = np.arange(0.0, 120.0, 0.5)
    rng = np.random.default_rng(3)
    each = [
        moved(t, np.interp(t, [0, 40, 80, 120], [0, 0.04, 0, 0.04])),
        moved(t, 0.01 * (1 - np.cos(2 * np.pi * t / 40))),
        moved(t, np.floor(t / 1.7) * 2e-4 + 1e-4),
        moved(t, np.abs(1e-6 * rng.standard_normal(t.size))),
    ]
    for m in each:
        assert with_corners(m) is m
    timeless = [Measurement(m.deflection, m.force, m.rig, m.specimen) for m in each]
    for m in timeless:
        assert with_corners(m) is m


UP = np.arange(21.0)


@pytest.mark.parametrize(
    "cycle",
    [
        [*UP, *UP[-2::-1]],
        [*UP, *UP[::-1]],
        [*UP, 20.3, *UP[::-1]],
        [*UP, 20.01, *UP[-2::-1]],  # the top read twice
        [*UP, 20.4, *(UP[:0:-1] - 0.6), 0.0],  # the end of a way kept, and the next one counted from there
        [*UP, *(UP[:0:-1] - 0.5), 0.0],  # chosen otherwise on the way back
        np.append(np.cumsum(np.abs(np.sin(UP + 1))), np.cumsum(np.abs(np.sin(UP + 1)))[::-1]),
    ],
)
@pytest.mark.parametrize("cycles", [1, 3])
def test_readings_at_chosen_deflections_without_times_have_no_corners(cycle: list[float], cycles: int) -> None:
    way = 1e-3 * np.concatenate([cycle, *[cycle[1:]] * (cycles - 1)])
    m = Measurement(way, np.ones(way.size), Annulus(0.010, 0.035), Specimen("film", 5e-5))
    assert with_corners(m) is m


@pytest.mark.parametrize(("step", "gap"), [(0.1, 1.03), (0.01, 0.16)])
def test_times_that_are_rounded_do_not_hide_corners_nor_move_them_far(step: float, gap: float) -> None:
    """Of uneven readings of cycles whose times are rounded: what is close to a reading is no corner."""
    rng, leg = np.random.default_rng(4), 19.37 * gap
    time = np.cumsum(gap * rng.uniform(0.99, 1.01, 640))
    way = 0.02 * np.abs((time / leg + 1) % 2 - 1)
    found = with_corners(moved(np.round(time / step) * step, way))
    between = np.setdiff1d(np.arange(found.path.deflection.size), found.on_path)
    turns = leg * np.arange(1, 36)
    near = [np.min(np.abs(time - c)) > 2 * step for c in turns]
    assert between.size >= 0.8 * np.count_nonzero(near)
    for k in between:
        nearest = int(np.argmin(np.abs(turns - found.path.time[k])))
        assert found.path.time[k] == pytest.approx(turns[nearest], abs=step)
        assert found.path.deflection[k] == pytest.approx(0.02 * (nearest % 2 == 0), abs=0.02 * step / leg)


@pytest.mark.parametrize("told", [0.01, 0.1, 1.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_sine_wave_has_no_corners_where_clocks_are_rounded_and_readings_are_missing(told: float, seed: int) -> None:
    """But for a few, which lie on it."""
    rng = np.random.default_rng(seed)
    for gap, jitter, kept in ((5.3, 0.0, 1.0), (1.0, 0.0, 0.85), (1.037, 0.0, 1.0)):
        time = gap * (1 + jitter * rng.uniform(-1, 1, 400)) * np.arange(400)
        time = time[rng.random(400) < kept] + 1.0
        way = 0.01 * (1 - np.cos(2 * np.pi * time / (40 * gap)))
        clock = np.round(time / told) * told
        found = with_corners(moved(clock, way))
        between = np.setdiff1d(np.arange(found.path.deflection.size), found.on_path)
        assert between.size <= 12
        there = 0.01 * (1 - np.cos(2 * np.pi * found.path.time[between] / (40 * gap)))
        assert found.path.deflection[between] == pytest.approx(there, abs=4e-4)


@pytest.mark.parametrize(("step", "start"), [(1.0, 0.0), (0.1, 0.3), (0.1, 0.7)])
def test_a_turn_whose_reading_is_missing_is_one_where_readings_are_missing_elsewhere(step: float, start: float) -> None:
    """Twice on the way; else the disc may have stood there while nobody read it, unless another turn is where it would
    have turned.
    """
    top, steps = 30.3, np.arange(0.0, 121.0)
    way = 1e-3 * np.abs((steps + top) % (2 * top) - top)
    at_turn, on_the_way, other_turn = 30, (12, 75), 91

    def corners_without(missing: list[int]) -> tuple[np.ndarray, np.ndarray]:
        kept = np.setdiff1d(np.arange(121), missing)
        found = with_corners(moved(start + step * steps[kept], way[kept]))
        between = np.setdiff1d(np.arange(found.path.deflection.size), found.on_path)
        return found.path.time[between], found.path.deflection[between]

    when, where = corners_without([at_turn, *on_the_way, other_turn])
    assert when == pytest.approx(start + step * top * np.arange(1, 4), abs=1e-6)
    assert where == pytest.approx(1e-3 * top * np.array([1, 0, 1]), abs=1e-9)
    assert corners_without([at_turn])[0].size == 3
    assert corners_without([at_turn, on_the_way[0], other_turn])[0].size == 1


def test_a_stop_that_nobody_read_moves_no_turn_where_readings_are_missing_elsewhere() -> None:
    """Ten tops are read, and at one of them the disc stood for a while; or it was read seldom while it was slow."""
    cycle = np.concatenate([np.arange(0.0, 31.0), np.arange(29.0, 0.0, -1.0)])
    way, gaps = np.tile(cycle, 10), np.ones(600)
    gaps[31] = 2.0
    kept = np.setdiff1d(np.arange(600), [200, 340])
    m = moved(np.cumsum(gaps)[kept], 1e-3 * way[kept])
    assert with_corners(m) is m
    slow = np.concatenate([np.full(61, 0.2), np.full(60, 1.0)])
    slow[31] = 0.5
    m = moved(np.cumsum(slow), 1e-3 * np.append(np.tile(cycle, 2), 0.0))
    assert with_corners(m) is m


def test_a_turn_midway_between_two_readings_is_one_where_another_turn_says_so() -> None:
    """The disc is read in one place before and after it, as if it had stood still."""
    top, steps = 30.5, np.arange(0.0, 200.0)
    way = 1e-3 * np.abs((steps + 0.2 * (steps > 100) + top) % (2 * top) - top)
    way[0] = 0.0
    assert way[30] == pytest.approx(way[31], abs=1e-12)
    times = np.where(steps > 100, steps + 0.2, steps)
    found = with_corners(moved(times, way))
    between = np.setdiff1d(np.arange(found.path.deflection.size), found.on_path)
    assert found.path.time[between[0]] == pytest.approx(30.5, abs=1e-6)
    assert found.path.deflection[between[0]] == pytest.approx(1e-3 * top, abs=1e-9)
    alone = moved(times[:60], way[:60])
    assert with_corners(alone) is alone


@pytest.mark.parametrize("seed", range(3))
def test_readings_without_times_turn_where_those_with_times_do(seed: int) -> None:
    """Steps of one size but at turns are those of an even clock."""
    offset = np.random.default_rng(seed).uniform()
    time = 0.41 * (np.arange(180.0) + offset)
    way = np.interp(time, [0, 12.2, 22.4, 32.6, 42.8, 53.0, 75.2], 1e-3 * np.array([0, 12.2, 2, 12.2, 2, 12.2, 34.4]))
    told = moved(time, way)
    times, ways = corners_of(told)
    untold = with_corners(Measurement(way, told.force, told.rig, told.specimen))
    between = np.setdiff1d(np.arange(untold.path.deflection.size), untold.on_path)
    assert times.size >= 3
    assert untold.path.time is None
    np.testing.assert_allclose(untold.path.deflection[between], ways, atol=1e-9)
    assert np.array_equal(untold.leg, with_corners(told).leg)


def stairs(speed: np.ndarray, hold: float, step: float = 1e-3) -> tuple[np.ndarray, np.ndarray]:
    """(s, m) where a staircase with these speeds (k,) m/s and one height has its corners."""
    clock = np.cumsum(np.concatenate([[0.0], np.ravel(np.column_stack([step / speed, np.full(speed.size, hold)]))]))
    return clock, np.repeat(step * np.arange(speed.size + 1), 2)[: clock.size + 1][1:]


def corners_of(m: Measurement) -> tuple[np.ndarray, np.ndarray]:
    """(s, m) of the corners that were found."""
    found = with_corners(m)
    between = np.setdiff1d(np.arange(found.path.deflection.size), found.on_path)
    return found.path.time[between], found.path.deflection[between]


def test_a_stop_soon_after_a_reading_is_one_where_the_ramp_is_read_often() -> None:
    """Ramps are read every 0.05 s, and holds every second: a stop 0.012 s after a reading is well inside."""
    clock, way = stairs(np.full(4, 1e-3 / 0.962), 5.0)
    times = [start + np.arange(0.0, 0.96, 0.05) for start in clock[::2][:-1]]
    times += [stop + np.arange(0.8, 4.9, 1.0) for stop in clock[1::2]]
    time = np.sort(np.concatenate(times))
    at, _ = corners_of(moved(time, np.interp(time, clock, way)))
    for stop in clock[1::2]:
        assert np.min(np.abs(at - stop)) < 1e-6


def test_a_staircase_that_is_read_seldom_moves_as_fast_at_every_step() -> None:
    """Of some moves one interval shows the whole speed, of none two: all stops and starts are known by it."""
    clock, way = stairs(np.full(14, 1e-3 / 1.42), 14.3)
    time = np.arange(0.0, clock[-1], 1.30)
    at, where = corners_of(moved(time, np.interp(time, clock, way)))
    inner = [c for c in clock[1:-1] if np.min(np.abs(time - c)) > 0.05]
    assert len(inner) >= 24
    for c in inner:
        k = np.argmin(np.abs(at - c))
        assert at[k] == pytest.approx(c, abs=1e-6)
        assert where[k] == pytest.approx(np.interp(c, clock, way), abs=1e-9)


@pytest.mark.parametrize(
    ("takes", "hold", "first", "gap", "corners"),
    [
        ((2.9, 4.7), 14.3, 0.0, 1.3, None),  # of two speeds
        ((4.7, 0.5), 14.3, 0.0, 1.3, None),  # of two, of which the faster one is read in no whole interval
        ((0.9,), 9.1, 0.25, 1.0, 0),  # all read at the same moments, none for a whole interval
        ((1.42,), 14.3, 0.6, 1.3, None),  # one shows its speed, and none another
    ],
)
def test_no_stop_is_made_up_where_nobody_knows_how_fast_it_was_left(
    takes: tuple[float, ...], hold: float, first: float, gap: float, corners: int | None
) -> None:
    """What is found is by readings of its own, and there."""
    clock, way = stairs(np.tile(1e-3 / np.array(takes), 10 // len(takes)), hold)
    time = np.arange(first, clock[-1], gap)
    at, _ = corners_of(moved(time, np.interp(time, clock, way)))
    assert corners is None or at.size == corners
    for c in at:
        assert np.min(np.abs(clock - c)) < 1e-6


def test_a_low_first_step_need_not_be_as_fast_as_the_others() -> None:
    """A preload at a third of the speed, held, then ramps at one speed."""
    clock = np.cumsum([0.0, 2.0, 20.0, *np.tile([5.0, 20.0], 4)])
    way = 1e-3 * np.concatenate([[0.0, 0.6, 0.6], 0.6 + np.repeat(5.0 * np.arange(1, 5), 2)])
    time = np.arange(0.0, clock[-1], 1.03)
    at, _ = corners_of(moved(time, np.interp(time, clock, way)))
    assert np.min(np.abs(at - clock[3])) < 1e-6
    assert np.all(at > 21.0)
