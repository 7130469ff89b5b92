"""The path of a test: clock, speed, and what is remembered of points that were left out."""

import numpy as np
import pytest

from bayesmembrane.calibration.layout import laid_out, measurement_of
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.motion import NOMINAL_SPEED, Motion, check_order, holds
from bayesmembrane.ground.errors import DataError
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.annulus import Annulus

D = np.concatenate([np.linspace(1e-3, 0.02, 20), np.linspace(0.019, 1e-3, 19), np.linspace(2e-3, 0.04, 39)])
TIME = np.concatenate([np.arange(1.0, 40.0), 39.0 + 0.1 * np.arange(1, 40)])
CURVE = Measurement(D, 30 * D, Annulus(0.01, 0.035), Specimen("film", 5e-5), time=TIME)


def test_the_clock_starts_where_the_disc_stood_at_zero() -> None:
    assert CURVE.path.clock == pytest.approx(TIME)
    late = Motion(D, TIME + 1000.0, 0.04)
    assert late.clock == pytest.approx(TIME)
    assert Motion(D, None, 0.04).clock[19] == pytest.approx(0.02 / NOMINAL_SPEED)


def test_speed_is_that_of_each_leg() -> None:
    speed = CURVE.path.speed
    assert speed[:38] == pytest.approx(1e-3)
    assert speed[42:] == pytest.approx(1e-2)
    held = Motion(np.array([0.01, 0.02, 0.02, 0.02]), np.array([1.0, 2.0, 50.0, 100.0]), 0.02)
    assert np.all(held.speed > 0)
    assert np.all(Motion(D, None, 0.04).speed == NOMINAL_SPEED)


def test_one_point_has_a_path() -> None:
    one = Motion(np.array([0.01]), np.array([5.0]), 0.01)
    assert one.clock == pytest.approx([0.0])
    assert np.all(one.speed == NOMINAL_SPEED)
    still = Motion(np.full(5, 0.01), np.arange(5.0), 0.01)
    assert np.all(still.speed == NOMINAL_SPEED)


def test_legs_and_cycles_of_a_selection_are_those_of_the_test() -> None:
    part = CURVE.select(CURVE.cycle == 2)
    assert np.all(part.cycle == 2)
    assert np.array_equal(part.is_first_loading, CURVE.is_first_loading[CURVE.cycle == 2])
    again = part.select(part.deflection > 0.01)
    assert np.array_equal(again.path.deflection, D)
    assert np.array_equal(again.path.deflection[again.on_path], again.deflection)


def test_what_comes_later_is_not_remembered() -> None:
    """The first points of a curve are a curve of their own: nothing was left out before any of them."""
    first = CURVE.select(np.arange(20))
    assert first.motion is None
    assert first.path.deflection.size == 20
    assert CURVE.select(np.arange(20, 30)).path.deflection.size == 30


def test_a_stored_selection_comes_back() -> None:
    part = CURVE.select(CURVE.cycle == 2)
    back = measurement_of(laid_out(part))
    assert back.data_hash == part.data_hash
    assert np.array_equal(back.path.deflection, part.path.deflection)
    assert np.array_equal(back.on_path, part.on_path)
    assert (
        part.data_hash
        != Measurement(**{k: getattr(part, k) for k in ("deflection", "force", "rig", "specimen", "time")}).data_hash
    )


def test_a_hold_is_where_the_disc_stands_still_and_not_where_it_goes_slowly() -> None:
    rng = np.random.default_rng(8)
    up, down = np.linspace(0.0, 0.04, 60), np.linspace(0.04, 0.0, 60)
    d = np.concatenate([up, np.full(50, 0.04), down, np.zeros(30), up])
    found = holds(d + 2e-6 * rng.standard_normal(d.size))
    assert [(h[0], h[-1]) for h in found] == [(59, 110), (169, 200)]
    assert holds(np.concatenate([up, down])) == []
    assert holds(np.linspace(0.0, 0.04, 5000)) == []
    # Ten times as many readings on a leg, as of one ten times as slow that is read at the same rate.
    assert holds(np.concatenate([up, np.linspace(0.04, 0.0, 600)])) == []


UP = np.linspace(0.0, 0.02, 41)


def test_a_disc_rests_where_it_is_held_and_has_just_moved_where_it_stops() -> None:
    held = np.concatenate([UP, np.full(30, UP[-1]), UP[-2::-1]])
    m = Motion(held, np.arange(held.size, dtype=float), UP[-1])
    assert np.flatnonzero(m.rests).tolist() == list(range(41, 71))
    assert m.moving_speed[m.rests] == pytest.approx(0.0)
    assert m.moving_speed[~m.rests] == pytest.approx(0.02 / 40)


