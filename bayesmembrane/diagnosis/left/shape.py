"""The shape of a residual: where it is, on which legs and cycles, and whether the load cell was at its limit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.thresholds import WORDS
from bayesmembrane.ground.parameters import Array


@dataclass(frozen=True)
class Plateau:
    """Readings that share one force, which is the largest or the smallest: a load cell at its limit.

    step : N, the smallest difference between two readings: the load cell's resolution, as far as it shows
    """

    readings: int
    force: float
    largest: bool
    step: float


@dataclass(frozen=True)
class ResidualShape:
    """What a residual looks like, in N and m.

    rms, largest : root mean square, and the largest absolute value; ``worst_deflection`` : where that is
    thirds : root mean squares in the lower, middle and upper third of the deflections; 0 where there are no points
    loading, unloading : root mean square on these legs; None where there are none
    gap : mean on loading less mean on unloading legs; 0 where either is missing
    cycles : root mean square by cycle
    trend : correlation with time, or with the number of the reading where there are no times
    timed : True if the measurement has times
    plateau : readings at the limit of the load cell, or None
    """

    rms: float
    largest: float
    worst_deflection: float
    thirds: tuple[float, float, float]
    loading: float | None
    unloading: float | None
    gap: float
    cycles: tuple[tuple[int, float], ...]
    trend: float
    timed: bool
    plateau: Plateau | None


def residual_shape(measurement: Measurement, residual: Array) -> ResidualShape:
    """The shape of a residual (N,) N against deflection, leg, cycle and time."""
    d, r = measurement.deflection, residual
    third = np.clip((3 * (d - d.min()) / max(np.ptp(d), 1e-12)).astype(int), 0, 2)
    # States that are no stations of a path have no legs and no cycles.
    path = measurement.rig.has_path
    leg, cycle = (v if path else np.zeros_like(v) for v in (measurement.leg, measurement.cycle))
    up, down = r[leg > 0], r[leg < 0]
    both = up.size > 0 and down.size > 0
    place = np.arange(r.size) if measurement.time is None else measurement.time
    varies = r.size > 3 and np.std(r) > 0
    return ResidualShape(
        rms=_rms(r),
        largest=float(np.max(np.abs(r))),
        worst_deflection=float(d[int(np.argmax(np.abs(r)))]),
        thirds=(_rms(r[third == 0]), _rms(r[third == 1]), _rms(r[third == 2])),
        loading=_rms(up) if up.size else None,
        unloading=_rms(down) if down.size else None,
        gap=float(np.mean(up) - np.mean(down)) if both else 0.0,
        cycles=tuple((int(c), _rms(r[cycle == c])) for c in np.unique(cycle)),
        trend=float(np.corrcoef(place, r)[0, 1]) if varies else 0.0,
        timed=measurement.time is not None,
        plateau=plateau_of(measurement.force),
    )


def resolution_of(y: Array) -> float:
    """N: the step of which all readings (N,) are multiples, from the first one on; 0 if there is none."""
    gaps = np.diff(np.unique(y))
    gaps = gaps[gaps > 1e-9 * np.ptp(y)]
    if gaps.size < 3:
        return 0.0
    many = gaps / np.min(gaps)
    return float(np.min(gaps)) if np.all(np.abs(many - np.round(many)) < WORDS.same_reading) else 0.0


def plateau_of(y: Array) -> Plateau | None:
    """Many readings (N,) that share the largest or the smallest value."""
    quantum = np.min(np.diff(np.unique(y))) if np.unique(y).size > 1 else 0.0
    for value in (y.max(), y.min()):
        same = int(np.count_nonzero(np.abs(y - value) <= WORDS.same_reading * quantum))
        if same >= max(WORDS.plateau_points, WORDS.plateau_share * y.size) and value != 0:
            return Plateau(same, float(value), bool(value == y.max()), float(quantum))
    return None


def _rms(r: Array) -> float:
    return float(np.sqrt(np.mean(r**2))) if r.size else 0.0
