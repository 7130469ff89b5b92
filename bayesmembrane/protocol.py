"""Phases of a test read off its deflections: legs, cycles, first loading, and whether the order makes sense."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.errors import DataError
from bayesmembrane.parameters import Array

REVERSAL = 0.005
"""A reversal of the deflection counts as a new leg beyond this part of the whole range; less is jitter."""


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
