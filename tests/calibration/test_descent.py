import numpy as np
import pytest

from bayesmembrane.calibration.descent import Patience, descend

LOW, HIGH = np.full(2, -5.0), np.full(2, 5.0)


def rosenbrock(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    r = np.stack([1 - x[:, 0], 10 * (x[:, 1] - x[:, 0] ** 2)], axis=1)
    j = np.zeros((len(x), 2, 2))
    j[:, 0, 0], j[:, 1, 0], j[:, 1, 1] = -1, -20 * x[:, 0], 10
    return r, j


def test_a_curved_valley_is_followed_from_every_start() -> None:
    start = np.random.default_rng(1).uniform(-4, 4, (20, 2))
    x, size = descend(rosenbrock, start, (LOW, HIGH), 200)
    assert x == pytest.approx(np.ones((20, 2)), abs=1e-6)
    assert size == pytest.approx(np.zeros(20), abs=1e-6)


def test_walls_of_nan_are_not_crossed() -> None:
    def walled(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        r, j = rosenbrock(x)
        return np.where(x[:, :1] > 0.5, np.nan, r), j

    x, size = descend(walled, np.array([[-1.0, 1.0], [2.0, 2.0]]), (LOW, HIGH), 200)
    assert x[0, 0] <= 0.5
    assert size[0] < 0.75
    assert size[1] == np.inf


def test_no_start_and_no_step_goes_where_slopes_are_missing() -> None:
    """A film may have a force and no slope: the step after it would be nowhere."""

    def walled(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        r, j = rosenbrock(x)
        j[x[:, 0] > 0.5, 1] = np.nan
        return r, j

    x, size = descend(walled, np.array([[-1.0, 1.0], [2.0, 2.0]]), (LOW, HIGH), 200)
    assert np.all(np.isfinite(x))
    assert x[0, 0] <= 0.5
    assert size[0] < 0.75
    assert size[1] == np.inf


def test_bounds_and_held_coordinates_are_kept() -> None:
    start = np.array([[-3.0, 2.0]])
    x, _ = descend(rosenbrock, start, (LOW, np.array([0.5, 5.0])), 200)
    assert x[0] == pytest.approx([0.5, 0.25], abs=1e-5)
    x, _ = descend(rosenbrock, start, (LOW, HIGH), 200, held=np.array([[True, False]]))
    assert x[0] == pytest.approx([-3.0, 5.0], abs=1e-6)


def test_a_search_that_is_low_enough_asks_for_no_more() -> None:
    asked = []

    def listening(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        asked.append(len(x))
        return rosenbrock(x)

    start = np.array([[-3.0, 2.0], [1.0, 1.01]])
    _, size = descend(listening, start, (LOW, HIGH), 200, patience=Patience(enough=0.5))
    assert np.all(size < 0.5)
    # The second row begins below, and costs its first look alone.
    assert asked[0] == 2
    assert set(asked[1:]) == {1}
    enough = len(asked)
    asked.clear()
    descend(listening, start[:1], (LOW, HIGH), 200)
    assert enough < len(asked)
