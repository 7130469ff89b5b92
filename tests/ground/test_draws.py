"""What is said of draws: against shapes and intervals that are known, and against arviz itself."""

from __future__ import annotations

import numpy as np
import pytest

from bayesmembrane.ground.draws import (
    left_out,
    pareto_shape,
    pareto_smoothed,
    rank_r_hat,
    shortest_interval,
    worth_of_mean,
)
from bayesmembrane.ground.quiet import arviz


@pytest.mark.parametrize("shape", [-0.3, 0.2, 0.5, 0.9])
def test_the_shape_of_pareto_weights_is_found(shape: float) -> None:
    """A fit to 190 of the largest of 4000 has a standard error of (1 + k) / sqrt(190): five of them."""
    u = np.random.default_rng(3).random(4000)
    found = pareto_shape(np.log((u**-shape - 1) / shape + 0.1))
    assert found == pytest.approx(shape, abs=5 * (1 + abs(shape)) / np.sqrt(190))


def test_smoothed_weights_sum_to_one_and_keep_their_order() -> None:
    log_weights = np.random.default_rng(4).standard_t(4, (3, 1000))
    smoothed, shape = pareto_smoothed(log_weights)
    assert (shape.shape, smoothed.shape) == ((3,), log_weights.shape)
    assert np.sum(np.exp(smoothed), axis=1) == pytest.approx(1.0, abs=1e-12)
    assert all(np.all(np.diff(s[np.argsort(w)]) >= -1e-12) for s, w in zip(smoothed, log_weights, strict=True))


def test_weights_that_are_alike_are_bounded_and_few_say_nothing() -> None:
    smoothed, shape = pareto_smoothed(np.array([np.full(100, -3.0), np.full(100, 2.0)]))
    assert np.exp(smoothed) == pytest.approx(0.01)
    assert shape == pytest.approx(0.0)
    assert pareto_shape(np.zeros(12)) == np.inf


@pytest.mark.parametrize("spread", [700.0, 1500.0, 3000.0])
@pytest.mark.parametrize("seed", range(5))
def test_weights_of_which_one_is_all_are_bad(spread: float, seed: int) -> None:
    """Beside it the others vanish, and so do the exceedances that a tail would be fitted to."""
    log_weights = -0.5 * spread * np.random.default_rng(seed).chisquare(4, 200)
    smoothed, shape = pareto_smoothed(log_weights)
    assert shape > 0.7
    assert not np.any(np.isnan(smoothed))
    assert np.sum(np.exp(smoothed)) == pytest.approx(1.0)


def test_a_reading_of_which_three_draws_know_better_is_not_told_as_known() -> None:
    likelihood = np.zeros((1, 1000, 2))
    likelihood[0, :3, 0] = -5.0
    terms, shape = left_out(likelihood, 1.0)
    assert np.all(np.isfinite(terms))
    assert shape[0] > 0.7


def test_too_few_for_a_tail_say_nothing_however_much_each_is_worth() -> None:
    assert pareto_shape(9.0 * np.random.default_rng(7).standard_normal(30), worth=20.0) == np.inf


def test_they_are_those_of_arviz() -> None:
    rng = np.random.default_rng(5)
    chains = rng.standard_normal((2, 900)) + 0.1 * np.cumsum(rng.standard_normal((2, 900)), axis=1)
    assert rank_r_hat(chains) == pytest.approx(float(arviz.rhat(chains, method="rank")), rel=1e-9)
    assert worth_of_mean(chains) == pytest.approx(float(arviz.ess(chains, method="mean")), rel=1e-9)
    theirs, k = arviz.psislw(chains.ravel().copy(), reff=0.7)
    ours, found = pareto_smoothed(chains.ravel(), 0.7)
    assert (float(found), ours) == (pytest.approx(float(k), abs=0.02), pytest.approx(np.asarray(theirs), abs=0.02))


def test_leaving_out_a_reading_of_a_known_mean_is_exact() -> None:
    """y_i ~ N(m, 1), m ~ N(0, 100): p(y_i | y_-i) is normal, about the mean of the others."""
    rng = np.random.default_rng(6)
    y = rng.standard_normal(12)
    precision = len(y) + 0.01
    m = np.sum(y) / precision + rng.standard_normal((2, 20_000)) / np.sqrt(precision)
    likelihood = -0.5 * (y - m[..., None]) ** 2 - 0.5 * np.log(2 * np.pi)
    terms, shape = left_out(likelihood, 1.0)
    rest = precision - 1
    mean, variance = (np.sum(y) - y) / rest, 1 + 1 / rest
    exact = -0.5 * (y - mean) ** 2 / variance - 0.5 * np.log(2 * np.pi * variance)
    assert terms == pytest.approx(exact, abs=0.02)
    assert np.all(shape < 0.5)


def test_the_shortest_interval_holds_its_share() -> None:
    values = np.random.default_rng(0).exponential(size=20000)
    low, high = shortest_interval(values, 0.94)
    assert low < 0.01
    assert np.mean((values >= low) & (values <= high)) == pytest.approx(0.94, abs=1e-3)
    assert shortest_interval(np.ones(3), 0.94) == (1.0, 1.0)