def test_a_hold_in_which_an_encoder_flickers_is_a_rest_from_end_to_end() -> None:
    rng = np.random.default_rng(4)
    held = np.full(60, UP[-1]) + 1e-5 * (rng.random(60) < 0.3)
    m = Motion(np.concatenate([UP, held, UP[-2::-1]]), np.arange(141.0), 0.02)
    assert np.flatnonzero(m.rests)[[0, -1]] == pytest.approx([41, 100], abs=2)
    assert np.all(m.rests[43:98])


def test_short_rests_of_a_staircase_are_seen() -> None:
    each = [np.append(np.linspace(low, low + 1e-3, 6)[1:], np.full(5, low + 1e-3)) for low in 1e-3 * np.arange(8)]
    m = Motion(np.concatenate([[0.0], *each]), np.arange(81.0), 8e-3)
    assert holds(m.deflection) == []
    assert np.array_equal(m.rests, np.append(False, np.tile(np.arange(10) >= 5, 8)))
    assert m.moving_speed[m.rests] == pytest.approx(0.0)
    assert m.moving_speed[~m.rests] == pytest.approx(2e-4)


def test_steps_of_an_encoder_slow_parts_and_turns_are_no_rests() -> None:
    t = np.arange(2000.0) * 0.04
    steps = Motion(np.floor(5 * t) / 5 * 1e-3, t, 0.08)  # 1 mm/s, told in steps of 0.2 mm
    sine = Motion(0.01 * (1 - np.cos(2 * np.pi * t / 40)), t, 0.02)
    slower = Motion(np.concatenate([UP, UP[-1] + 0.05 * UP[1:]]), np.arange(81.0), 0.021)
    noisy = Motion(1e-3 * t + 1e-5 * np.random.default_rng(1).standard_normal(t.size), t, 0.08)
    for m in (steps, sine, slower, noisy):
        assert not np.any(m.rests)
        assert np.array_equal(m.moving_speed, m.speed)
    assert np.median(steps.moving_speed) == pytest.approx(1e-3, rel=0.15)


def test_the_first_leg_ends_at_the_first_turn_or_with_the_test() -> None:
    there_and_back = np.concatenate([UP, UP[-2::-1]])
    clock = np.arange(there_and_back.size, dtype=float)
    assert Motion(there_and_back, clock, 0.02).first_turn == pytest.approx(40.0)
    assert Motion(UP, clock[:41], 0.02).first_turn == pytest.approx(40.0)


@pytest.mark.parametrize(
    ("mm", "told"),
    [
        ([0, 1, 2, 3, 3, 2, 1, 0, 0, 1, 2, 3], ""),
        ([0, 0, 0, 1, 2, 3, 3, 3, 2, 1, 0, 0], ""),
        ([0, 1, 2, 2, 3], "line 5: the deflection 2 mm stands there twice"),
        ([1, 1, 2, 3], "line 3: the deflection 1 mm stands there twice"),
        ([0, 1, 2, 2], "line 5: the deflection 2 mm stands there twice"),
        ([0, 1, 2, 1, 1, 0], "line 6: the deflection 1 mm stands there twice"),
        ([0, 3, 3, 2, 4], "line 5: the deflection is not in order (2 mm after 3 mm)"),
        ([3, 3, 2, 1], "line 3: the deflection 3 mm stands there twice"),
    ],
)
def test_without_times_a_deflection_stands_twice_at_a_turn_and_at_zero_alone(mm: list[float], told: str) -> None:
    deflection = 1e-3 * np.array(mm, dtype=float)
    places = [f"line {k + 2}" for k in range(deflection.size)]
    if not told:
        check_order(deflection, places)
        return
    with pytest.raises(DataError) as fault:
        check_order(deflection, places)
    assert told in str(fault.value)


@pytest.mark.parametrize("name", ["mullins", "hysteresis", "viscoelastic", "friction", "permanent_set", "force_drift"])
def test_a_turn_that_stands_twice_is_one_turn(name: str) -> None:
    """Two cycles with their ends in both legs, and once: what a film remembers is the same."""
    up = np.linspace(0.0, 0.03, 31)
    once = np.concatenate([up, up[-2::-1], up[1:], up[-2::-1]])
    twice = np.concatenate([up, up[::-1], up, up[::-1]])
    rows = np.flatnonzero(np.append(True, np.diff(twice) != 0))
    claim = hypothesis("neo_hookean", [name])
    x = np.array([[float(p.prior.quantile(0.6)) for p in claim.parameters]])
    forces = []
    for way in (once, twice):
        m = Measurement(way, 1.0 + way, Annulus(0.010, 0.035), Specimen("film", 50e-6))
        forces.append(Forward(claim, m, m.deflection)(x, reached=False).force[0])
    assert np.all(np.isfinite(forces[0]))
    assert forces[1][rows] == pytest.approx(forces[0], rel=1e-9, abs=1e-12)
