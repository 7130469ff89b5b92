"""Phases of a test read off its deflections: legs, cycles, first loading, and whether the order makes sense."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.parameters import Array

REVERSAL = 0.005
"""A reversal of the deflection counts as a new leg beyond this part of the whole range; less is jitter."""


HELD, STILL = 12, 0.1
"""Readings of a hold, at least, and the part of the speed before it at which the disc counts as standing still."""
NOMINAL_SPEED = 1e-3
"""m/s: without times the disc counts as moved at this speed, so that a second is a millimetre of travel."""
SLOWEST = 1e-3
"""Of the largest speed of a path: below it the disc counts as moving this fast."""


@dataclass(frozen=True, eq=False)
class Motion:
    """How the disc was moved: what the film remembers.

    Attributes
    ----------
    deflection : (N,) m, in the order of the test
    time : (N,) s, strictly increasing, or None
    full_range : the deflection in m that histories are measured against, the largest of the whole measurement
    across : (N,) stretch across the direction of pull where it was measured (biaxial tests), or None
    """

    deflection: Array
    time: Array | None
    full_range: float
    across: Array | None = None

    @cached_property
    def leg(self) -> NDArray[np.int8]:
        """(N,) +1 while the deflection grows, -1 while it falls."""
        return legs(self.deflection)

    @cached_property
    def cycle(self) -> NDArray[np.int64]:
        """(N,) number of the cycle, from 1."""
        return cycles(self.leg)

    @cached_property
    def steps(self) -> Array:
        """(N,) m: distances travelled to each point from the one before, and from zero to the first."""
        return np.abs(np.diff(self.deflection, prepend=0.0))

    @cached_property
    def clock(self) -> Array:
        """(N,) s since the disc stood at zero; without times, distance travelled at `NOMINAL_SPEED`.

        The way to the first point counts as made at the speed between the first two.
        """
        if self.time is None:
            return np.cumsum(self.steps) / NOMINAL_SPEED
        start = 0.0
        if self.time.size > 1 and self.steps[1] > 0:
            start = self.steps[0] * (self.time[1] - self.time[0]) / self.steps[1]
        return np.asarray(self.time - self.time[0] + min(start, float(self.time[-1] - self.time[0])))

    @cached_property
    def speed(self) -> Array:
        """(N,) m/s: speed of the disc, averaged over neighbours on the same leg.

        `NOMINAL_SPEED` without times, and where the disc never moves.
        """
        if self.time is None or self.time.size < 2:
            return np.full(self.deflection.size, NOMINAL_SPEED)
        speed = np.abs(np.diff(self.deflection)) / np.diff(self.time)
        middle = np.empty(self.deflection.size)
        for leg in np.split(np.arange(middle.size), np.flatnonzero(np.diff(self.leg)) + 1):
            # The steps that end and begin on this leg; a leg of one point has those around it.
            low, high = max(leg[0] - (leg.size < 2), 0), max(leg[-1], leg[0] + 1)
            inner = speed[low:high]
            window = min(9, inner.size)
            smooth = np.convolve(inner, np.ones(window), "same") / np.convolve(
                np.ones(inner.size), np.ones(window), "same"
            )
            middle[leg] = np.interp(leg, np.arange(low, low + inner.size) + 0.5, smooth[: inner.size])
        fastest = float(np.max(middle))
        return np.maximum(middle, SLOWEST * fastest) if fastest > 0 else np.full(middle.size, NOMINAL_SPEED)


def legs(deflection: Array) -> NDArray[np.int8]:
    """(N,) +1 on loading and -1 on unloading legs of the deflections (N,), reversals within `REVERSAL` left aside."""
    tolerance = _jitter(deflection)
    result = np.ones(deflection.size, dtype=np.int8)
    direction, turn = 1, 0
    for i, x in enumerate(deflection):
        result[i] = direction
        if direction * (x - deflection[turn]) >= 0:
            turn = i
        elif abs(x - deflection[turn]) > tolerance:
            direction = -direction
            result[turn + 1 : i + 1] = direction
            turn = i
    if deflection.size > 1:
        result[0] = result[1]
    return result


def cycles(leg: NDArray[np.int8]) -> NDArray[np.int64]:
    """(N,) number of the cycle, from 1; a cycle starts where unloading turns into loading."""
    starts = (leg[1:] > 0) & (leg[:-1] < 0)
    return 1 + np.concatenate([[0], np.cumsum(starts)]).astype(np.int64)


def first_loading(deflection: Array, leg: NDArray[np.int8]) -> NDArray[np.bool_]:
    """(N,) True where the film is loaded to a deflection that it has not seen before."""
    reached = np.maximum.accumulate(deflection)
    return np.asarray((leg > 0) & (deflection >= reached - _jitter(deflection)))


def holds(deflection: Array) -> list[NDArray[np.intp]]:
    """The readings of each time at which the disc stands still: `HELD` and more of them within the jitter, after a way
    at least ten times as fast.
    """
    tolerance, n = _jitter(deflection), deflection.size
    found, i = [], 0
    while i + HELD <= n:
        if abs(deflection[i + HELD - 1] - deflection[i]) > tolerance:
            i += 1
            continue
        away = np.flatnonzero(np.abs(deflection[i:] - deflection[i]) > tolerance)
        end = i + int(away[0]) if away.size else n
        before = abs(deflection[i] - deflection[max(i - HELD, 0)]) / HELD
        during = abs(deflection[end - 1] - deflection[i]) / max(end - i, 1)
        if end - i >= HELD and during < STILL * before:
            found.append(np.arange(i, end))
            i = end
        else:
            i += 1
    return found


def check_time(time: Array, places: list[str]) -> None:
    """Raise `DataError` at the first of the times (N,) that is not above the one before; ``places`` name the rows."""
    late = np.flatnonzero(np.diff(time) <= 0)
    if late.size:
        k = int(late[0]) + 1
        raise DataError(
            f"the time does not increase ({time[k]:g} s after {time[k - 1]:g} s)", places[k], "sort the lines by time"
        )


def check_order(deflection: Array, places: list[str]) -> None:
    """Raise `DataError` where deflections (N,) without times cannot be the order of a test; ``places`` name the rows.

    File order is then time order: the film is loaded first, no deflection is measured twice in a row, and a reversal
    lasts at least two steps. A single step back is a line in the wrong place.
    """
    step = np.diff(deflection)
    same = np.flatnonzero(step == 0)
    if same.size:
        k = int(same[0]) + 1
        raise DataError(
            f"the deflection {1e3 * deflection[k]:g} mm stands there twice", places[k], "remove one line or add time_s"
        )
    remedy = "sort the lines by deflection, or add time_s if the film was really moved like this"
    if step.size and step[0] < 0:
        raise DataError("the deflections fall from the first line on", places[1], remedy)
    starts = np.flatnonzero(np.diff(np.sign(step))) + 1
    lengths = np.diff(np.append(starts, step.size))
    short = np.flatnonzero(lengths < 2)
    if short.size:
        k = int(starts[short[0]]) + 1
        fault = f"the deflections are not in order ({1e3 * deflection[k]:g} mm after {1e3 * deflection[k - 1]:g} mm)"
        raise DataError(fault, places[k], remedy)


def _jitter(deflection: Array) -> float:
    return REVERSAL * float(np.max(deflection) - np.min(deflection))
