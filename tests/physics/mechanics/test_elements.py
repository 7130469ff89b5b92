"""Elements: what their functions are, where they are put, and that a solution stays itself on others."""

from __future__ import annotations

import numpy as np
import pytest

from bayesmembrane.physics.mechanics.ritz import elements
from bayesmembrane.physics.mechanics.ritz.batch import LEVELS

RATIO, SPAN = 3.5, np.log(3.5)


def some(level, count, seed):
    """(unknowns, ends, gains) of smooth solutions of a level."""
    rng, number = np.random.default_rng(seed), level[0]
    ends = np.sort(np.append(rng.uniform(0, SPAN, (count, number - 1)), np.tile([0, SPAN], (count, 1)), axis=1), axis=1)
    return rng.normal(size=(count, elements.unknowns(*level))), ends, rng.uniform(size=(count, number))


@pytest.mark.parametrize("level", LEVELS)
def test_functions_vanish_at_the_edges_and_slopes_are_differences(level):
    (q,), (ends,), _ = some(level, 1, 1)
    value, _ = elements.evaluate(q, ends, level[1], np.array([0.0, SPAN]))
    np.testing.assert_allclose(value, 0, atol=1e-12)
    inside, h = 0.5 * (ends[1:] + ends[:-1]), 1e-6 * np.min(np.diff(ends))
    _, slope = elements.evaluate(q, ends, level[1], inside)
    above, below = (elements.evaluate(q, ends, level[1], inside + s)[0] for s in (h, -h))
    np.testing.assert_allclose(slope, (above - below) / (2 * h), rtol=1e-5, atol=1e-5 * np.abs(slope).max())


@pytest.mark.parametrize("level", LEVELS)
def test_tables_are_the_functions_at_the_gauss_points_and_edges(level):
    _, weights, value, rate, extra, low, width = elements.basis(*level)
    assert weights.sum() == pytest.approx(2)
    np.testing.assert_allclose(value[:, -2:], np.eye(level[1] + 2)[[0, -1]].T, atol=1e-13)
    # Bubbles and the next two are of unit slope norm, and their slopes are orthogonal.
    slopes = np.concatenate([rate[1:-1, :-2], extra[1]])
    np.testing.assert_allclose(slopes * weights @ slopes.T, np.eye(level[1] + 2), atol=1e-12)
    assert low.size == elements.unknowns(*level)
    assert np.max(np.arange(low.size) - low) + 1 == width


def test_a_polynomial_stays_itself_on_elements_that_have_its_degree():
    q, ends, gains = some((1, 6), 5, 2)
    new, moved = elements.replaced(q, ends, gains, np.full(5, 2.0), 6, (4, 7))
    t = np.linspace(0, SPAN, 301)
    for k in range(5):
        before, after = (elements.evaluate(v[k], e[k], b, t) for v, e, b in ((q, ends, 6), (moved, new, 7)))
        np.testing.assert_allclose(after[0], before[0], atol=1e-11)
        np.testing.assert_allclose(after[1], before[1], atol=1e-9)


@pytest.mark.parametrize("level", LEVELS[1:])
def test_elements_cover_the_film_in_order_and_none_is_left_too_wide(level):
    q, ends, gains = some((4, 7), 200, 3)
    gains[::2] *= 10.0 ** np.random.default_rng(4).uniform(-20, 0, gains[::2].shape)
    new, moved = elements.replaced(q, ends, gains, np.full(200, 2.0), 7, level)
    np.testing.assert_allclose(new[:, [0, -1]], np.tile([0, SPAN], (200, 1)), atol=1e-15)
    assert np.all(np.diff(new, axis=1) > 0)
    # What is spread evenly is that part of the whole: an element may be as wide as all of it goes round.
    assert np.all(np.diff(new, axis=1) <= SPAN * (1 + elements.WIDEST) / (elements.WIDEST * level[0]) + 1e-12)
    assert np.all(np.isfinite(moved))


def test_elements_gather_where_they_gain_and_where_the_film_bends():
    ends = np.linspace(0, SPAN, 9)[None]
    flat = np.zeros((1, elements.unknowns(8, 8)))
    gains = np.full((1, 8), 1e-16)
    gains[0, 5] = 1e-4
    (new,), _ = elements.replaced(flat, ends, gains, np.ones(1), 8, (8, 8))
    inside = (new[1:-1] > ends[0, 5] - 1e-9) & (new[1:-1] < ends[0, 6] + 1e-9)
    assert inside.sum() >= 4


def test_a_film_at_rest_may_be_moved():
    new, moved = elements.replaced(np.zeros((1, 12)), np.array([[0.0, SPAN]]), np.zeros((1, 1)), np.ones(1), 6, (4, 7))
    np.testing.assert_array_equal(moved, 0)
    assert np.all(np.diff(new) > 0)
