"""What arviz says of draws, by its part that needs arrays alone: all of it takes a second to import, matplotlib too."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Any

import numpy as np
from scipy.special import logsumexp

from bayesmembrane.ground.parameters import Array

FEWEST = 5
"""Weights that a tail is fitted to at least."""


@cache
def _statistics() -> Any:
    """On demand: it imports scipy.stats."""
    return import_module("arviz_stats.base").array_stats


def pareto_shape(log_weights: Array, worth: float = 1.0) -> float:
    """k-hat of the largest of the weights exp(``log_weights``) (n,); ``worth``: effective draws for each draw.

    A. Vehtari et al., J. Mach. Learn. Res. 25 (2024) 72.
    """
    return float(pareto_smoothed(log_weights, worth)[1])


def pareto_smoothed(log_weights: Array, worth: float = 1.0) -> tuple[Array, Array]:
    """(smoothed logarithms of weights (..., n), k-hat (...)), each sum of the weights being one.

    Where the largest are all alike they are bounded, k-hat 0. Where few of them are more than nothing beside the very
    largest, or there are fewer than five, no tail can be fitted: they stay as they are, k-hat inf.
    """
    given = np.asarray(log_weights, dtype=float)
    found = [_of_one(row, worth) for row in given.reshape(-1, given.shape[-1])]
    smoothed, shape = np.array([f[0] for f in found]), np.array([f[1] for f in found])
    return smoothed.reshape(given.shape), shape.reshape(given.shape[:-1])


def _of_one(log_weights: Array, worth: float) -> tuple[Array, float]:
    try:
        # What is asked for there is a log likelihood, whose reciprocals are the weights of leaving out.
        with np.errstate(all="ignore"):  # exponentials of which all but one may vanish
            smoothed, shape = _statistics().psislw(-log_weights, r_eff=worth)
    except ValueError:  # no tail that could be fitted
        return log_weights - logsumexp(log_weights), 0.0 if _alike(log_weights, worth) else np.inf
    if np.any(np.isnan(smoothed)):  # a fit to exceedances of which a quarter vanish
        return log_weights - logsumexp(log_weights), np.inf
    return np.asarray(smoothed, dtype=float), float(shape)


def _alike(log_weights: Array, worth: float) -> bool:
    """True if there are as many as make a tail, and its members are all the same."""
    n = len(log_weights)
    tail = int(np.ceil(min(0.2 * n, 3 * np.sqrt(n / worth))))
    return tail >= FEWEST and bool(np.ptp(np.sort(log_weights)[-tail:]) == 0)


def rank_r_hat(chains: Array) -> float:
    """Rank-normalised split R-hat of ``chains`` (E, draws) in order of time."""
    return float(_statistics().rhat(chains, method="rank"))


def worth_of_mean(chains: Array) -> float:
    """How many independent values the mean of ``chains`` (E, draws) in order of time is worth."""
    return float(_statistics().ess(chains, method="mean"))


def shortest_interval(values: Array, share: float) -> tuple[float, float]:
    """The shortest interval that holds ``share`` of all ``values``."""
    low, high = _statistics().hdi(values.ravel(), prob=share)
    return float(low), float(high)


def left_out(log_likelihood: Array, worth: float) -> tuple[Array, Array]:
    """(ln p(y_i | y_-i) (N,), k-hat (N,)) by Pareto-smoothed weights 1 / p, of ``log_likelihood`` (E, draws, N)."""
    of_each = log_likelihood.reshape(-1, log_likelihood.shape[-1]).T
    smoothed, shape = pareto_smoothed(-of_each, worth)
    return np.asarray(logsumexp(smoothed + of_each, axis=1)), shape
