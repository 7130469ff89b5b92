"""A reference that no physics could beat: smooth curves in deflection and on every leg, whatever they mean."""

from __future__ import annotations

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.thresholds import REFERENCE, TINY
from bayesmembrane.ground.parameters import Array


def smooth_reference(measurement: Measurement) -> Array:
    """(N, p): B-splines in the deflection; on each leg Legendre polynomials and a quick relaxation at its start; on
    each hold a constant and relaxations.

    Splines have no more columns than a third of the points, all together two thirds at most; splines come first, then
    what tells legs apart.
    """
    d = measurement.deflection
    room, still = _room(measurement), measurement.holds
    columns = [splines(d, spline_count(measurement), _moving(measurement))]
    starts = np.flatnonzero(np.diff(measurement.leg.astype(int))) + 1
    legs = np.split(np.arange(d.size), starts)
    if len(legs) > 1:
        enough = columns[0].shape[1] + REFERENCE.leg_columns * len(legs) <= 2 * room
        columns += [_on_leg(d, leg, REFERENCE.leg_columns if enough else 1) for leg in legs]
    columns += [_on_hold(measurement.path.clock[measurement.on_path], hold) for hold in still]
    return np.concatenate(columns, axis=1)


def spline_count(measurement: Measurement) -> int:
    """Degrees of freedom in the deflection: no wave with more than half as many over the range is followed."""
    return min(REFERENCE.spline_columns, _room(measurement), max(np.unique(_moving(measurement)).size // 2, 1))


def _room(measurement: Measurement) -> int:
    return max(len(measurement) // REFERENCE.points_per_column, 1)


def _moving(measurement: Measurement) -> Array:
    """Deflections (M,) m of the readings outside of holds."""
    return measurement.deflection[measurement.moving]


def splines(d: Array, count: int, at: Array | None = None) -> Array:
    """Cubic B-splines of ``count`` degrees of freedom at deflections d (N,), with knots at quantiles of ``at`` or d."""
    if count < 4:
        return np.vander((d - d.mean()) / max(np.ptp(d), 1e-12), count)
    inner = np.quantile(np.unique(d if at is None else at), np.linspace(0, 1, count - 2)[1:-1])
    low, high = float(d.min()), float(d.max())
    knots = np.concatenate([[low] * 4, inner, [high] * 4])
    return np.asarray(BSpline.design_matrix(np.clip(d, low, high), knots, 3).toarray())


def curve_in_deflection(d: Array) -> Array:
    """(N, p) splines that follow any smooth function of deflections d (N,) alone."""
    return splines(d, min(REFERENCE.spline_columns, max(np.unique(d).size // REFERENCE.points_per_column, 4)))


def _on_leg(d: Array, leg: NDArray[np.intp], count: int) -> Array:
    out = np.zeros((d.size, count))
    if count == 1 or leg.size < REFERENCE.short_leg:
        out[leg, 0] = 1.0
        return out
    s = np.linspace(0.0, 1.0, leg.size)
    way = np.abs(d[leg] - d[leg[0]])
    if way[-1] > 0:
        s = way / way.max()
    out[leg, :-1] = legvander(2 * s - 1, count - 2)
    out[leg, -1] = np.exp(-s / REFERENCE.reversal)
    return out


def _on_hold(time: Array, hold: NDArray[np.intp]) -> Array:
    parts = REFERENCE.relaxations
    s = (time[hold] - time[hold[0]]) / max(float(np.ptp(time[hold])), TINY)
    out = np.zeros((time.size, 1 + len(parts)))
    out[hold] = np.column_stack([np.ones(hold.size), *(np.exp(-s / part) for part in parts)])
    return out
