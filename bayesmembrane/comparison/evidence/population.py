"""Draws from a target that nobody has sampled yet: populations that are led from the prior to the posterior."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from bayesmembrane.calibration.sampling.convergence import effective_draws
from bayesmembrane.calibration.sampling.proposals.mixture import Mixture, around
from bayesmembrane.comparison.evidence.search import Modes, joined
from bayesmembrane.comparison.evidence.target import Problem
from bayesmembrane.ground.numbers import bisected
from bayesmembrane.ground.parameters import Array

HALVINGS = 60  # of the interval of rises
KEPT = 0.5  # effective part of the population after each rise of the power
ACCEPTED = 4  # moves a walker, and one more for each dimension, between two powers
MOST_MOVES = 150
LEAST_PART = 0.02  # of proposals accepted; below that more moves are no help
JUMP = 0.1  # part of the moves that may change valleys

Base = Callable[[Array], tuple[Array, Array]]
"""(ln of what is sampled already, ln of what is added by degrees) at x (B, k), (B,) each."""


@dataclass(frozen=True, eq=False)
class LedWalkers:
    """Walkers led to base * added^1.

    x : (S, W, k) snapshots of W walkers
    log_base, log_added : (S, W)
    log_ratio, sd : ln of the ratio of the two normalisations by stepping stones, and its standard error
    """

    x: Array
    log_base: Array
    log_added: Array
    log_ratio: float
    sd: float


def from_prior(problem: Problem, modes: Modes, rng: np.random.Generator, walkers: int, snapshots: int) -> LedWalkers:
    """Populations of p(x | y) ~ g^(1-b) (p0 L)^b with g half the prior and half the modes that are known.

    ``log_ratio`` is then an estimate of ln Z. Without any mode g is the prior.
    """
    if not modes.clouds:
        start = problem.prior_draws(rng, walkers)
        found = lead(problem.terms, start.x[:walkers], rng, snapshots)
        sd = float(np.hypot(found.sd, start.log_part_sd))
        return replace(found, log_ratio=found.log_ratio + float(np.log(start.part)), sd=sd)
    beside = joined([around(x, rng) for x in modes.clouds], modes.weights)

    def terms(x: Array) -> tuple[Array, Array]:
        log_prior, log_likelihood = problem.terms(x)
        base = np.logaddexp(log_prior, beside.log_density(x)) - np.log(2.0)
        # Where the prior is cut there is nothing, whatever g says.
        return np.where(log_prior > -np.inf, base, -np.inf), log_likelihood + log_prior - base

    x, part, sd = _spread_out(problem, beside, rng, walkers)
    found = lead(terms, x, rng, snapshots)
    return replace(found, log_ratio=found.log_ratio + float(np.log(part)), sd=float(np.hypot(found.sd, sd)))


def _spread_out(
    problem: Problem, beside: Mixture, rng: np.random.Generator, walkers: int
) -> tuple[Array, float, float]:
    """Draws (walkers, k) of half the prior and half ``beside`` where the posterior is not zero.

    With the part of such draws among all, and the standard error of its logarithm.
    """
    prior = problem.prior_draws(rng, walkers)
    y = beside.draw(rng, 4 * walkers)
    y = y[np.isfinite(problem.log_posterior(y))]
    share = len(y) / (4 * walkers)
    part = 0.5 * (prior.part + share)
    near = rng.random(walkers) < 0.5 * share / part
    x = np.where(near[:, None], y[rng.integers(len(y), size=walkers)], prior.x[:walkers]) if len(y) else prior.x
    error = 0.5 * np.hypot(prior.part * prior.log_part_sd, np.sqrt(share * (1 - share) / (4 * walkers))) / part
    return x[:walkers], part, float(error)


def lead(terms: Base, start: Array, rng: np.random.Generator, snapshots: int) -> LedWalkers:
    """Lead draws ``start`` (W, k) of exp(base) to draws of exp(base + added), in steps that keep half of them alive.

    At each power the population is weighted, resampled and moved by differential evolution (P. Del Moral, A. Doucet,
    A. Jasra, J. R. Stat. Soc. B 68 (2006) 411; C. J. F. ter Braak, Stat. Comput. 16 (2006) 239). The weights give
    ln of the ratio of normalisations.
    """
    x = start.copy()
    base, added = terms(x)
    power, log_ratio, variance = 0.0, 0.0, 0.0
    while power < 1.0:
        rise = _rise(added, 1.0 - power)
        log_weight = rise * added
        top = float(np.max(log_weight))
        weight = np.exp(log_weight - top)
        log_ratio += top + float(np.log(np.mean(weight)))
        variance += float(np.var(weight) / np.mean(weight) ** 2) / len(x)
        power = min(1.0, power + rise)
        chosen = _systematic(weight, rng)
        x, base, added = x[chosen], base[chosen], added[chosen]
        x, base, added = _moved(terms, x, base, added, power, rng)
    kept = [(x, base, added)]
    for _ in range(snapshots - 1):
        x, base, added = _moved(terms, x, base, added, 1.0, rng)
        kept.append((x, base, added))
    snapshots_x, log_base, log_added = (np.stack(part) for part in zip(*kept, strict=True))
    return LedWalkers(snapshots_x, log_base, log_added, log_ratio, float(np.sqrt(variance)))


def _rise(added: Array, left: float) -> float:
    """The largest rise of the power, up to ``left``, that keeps the effective population at `KEPT` of the walkers."""

    def part(rise: float) -> float:
        w = np.exp(rise * (added - np.max(added)))
        return effective_draws(w) / len(w)

    if part(left) >= KEPT:
        return left
    rise, _ = bisected(lambda r: part(r) >= KEPT, 0.0, left, HALVINGS)
    return max(rise, 1e-12)


def _systematic(weight: Array, rng: np.random.Generator) -> Array:
    """Indices (W,) drawn in proportion to ``weight`` (W,), from one uniform number."""
    at = (rng.random() + np.arange(len(weight))) / len(weight)
    return np.minimum(np.searchsorted(np.cumsum(weight) / np.sum(weight), at), len(weight) - 1)


def _moved(
    terms: Base, x: Array, base: Array, added: Array, power: float, rng: np.random.Generator
) -> tuple[Array, Array, Array]:
    """The population after as many moves as it takes for each walker to be elsewhere."""
    wanted = ACCEPTED + x.shape[1]
    x, base, added = x.copy(), base.copy(), added.copy()
    order = rng.permutation(len(x))
    halves = order[: len(x) // 2], order[len(x) // 2 :]
    accepted = 0.0
    for i in range(MOST_MOVES):
        for here, there in (halves, halves[::-1]):
            to = x[here] + _steps(x[there], len(here), rng)
            new_base, new_added = terms(to)
            gain = new_base - base[here] + power * np.where(new_base > -np.inf, new_added - added[here], 0.0)
            good = np.log(rng.random(len(here))) < gain
            rows = here[good]
            x[rows], base[rows], added[rows] = to[good], new_base[good], new_added[good]
            accepted += float(np.mean(good)) / 2
        if accepted >= wanted or (i >= MOST_MOVES // 4 and accepted < LEAST_PART * i):
            break
    return x, base, added


def _steps(others: Array, count: int, rng: np.random.Generator) -> Array:
    """g (a - b) for pairs of the other half, (count, k): g about 2.38 / sqrt(2 k), at times 1."""
    k = others.shape[1]
    a, b = rng.integers(len(others), size=(2, count))
    g = 2.38 / np.sqrt(2 * k) * np.exp(rng.normal(-0.2, 0.5, count))
    g = np.where(rng.random(count) < JUMP, 1.0, g)
    jitter = 1e-5 * np.std(others, axis=0) * rng.standard_normal((count, k))
    return np.asarray(g[:, None] * (others[a] - others[b]) + jitter)
