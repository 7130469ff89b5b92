"""A mixture that gets further components where its weights are largest, until none of them counts for too much."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bayesmembrane.calibration.sampling.convergence import effective_draws
from bayesmembrane.calibration.sampling.proposals.mixture import Mixture
from bayesmembrane.ground.parameters import Array

FIRST, EACH, NEW = 2000, 300, 4
"""Draws of the mixture to begin with, draws of the components of each turn, and how many those are."""
TURNS = 15
NEAR = 120  # points around a large weight from which a component takes its scatter
DEGREES = 5.0
ENOUGH = 0.6  # effective draws for each, with which no more components are wanted
FLAT = 1e-6  # of the covariance of all points: no component is flatter

LogDensity = Callable[[Array], Array]
"""(B,) ln p of x (B, k), -inf where it is not possible."""


@dataclass(frozen=True, eq=False)
class Filled:
    """The mixture, all x (M, k) drawn of it, and, (M,) each, ln p there and log weights ln p - ln mixture."""

    mixture: Mixture
    x: Array
    log_posterior: Array
    log_weights: Array


def filled(g: Mixture, log_density: LogDensity, rng: np.random.Generator) -> Filled:
    """Incremental mixture importance sampling (A. E. Raftery, L. Bao, Biometrics 66 (2010) 1162) from the mixture g.

    In each turn the points of the largest weights p / g_t become centres of t-distributions with the weighted scatter
    of their neighbours, draws of these are solved, and g_t+1 is what all draws so far come from, by their numbers.
    """
    x = g.draw(rng, FIRST)
    lp, total, parts = log_density(x), g.log_density(x) + np.log(FIRST), [(g, FIRST)]
    for _ in range(TURNS):
        w = _weights(lp - total)
        if np.count_nonzero(w) < NEAR or effective_draws(w) > ENOUGH * len(w):
            break
        some = w > 0
        more = around_largest(x[some], w[some], _scatter(x[some], w[some]))
        y = more.draw(rng, EACH)
        parts.append((more, EACH))
        there = np.logaddexp.reduce([part.log_density(y) + np.log(n) for part, n in parts], axis=0)
        total = np.concatenate([np.logaddexp(total, more.log_density(x) + np.log(EACH)), there])
        x, lp = np.concatenate([x, y]), np.concatenate([lp, log_density(y)])
    return Filled(joined(parts), x, lp, lp - total + np.log(len(x)))


def joined(parts: list[tuple[Mixture, int]] | list[tuple[Mixture, float]]) -> Mixture:
    """One mixture of several of the same coordinates, each with its weight; the tails are the heaviest of all."""
    whole = np.log(sum(weight for _, weight in parts))
    return Mixture(
        np.concatenate([g.log_weights + np.log(weight) - whole for g, weight in parts]),
        np.concatenate([g.means for g, _ in parts]),
        np.concatenate([g.roots for g, _ in parts]),
        min(g.degrees for g, _ in parts),
        parts[0][0].bend,
    )


def _weights(log_weights: Array) -> Array:
    """Weights that add up to one; none where all are zero."""
    top = np.max(log_weights)
    if not np.isfinite(top):
        return np.zeros(len(log_weights))
    w = np.exp(log_weights - top)
    return np.asarray(w / np.sum(w))


def _scatter(x: Array, w: Array) -> Array:
    """(k, k) of x (M, k) by weights (M,) that add up to one."""
    away = x - w @ x
    return np.asarray(away.T @ (away * w[:, None]))


def around_largest(x: Array, w: Array, scatter: Array) -> Mixture:
    """Equal t-distributions around the largest weights w (M,) of x (M, k), none within the neighbours of another.

    ``scatter`` (k, k) says who is a neighbour; raises `LinAlgError` where it is flat.
    """
    root = np.linalg.cholesky(scatter + 1e-9 * np.diag(np.diagonal(scatter)))
    z = x @ np.linalg.inv(root).T
    free, centres, roots = np.ones(len(x), dtype=bool), [], []
    for i in np.argsort(-w):
        if not free[i]:
            continue
        near = np.argpartition(np.sum((z - z[i]) ** 2, axis=1), NEAR - 1)[:NEAR]
        free[near] = False
        # Half by their weights and half alike, as the reference has it.
        share = 0.5 * (w[near] / np.sum(w[near]) + 1 / NEAR)
        d = x[near] - x[i]
        centres.append(x[i])
        roots.append(np.linalg.cholesky(d.T @ (d * share[:, None]) + FLAT * scatter))
        if len(centres) == NEW:
            break
    return Mixture(np.full(len(centres), -np.log(len(centres))), np.array(centres), np.array(roots), DEGREES)
