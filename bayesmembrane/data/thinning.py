"""Fewer readings of a long measurement, for what takes all of them at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.motion import HELD

MOST = 1500
"""Readings that a diagnosis takes, at most: its time and memory grow with them."""


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
    must = _kept(measurement)
    if must.size > most // 2:
        must = must[_even(must.size, most // 2)]
    return measurement.select(np.union1d(must, _even(n, most - must.size)))


def _kept(measurement: Measurement) -> NDArray[np.intp]:
    """Both ends, the last reading of each leg, and of each hold both ends and enough readings to tell it."""
    last = len(measurement) - 1
    if measurement.across is not None:  # states, and no path
        return np.array([0, last])
    turns = np.flatnonzero(np.diff(measurement.leg.astype(int)))
    stills = [hold[_even(hold.size, 2 * HELD)] for hold in measurement.holds]
    return np.unique(np.concatenate([[0, last], turns, *stills]).astype(np.intp))


def _even(n: int, count: int) -> NDArray[np.intp]:
    """``count`` indices evenly from 0 to n - 1, or all n."""
    return np.unique(np.linspace(0, n - 1, min(n, max(count, 2))).round().astype(np.intp))
