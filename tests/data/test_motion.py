"""The path of a test: clock, speed, and what is remembered of points that were left out."""

import numpy as np
import pytest

from bayesmembrane.calibration.layout import laid_out, measurement_of
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.motion import NOMINAL_SPEED, Motion, holds
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
