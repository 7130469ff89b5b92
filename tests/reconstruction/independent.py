"""A second way to the curve behind the losses: one spline in ln(F + F_h), as straight as the losses allow.

Nothing is shared with the package but its forward model: no Gaussian process, no evidence. The unknowns are the
coefficients of a cubic B-spline and the first positions; its third differences are made as small as they can be while
half of the losses are met to a given error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, PchipInterpolator
from scipy.optimize import least_squares

from bayesmembrane.data.published import PublishedTable
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.mechanics.api import force_curve

HALF = 0.1  # N: below, the spline is one in the force, above, in its logarithm
PIECES = 18
ZERO = 0.01  # N: how near to zero the force starts, and how far below zero it may be: a film does not push
NEAR_ZERO = np.linspace(0.0, 5e-3, 11)
ERRORS = (0.7e-3, 7e-3)  # N: half of the losses of each range are to be met to this
MET = 0.7  # of these errors
STIFF = np.geomspace(3.0, 3e-3, 13)  # weights of the third differences, the stiffest first


@dataclass(frozen=True)
class Straightest:
    """Spline, first positions (2,) in m, and median misses (2,) of the losses, in `ERRORS`."""

    spline: BSpline
    first: Array
    misses: Array

    def force(self, x: Array) -> Array:
        """Forces in N at x in m."""
        return np.asarray(np.exp(self.spline(x)) - HALF)


def straightest(table: PublishedTable, counts: tuple[int, int], left_out: int, start: Array) -> Straightest:
    """The curve (deflections in m and forces in N of ``start`` (2, N) are where the search begins)."""
    grid = np.linspace(1e-4, max(table.ends), 240)
    rows = [k for k in range(len(table.rows)) if k != left_out]
    simulated = [
        PchipInterpolator(
            grid,
            force_curve(table.rows[k].material, table.rows[k].values, grid, table.inner_radius, table.outer_radius)[0],
        )
        for k in rows
    ]
    inner = np.linspace(0.0, max(table.ends), PIECES)
    knots = np.concatenate([[0.0] * 3, inner, [inner[-1]] * 3])
    c = np.linalg.lstsq(BSpline.design_matrix(start[0], knots, 3).toarray(), np.log(start[1] + HALF), rcond=None)[0]
    unknown = np.concatenate([c, [0.3, 0.1]])

    def misses(unknown: Array) -> list[Array]:
        found = []
        for r, (n, end) in enumerate(zip(counts, table.ends, strict=True)):
            x = np.linspace(abs(unknown[-2 + r]) * 3e-3, end, n)
            y = np.exp(BSpline(knots, unknown[:-2], 3)(x)) - HALF
            losses = np.array([np.linalg.norm(y - s(np.maximum(x, grid[0]))) for s in simulated])
            found.append((losses - table.losses[r][rows]) / ERRORS[r])
        return found

    def residual(unknown: Array, stiff: float) -> Array:
        robust = [np.sign(m) * np.sqrt(2 * (np.sqrt(1 + m**2) - 1)) for m in misses(unknown)]
        start = np.exp(BSpline(knots, unknown[:-2], 3)(NEAR_ZERO)) - HALF
        pulls = np.concatenate([start[:1], np.minimum(start[1:], 0.0)]) / ZERO
        return np.concatenate([*robust, stiff * PIECES**2 * np.diff(unknown[:-2], 3), 1e-2 * unknown[-2:], pulls])

    for stiff in STIFF:
        unknown = least_squares(residual, unknown, args=(stiff,), max_nfev=200).x
        half = np.array([np.median(np.abs(m)) for m in misses(unknown)])
        if np.all(half < MET):
            break
    return Straightest(BSpline(knots, unknown[:-2], 3), np.abs(unknown[-2:]) * 3e-3, half)
