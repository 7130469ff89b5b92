"""The zero of the load cell: from the start, once what rested is lifted, or as a cable is."""

import numpy as np
import pytest

from bayesmembrane.data.motion import Motion
from bayesmembrane.physics.effects.force_offset import ForceOffset

WAY = np.concatenate([np.linspace(0.0, 0.05, 51), np.linspace(0.05, 0.0, 51)[1:]])
PATH = Motion(WAY, None, 0.05)
FORCE = 30 * WAY[None] ** 2


def read(*p: float) -> np.ndarray:
    return ForceOffset().read(np.array([p]), FORCE, PATH)[0] - FORCE[0]


def test_a_cell_that_was_not_tared_is_off_from_the_start() -> None:
    assert read(0.02, -20.0, 1e-3, 0.0) == pytest.approx(0.02, rel=1e-8)


def test_a_weight_that_rested_comes_as_it_is_lifted_and_goes_as_it_is_set_down() -> None:
    found = read(-0.02, 20.0, 1e-3, 0.0)
    assert found[[0, -1]] == pytest.approx(0.0, abs=1e-9)
    assert found == pytest.approx(-0.02 * (1 - np.exp(-WAY / 1e-3)), abs=1e-9)
    assert found == pytest.approx(found[::-1])
    assert found[50] == pytest.approx(-0.02, rel=1e-6)


def test_a_cable_pulls_more_in_proportion_to_the_way() -> None:
    """Of the full range, of which this test goes half; as far up as back, and less below."""
    way = np.append(WAY, [-0.01, -0.02])
    path = Motion(way, None, 0.1)
    found = ForceOffset().read(np.array([[0.02, -20.0, 1e-3, 0.3]]), np.zeros((1, way.size)), path)[0]
    assert found == pytest.approx(0.02 * (1 + 0.3 * way / 0.1), rel=1e-8)
    resting = ForceOffset().read(np.array([[0.02, 20.0, 1e-3, 0.3]]), np.zeros((1, way.size)), path)[0]
    assert found - resting == pytest.approx(0.02 * np.exp(-np.abs(way) / 1e-3), rel=1e-6)
