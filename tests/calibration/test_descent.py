import numpy as np
import pytest

from bayesmembrane.calibration.descent import Descent, Patience, descend

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


def flat(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """r that no step makes much less: its first part is constant."""
    r = np.stack([np.full(len(x), 10.0), 1e-3 * x[:, 0], 1e-3 * x[:, 1]], axis=1)
    j = np.zeros((len(x), 3, 2))
    j[:, 1, 0] = j[:, 2, 1] = 1e-3
    return r, j


def test_where_a_whole_step_promises_too_little_none_is_taken() -> None:
    start = np.array([[2.0, -3.0]])
    search = Descent(start, (LOW, HIGH), 50, patience=Patience(settled=1e-6))
    search.told(*flat(search.asked))
    assert not len(search.asked)
    assert np.array_equal(search.x, start)


def test_steps_that_gain_little_end_a_search_however_large_the_rest() -> None:
    """Of a sum of squares of 1e6 a part of 1e-9 is 1e-3, and nobody needs that."""
    steps = []

    def far(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        steps.append(len(x))
        r, j = rosenbrock(x)
        return np.concatenate([r, np.full((len(x), 1), 1e3)], axis=1), np.concatenate([j, 0 * j[:, :1]], axis=1)

    start, taken = np.array([[-3.0, 2.0]]), []
    for slow_by in (0.0, 0.01):
        steps.clear()
        _, size = descend(far, start, (LOW, HIGH), 200, patience=Patience(slow_below=0.0, slow_by=slow_by))
        taken.append((len(steps), size[0] ** 2))
    assert taken[1][0] < taken[0][0]
    assert taken[1][1] == pytest.approx(taken[0][1], abs=0.5)


def test_a_valley_that_still_promises_is_followed_to_its_end() -> None:
    """The damped step gains little there, and the whole one much."""
    x, _ = descend(rosenbrock, np.array([[-3.0, 2.0]]), (LOW, HIGH), 200, patience=Patience(settled=1e-6))
    assert x[0] == pytest.approx([1.0, 1.0], abs=1e-3)


def test_searches_side_by_side_end_where_each_ends_alone() -> None:
    starts = [np.array([[-3.0, 2.0]]), np.array([[2.0, 2.0], [0.0, -1.0]])]
    searches = [Descent(s, (LOW, HIGH), 100) for s in starts]
    while going := [s for s in searches if len(s.asked)]:
        r, j = rosenbrock(np.concatenate([s.asked for s in going]))
        ends = np.cumsum([0, *(len(s.asked) for s in going)])
        for s, a, b in zip(going, ends[:-1], ends[1:], strict=True):
            s.told(r[a:b], j[a:b])
    for s, start in zip(searches, starts, strict=True):
        x, size = descend(rosenbrock, start, (LOW, HIGH), 100)
        assert s.x == pytest.approx(x, abs=1e-9)
        assert s.size == pytest.approx(size, abs=1e-9)
