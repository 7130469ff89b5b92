"""Single readings that no reference could follow, as where the grips turn: set aside, and counted.

A reading is set aside if beside the smooth reference it lies `OUTLIERS.reach` robust standard deviations away, and off
the readings before it and off those after it to the same side. A step, a ripple or a limit moves many readings, and
each of them has neighbours like it: then nothing is set aside. P. J. Huber, E. M. Ronchetti, Robust Statistics, 2nd ed.
(2009), 7.2, for residuals over sqrt(1 - leverage).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.reference.noise import orthonormal
from bayesmembrane.diagnosis.reference.smooth import smooth_reference
from bayesmembrane.diagnosis.thresholds import OUTLIERS
from bayesmembrane.ground.parameters import Array

SD_OF_MEDIAN = 1.4826
"""Standard deviation of normal values over the median of their sizes."""


@dataclass(frozen=True)
class SetAside:
    """Readings that were left out of a diagnosis.

    numbers : of the readings, from 1, of ``measured`` ones
    farthest : of them, in robust standard deviations of the others off a line between their neighbours
    """

    numbers: tuple[int, ...]
    measured: int
    farthest: float


class _Spared(NamedTuple):
    """Readings y (N,) over their stated standard deviations, if there are any, beside a smooth reference.

    q : (N, r) its orthonormal columns; spare : (N,) what they leave of each reading; seen : (N,) where that is enough
    raw, root : (N,) residuals, 0 where they are not seen, and what to divide them by; stated : the least deviation
    """

    y: Array
    q: Array
    spare: Array
    seen: NDArray[np.bool_]
    raw: Array
    root: Array
    stated: float


def without_outliers(measurement: Measurement) -> tuple[Measurement, SetAside | None]:
    """The readings that are kept, and what was set aside; all of them, and None, if there is nothing or too much.

    What is kept has no outliers: doing it again changes nothing. States without an order, and readings of a stated
    covariance, are kept as they are. The film still remembers how it was moved past the others.
    """
    n = len(measurement)
    most = int(OUTLIERS.share * n)
    if most < 1 or measurement.across is not None or measurement.covariance is not None:
        return measurement, None
    keep, part = np.arange(n), measurement
    while True:
        off = _off(part)
        worst = int(np.argmax(off))
        if off[worst] < OUTLIERS.reach:
            break
        if n - keep.size == most:
            return measurement, None
        keep = np.delete(keep, worst)
        part = measurement.select(keep)
    if keep.size == n:
        return measurement, None
    numbers = tuple(int(i) + 1 for i in np.setdiff1d(np.arange(n), keep))
    return part, SetAside(numbers, n, _farthest(measurement, keep, part))


def _off(m: Measurement) -> Array:
    """(N,) robust standard deviations by which readings lie off the reference, 0 unless they do so alone.

    Where the reference follows them anyway, one just after a turn may be the start of a relaxation; not one that goes
    against the way and comes back at once.
    """
    y, q, spare, seen, raw, root, stated = _beside(m)
    off = np.maximum(_alone(raw / root), _against(y, m.deflection, ~seen) / np.sqrt(2.0)) / _scale(raw / root, stated)
    for end, inwards in ((0, 1), (len(m) - 1, -1)):
        if seen[end]:
            without = np.where(seen, raw + q @ q[end] * raw[end] / spare[end], 0.0)  # of a reference without it
            others = np.delete(without / root, end)
            off[end] = _at_end(without, end, inwards) * root[end] / _scale(others, stated)[min(end, others.size - 1)]
    return np.asarray(off)


def _beside(m: Measurement) -> _Spared:
    profile = _profile(m)
    q = orthonormal(smooth_reference(m) / profile[:, None])
    y = m.force / profile
    spare = 1.0 - np.sum(q**2, axis=1)
    seen = spare > OUTLIERS.least_spare
    raw = np.where(seen, y - q @ (q.T @ y), 0.0)
    return _Spared(y, q, spare, seen, raw, np.sqrt(np.where(seen, spare, 1.0)), 0.0 if m.force_sd is None else 1.0)


def _profile(m: Measurement) -> Array:
    """(N,) the stated standard deviations, or ones."""
    return np.ones(len(m)) if m.force_sd is None else m.force_sd


def _farthest(measurement: Measurement, keep: NDArray[np.intp], part: Measurement) -> float:
    """Of readings that are not kept, `SetAside.farthest`; ``part`` has those that are."""
    gone = np.setdiff1d(np.arange(len(measurement)), keep)
    kept = _beside(part)
    away = np.abs(measurement.force[gone] - np.interp(gone, keep, part.force)) / _profile(measurement)[gone]
    return float(np.max(away / np.interp(gone, keep, _scale(kept.raw / kept.root, kept.stated))))


def _at_end(rest: Array, end: int, inwards: int) -> float:
    """How far the reading at one end lies off a reference that does not know it, of which ``rest`` (N,) are the
    residuals; 0 if the next one goes with it, as where a test ends with a tear.
    """
    k = OUTLIERS.neighbours
    if rest.size < 2 * k + 1:
        return 0.0
    near = rest[end + inwards * np.arange(1, k + 1)]
    return float(abs(rest[end])) if np.max(np.abs(near)) < 0.25 * abs(rest[end]) else 0.0


def _against(y: Array, d: Array, followed: NDArray[np.bool_]) -> Array:
    """(N,) how far readings y (N,) lie below the one before and the one after, the less of the two, where the disc went
    up to d (N,) last, and above both where it went down; else 0. No film, and nothing that relaxes, does that.

    Only of those that the reference follows, for waves do it, too; where the disc stands from there on, of all, and the
    one after counts alone: what relaxes there goes the other way.
    """
    out = np.zeros(y.size)
    moved = np.diff(d, prepend=d[0])
    last = np.maximum.accumulate(np.where(moved != 0, np.arange(d.size), 0))
    way = np.sign(moved[last])[1:-1]
    before, after = way * (y[:-2] - y[1:-1]), way * (y[2:] - y[1:-1])
    stands = (moved[1:-1] != 0) & (moved[2:] == 0)
    out[1:-1] = np.maximum(np.where(stands, after, np.where(followed[1:-1], np.minimum(before, after), 0.0)), 0.0)
    return out


def _scale(rest: Array, stated: float) -> Array:
    """(N,) robust standard deviation near each of ``rest`` (N,), no less than that of all, nor than what is stated."""
    half = min(OUTLIERS.window // 2, (rest.size - 1) // 2)
    wide = np.pad(np.abs(rest), half, mode="reflect")
    near = np.median(np.lib.stride_tricks.sliding_window_view(wide, 2 * half + 1), axis=1)
    floor = max(float(np.median(np.abs(rest))), 1e-12 * float(np.max(np.abs(rest))), 1e-300)
    return np.asarray(np.maximum(SD_OF_MEDIAN * np.maximum(near, floor), stated))


def _alone(rest: Array) -> Array:
    """(N,) how far values ``rest`` (N,) lie off zero, off those before and off those after, the least of the three; 0
    where these are to different sides, and near either end.
    """
    k, n = OUTLIERS.neighbours, rest.size
    out = np.zeros(n)
    if n < 2 * k + 1:
        return out
    runs = np.median(np.lib.stride_tricks.sliding_window_view(rest, k), axis=1)
    here: NDArray[np.intp] = np.arange(k, n - k)
    before, after = rest[here] - runs[here - k], rest[here] - runs[here + 1]
    same = (np.sign(before) == np.sign(after)) & (np.sign(before) == np.sign(rest[here]))
    off = np.minimum(np.abs(rest[here]), np.minimum(np.abs(before), np.abs(after)))
    out[here] = np.where(same, off, 0.0)
    return out
