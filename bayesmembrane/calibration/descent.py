"""Least squares from many starts at once: the solver's price is per batch, so a start more is nearly free."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.ground.parameters import Array

Residuals = Callable[[Array], tuple[Array, Array]]
"""x (B, k) -> r (B, N) and dr/dx (B, N, k); nan where there is nothing to compare, or no slope."""

DAMPING, EASIER, HARDER, HOPELESS = 1e-2, 0.1, 4.0, 1e12
SLOW = 1e-9  # relative decrease of |r|^2 below which a step counts as slow
PATIENCE = 3  # slow steps in a row that end a search
CRAWL, CRAWLS = 1e-3, 4  # the same of a search that is far behind the best one


@dataclass(frozen=True)
class Patience:
    """When a search is given up, or done.

    behind : times the least sum of squares from which on a search that crawls is not waited for
    slow_below : relative decrease of |r|^2 below which a step counts as slow
    enough : |r| below which nothing lower is asked for
    """

    behind: float = np.inf
    slow_below: float = SLOW
    enough: float = 0.0


def descend(
    residuals: Residuals,
    start: Array,
    bounds: tuple[Array, Array],
    iterations: int,
    held: NDArray[np.bool_] | None = None,
    patience: Patience | None = None,
) -> tuple[Array, Array]:
    """min |r(x)|^2 with x between ``bounds`` (k,) from each row of start (M, k), by Marquardt's damped steps

        (J^T J + m diag(J^T J)) s = -J^T r,

    with coordinates at a bound left out while the step would leave it, and those in ``held`` (M, k) left out always.
    A row whose |r|^2 is more than ``patience.behind`` times the least is given up when it crawls: films at the edge of
    what can be solved cost most. One whose |r|^2 falls by less than its part ``patience.slow_below`` a few times in a
    row, or promises no more, is done, and so is one whose |r| is below ``patience.enough``. Returns x (M, k) and |r|
    (M,), inf where a start has no residuals or no slopes: neither a start nor a step goes where one of them is not a
    number.

    D. W. Marquardt, J. SIAM 11 (1963) 431, with the damping of H. B. Nielsen (IMM-REP-1999-05, Technical University of
    Denmark): it falls as far as the gain is what was promised, and rises faster with every step that gains nothing. A
    row that finds no better point with any damping is done.
    """
    patience = patience or Patience()
    low, high = bounds
    x = np.clip(start, low, high)
    free = np.ones(x.shape, bool) if held is None else ~held
    r, jacobian = residuals(x)
    size = _square(r, jacobian)
    damping, harder = np.full(len(x), DAMPING), np.full(len(x), HARDER)
    slow, crawl = np.zeros(len(x), int), np.zeros(len(x), int)
    going = np.isfinite(size) & ~(np.sqrt(size) < patience.enough)
    for _ in range(iterations):
        rows = np.flatnonzero(going)
        if not rows.size:
            break
        step = _step(x[rows], r[rows], jacobian[rows], damping[rows], free[rows], bounds)
        trial = np.clip(x[rows] + step, low, high)
        new_r, new_jacobian = residuals(trial)
        new_size = _square(new_r, new_jacobian)
        better = new_size < size[rows]
        take = rows[better]
        won = size[rows] - new_size
        promise = size[rows] - _square(r[rows] + np.einsum("mnk,mk->mn", jacobian[rows], trial - x[rows]))
        little = np.where(better, won, promise) < patience.slow_below * size[rows]
        slow[rows] = np.where(little, slow[rows] + 1, 0)
        crawl[rows] = np.where(better & (won > CRAWL * size[rows]), 0, crawl[rows] + 1)
        # A step that promised next to nothing may have won far more: the cube overflows, and is clipped.
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            eased = np.clip(1 - (2 * won / promise - 1) ** 3, EASIER, HARDER)
        damping[rows] *= np.where(better, np.where(promise > 0, eased, 1.0), harder[rows])
        damping = np.maximum(damping, 1e-12)
        harder[rows] = np.where(better, HARDER, 2 * harder[rows])
        x[take], r[take], jacobian[take], size[take] = (
            trial[better],
            new_r[better],
            new_jacobian[better],
            new_size[better],
        )
        lost = (crawl[rows] >= CRAWLS) & (size[rows] / patience.behind > np.min(size))
        done = np.sqrt(size[rows]) < patience.enough
        going[rows] = (damping[rows] < HOPELESS) & (slow[rows] < PATIENCE) & ~lost & ~done
    return x, np.sqrt(size)


def _square(r: Array, jacobian: Array | None = None) -> Array:
    """|r|^2 (M,) of r (M, N) with slopes (M, N, k); inf where one of them is not a number, or too large to square."""
    with np.errstate(over="ignore", invalid="ignore"):
        size = np.sum(r * r, axis=1)
        known = np.isfinite(size)
        if jacobian is not None:
            known &= np.isfinite(np.sum(jacobian * jacobian, axis=(1, 2)))
    return np.where(known, size, np.inf)


def _step(
    x: Array, r: Array, jacobian: Array, damping: Array, free: NDArray[np.bool_], bounds: tuple[Array, Array]
) -> Array:
    low, high = bounds
    gradient = np.einsum("mnk,mn->mk", jacobian, r)
    moves = free & ~((x <= low) & (gradient > 0)) & ~((x >= high) & (gradient < 0))
    j = np.where(moves[:, None, :], jacobian, 0.0)
    normal = np.einsum("mnk,mnl->mkl", j, j)
    diagonal = np.einsum("mkk->mk", normal)
    diagonal = np.maximum(diagonal, 1e-12 * np.max(diagonal, axis=1, keepdims=True) + 1e-300)
    k = x.shape[1]
    # In the metric of the diagonal the matrix has ones on it, so that its conditioning is that of the problem.
    root = np.sqrt(diagonal)
    scaled = normal / root[:, :, None] / root[:, None, :]
    scaled[:, np.arange(k), np.arange(k)] += damping[:, None] + ~moves
    right = np.where(moves, -gradient / root, 0.0)
    return np.asarray(np.linalg.solve(scaled, right[:, :, None])[:, :, 0] / root)
