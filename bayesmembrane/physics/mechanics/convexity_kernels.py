"""Compiled search for the least eigenvalue of the Hessian of W on a box, one film after the other.

A grid over ln l, then a zoom into those of its dips that could fall below zero between the nodes.
``derivatives`` is the material's (see `compiled.bind`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    derivatives: Any = None

NODES = 32
HALF = 4
SHRINK = 0.5
ROUNDS = 60
RESOLUTION = 1e-8


def k_least(l1: Any, low: Any, high: Any) -> Any:
    """Least I1 - 3 at l1 with l2 in [low, high]; free, it would be at l2 = 1 / sqrt(l1)."""
    l2 = min(max(1.0 / np.sqrt(l1), low), high)
    return l1 * l1 + l2 * l2 + 1.0 / (l1 * l1 * l2 * l2) - 3.0


def part_within(limit: Any, low: Any, high: Any) -> Any:
    """Ends of the smallest interval whose square holds all of [low, high]^2 with I1 - 3 < limit; else (1, 0)."""
    centre = min(max(1.0, low), high)
    if not k_least(centre, low, high) < limit:
        return 1.0, 0.0
    a, b = low, high
    inside, outside = centre, high
    if not k_least(high, low, high) < limit:
        for _ in range(60):
            b = 0.5 * (inside + outside)
            if k_least(b, low, high) < limit:
                inside = b
            else:
                outside = b
    inside, outside = centre, low
    if not k_least(low, low, high) < limit:
        for _ in range(60):
            a = 0.5 * (inside + outside)
            if k_least(a, low, high) < limit:
                inside = a
            else:
                outside = a
    return a, b


def least_at(p: Any, l1: Any, l2: Any) -> Any:
    """Least eigenvalue of the Hessian at one point, as in `convexity.least_eigenvalue`; inf where it does not exist."""
    _, _, _, w11, w12, w22 = derivatives(p, l1, l2)
    m = 0.5 * (w11 + w22)
    h = 0.5 * (w11 - w22)
    r = np.sqrt(h * h + w12 * w12)
    # Both forms are computed, so that the compiler can choose without a branch.
    stable, plain = (w11 * w22 - w12 * w12) / (m + r), m - r
    value = stable if m > 0.0 else plain
    return value if np.abs(value) < np.inf else np.inf


def might_dip(grid: Any, i: Any, j: Any) -> Any:
    """Whether node i >= j is a local minimum between whose neighbours a negative value can hide.

    A parabola through three nodes falls at most a quarter of their largest difference below the lowest of them; the
    whole difference is allowed for here. Beyond the diagonal the grid is its own mirror image.
    """
    n = grid.shape[0]
    rise = 0.0
    for di in range(-1, 2):
        for dj in range(-1, 2):
            k, m = i + di, j + dj
            if 0 <= k < n and 0 <= m < n:
                v = grid[max(k, m), min(k, m)]
                if v < grid[i, j]:
                    return False
                if v < np.inf:
                    rise = max(rise, v - grid[i, j])
    return grid[i, j] - rise < 0.0


def zoomed(p: Any, l1: Any, l2: Any, step: Any, low: Any, high: Any) -> Any:
    """Least eigenvalue near (l1, l2); stops as soon as it is negative.

    Windows follow the best point and shrink where it rests: a dip can be a narrow curved valley, and a window that
    shrank at every step would stop before its lowest point.
    """
    best = np.inf
    for _ in range(ROUNDS):
        c1, c2, far = l1, l2, 0
        for i in range(-HALF, HALF + 1):
            for j in range(-HALF, HALF + 1):
                x = min(max(c1 * (1.0 + i * step / HALF), low), high)
                y = min(max(c2 * (1.0 + j * step / HALF), low), high)
                v = least_at(p, x, y)
                if v < best:
                    best, l1, l2, far = v, x, y, max(abs(i), abs(j))
        if best < 0.0:
            break
        if 2 * far <= HALF:
            step *= SHRINK
        if step < RESOLUTION:
            break
    return best


def margin_of(p: Any, low: Any, high: Any, sign_only: Any, stretch: Any, grid: Any) -> Any:
    """Least eigenvalue (N/m) of one film on [low, high]^2, see `convexity.box_margins`.

    The grid is gone through from the largest stretches, where most energies fail that do.
    """
    n = grid.shape[0]
    ratio = np.exp(np.log(high / low) / (n - 1))
    stretch[0] = low
    for i in range(1, n - 1):
        stretch[i] = ratio * stretch[i - 1]
    stretch[n - 1] = high
    best = np.inf
    for i in range(n - 1, -1, -1):
        for j in range(i + 1):
            grid[i, j] = least_at(p, stretch[i], stretch[j])
        for j in range(i + 1):
            best = min(best, grid[i, j])
        if sign_only and best < 0.0:
            return best
    for i in range(n):
        for j in range(i + 1):
            if best < 0.0:
                return best
            if grid[i, j] < np.inf and might_dip(grid, i, j):
                best = min(best, zoomed(p, stretch[i], stretch[j], 1.2 * (ratio - 1.0), low, high))
    return best if best < np.inf else np.nan


def margins_of(p: Any, limit: Any, low: Any, high: Any, sign_only: Any, margins: Any) -> Any:
    """`margin_of` for every row of p (B, n_fields)."""
    stretch, grid = np.empty(NODES), np.empty((NODES, NODES))
    for k in range(p.shape[0]):
        a, b = low, high
        if limit[k] < np.inf:
            a, b = part_within(limit[k], low, high)
        margins[k] = margin_of(p[k], a, b, sign_only, stretch, grid) if a < b else np.nan


KERNELS = (k_least, part_within, least_at, might_dip, zoomed, margin_of, margins_of)
