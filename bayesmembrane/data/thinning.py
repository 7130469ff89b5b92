"""Fewer readings of a long measurement, for what takes all of them at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.motion import HELD, Motion

EVENLY = "evenly along the test, with turning points and ends of holds"
MOST = 1500
"""Readings that a diagnosis, valleys and a comparison take, at most: their time and memory grow with them."""

READ = 20_000
"""Readings of a file that are used, at most: more say little more, and a walk asks for all of them 100 000 times."""


def thinned(measurement: Measurement, most: int = MOST) -> Measurement:
    """At most ``most`` readings, evenly along the test, with both ends, its turning points and the ends of its holds.

    They are readings, not means of neighbours. A mean differs from what the model predicts at its middle wherever the
    force bends (at turning points, and where a hold begins) by more than its own noise, which looks like a fault; and
    means of unequal numbers differ in noise, which is one number where it is inferred. The price: parameters are less
    certain by the root of whole over part, as far as neighbours are independent. The noise of each reading, stated or
    not, stays what it is, and the film still remembers how it was moved past all readings.
    """
    n = len(measurement)
    if n <= most:
        return measurement
    if measurement.across is not None:  # states, and no path
        return measurement.select(_with_even(np.array([0, n - 1]), n, most))
    return measurement.select(kept_rows(measurement.leg, measurement.holds, most))


def shortened(measurement: Measurement, most: int) -> Measurement:
    """`thinned`, and the film remembers no more than the readings that are left: for a first search."""
    few = thinned(measurement, most)
    if few is measurement:
        return measurement
    leg, cycle = (few.leg, few.cycle) if few.path.said else (None, None)
    said = (None if v is None else v.astype(float) for v in (leg, cycle))
    path = Motion(few.deflection, few.time, few.full_range, few.across, *said)
    return replace(few, motion=path, places=np.arange(len(few)))


def of_few(measurement: Measurement, most: int) -> Measurement:
    """`shortened`, with a note in its provenance where that is not all of it."""
    few = shortened(measurement, most)
    if few is measurement:
        return measurement
    note = f"{len(few)} of {len(measurement)} readings are used, {EVENLY}"
    return replace(few, provenance=replace(few.provenance, notes=(*few.provenance.notes, note)))


def kept_rows(leg: NDArray[np.int8], holds: Sequence[NDArray[np.intp]], most: int) -> NDArray[np.intp]:
    """At most ``most`` rows of N, evenly along the test: with both ends, the last reading of each ``leg`` (N,), and of
    each hold both ends and enough readings to tell it.
    """
    turns = np.flatnonzero(np.diff(leg.astype(int)))
    stills = [hold[_even(hold.size, 2 * HELD)] for hold in holds]
    return _with_even(np.unique(np.concatenate([[0, leg.size - 1], turns, *stills]).astype(np.intp)), leg.size, most)


def _with_even(must: NDArray[np.intp], n: int, most: int) -> NDArray[np.intp]:
    """Rows that must be kept, and others evenly between them."""
    if must.size > most // 2:
        must = must[_even(must.size, most // 2)]
    return np.union1d(must, _even(n, most - must.size))


def _even(n: int, count: int) -> NDArray[np.intp]:
    """``count`` indices evenly from 0 to n - 1, or all n."""
    return np.unique(np.linspace(0, n - 1, min(n, max(count, 2))).round().astype(np.intp))
