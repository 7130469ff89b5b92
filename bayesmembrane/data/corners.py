"""Where the disc turned, stopped or changed its speed between two readings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.data.measurement import Measurement, without_round_off
from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.parameters import Array

STEADY = 0.05
"""Of the larger speed of both sides: by no more may two intervals in a row differ, for their mean to be a speed."""
APART = 0.2
"""Of the same: by so much the speeds of both sides differ, at least, at a corner."""
INSIDE = 0.03
"""Of an interval, or of that beyond the reading if it is shorter: closer to it no corner is told from one at it."""
LONGER, MISSED, AS_LONG = 1.5, 3.0, 1.1
"""Times as long as the longer one beside it: in a longer interval nobody knows what the disc did, as where an export
leaves out a pause; but up to the second number a turn in it has missed a reading or two, where two intervals in which
the disc went on are as long, each beside its own, or nearly (the third number)."""
STOOD = 0.003
"""Of the speed before: by no more was the disc moved in an interval with a turn in which it may have stood still."""
MOST_READ = 10
"""Readings on each side that say how fast the disc was there: times and deflections are rounded."""
ROUNDED, ROUND_OFF, COARSEST = (1.0, 0.1, 0.01), 1e-6, 0.2
"""s, to which times may be rounded, the coarsest first; and the largest part of a speed that may be for that: where it
is larger, intervals are as uneven as they are told."""
BENT = 1.5
"""Times what rounding of the clock makes of a speed over half of those: what changes by more is no line."""
SAME = 0.1
"""Of a step of the deflection: so near to another turn the disc turned where its readings might be of a rest, too."""
EVEN = 0.8
"""Of the steps, at least, that are of one size where readings without times are even in time."""
AGREE, UNTIMED_STOOD = 2, 0.05
"""Turns without times that must do so; and the part of a step up to which the disc may have stood at one of them."""
SMALLEST = 2e-4
"""Of the largest deflection: by so much a corner moves the disc in an interval, at least."""


def with_corners(measurement: Measurement) -> Measurement:
    """The same, whose path has a station more in each interval in which the disc had one steady speed v1 at its
    beginning and another one v2 at its end:

        x_c = x_0 + v1 (t_c - t_0),    t_c = t_0 + (x_1 - x_0 - v2 (t_1 - t_0)) / (v1 - v2).

    A machine at constant speed turns wherever it was told to, and not at a reading: the first reading after a turn has
    been on the way back already. What remembers signs of the motion, largest stretches or times at rest needs to know
    it. Speeds are those that two intervals agree about; one interval is enough on one side where it is as fast as the
    other side. A turn that slows down, as of a sine wave, has no corner, and nobody says where it is in an interval
    in which the disc may have stood still (`_in_doubt`), unless another turn to the same side is where it would have
    turned; nor in a long one, where it would have gone on a little farther than at such a turn. Of times that are
    rounded v1 and v2 are slopes of lines through up to `MOST_READ` readings. Where all moves between rests have one
    speed, it is that of those, too, of which too few readings are told.
    Without times steps of one size may say that readings are even in time (`_even_clock`), if turns agree (`_agree`).
    Where neither does, for stretches across, and where legs are said, the path is as it was.
    """
    path = measurement.path
    time = _even_clock(path.deflection) if path.time is None else path.time
    if time is None or path.across is not None or path.said:
        return measurement
    stood = STOOD if path.time is not None else UNTIMED_STOOD
    rows, at, clock = _corners(path.deflection, time, measurement.full_range, bool(path.rests.any()), stood)
    if not rows.size or (path.time is None and not _agree(path.deflection, rows, at)):
        return measurement
    way = without_round_off(np.insert(path.deflection, rows + 1, at))
    told = None if path.time is None else np.insert(path.time, rows + 1, clock)
    motion = Motion(way, told, measurement.full_range)
    places = measurement.on_path + np.searchsorted(rows, measurement.on_path, side="left")
    return replace(measurement, motion=motion, places=places)


def _even_clock(deflection: Array) -> Array | None:
    """(N,) a clock that counts readings (N,) m, if nearly all steps between them are of one size; else None.

    Readings that are as far apart everywhere but at turns were taken as long apart at one speed, or at deflections that
    somebody chose: which of these it was turns say (`_agree`).
    """
    step = np.abs(np.diff(deflection))
    usual = float(np.median(step)) if step.size else 0.0
    even = np.abs(step - usual) <= STEADY * usual
    return np.arange(float(deflection.size)) if usual > 0 and np.mean(even) >= EVEN else None


def _agree(deflection: Array, rows: NDArray[np.intp], way: Array) -> bool:
    """True if turns at ``way`` (n,) m, in the intervals after ``rows`` (n,), are where others are that were missed by
    another part of an interval, or the test began: `AGREE` of them at least, and none far below its begin.

    An even clock misses each turn by another part; turns that are made up of chosen deflections, or for a rest that
    nobody timed, lie anywhere.
    """
    step = float(np.median(np.abs(np.diff(deflection))))
    missed, near = np.abs(way - deflection[rows]) / step, SAME * step
    back = way < deflection[rows]
    if np.any(way[back] < deflection[0] - near):
        return False
    begin = back & (np.abs(way - deflection[0]) <= near)
    alike = (np.abs(way[:, None] - way) <= near) & (back[:, None] == back) & (np.abs(missed[:, None] - missed) > SAME)
    return bool(np.sum(begin & (np.abs(missed - 0.5) < 0.5 - SAME)) + np.sum(np.any(alike, axis=1)) >= AGREE)


def _corners(
    deflection: Array, time: Array, full_range: float, rests: bool, stood: float
) -> tuple[NDArray[np.intp], Array, Array]:
    """(n,) numbers of the readings before corners, (n,) m, and (n,) s on the clock of the (N,) readings; where the disc
    ``rests`` anywhere, it may have done so in any interval that is longer than those beside it, and where it was moved
    by no more than the part ``stood`` of an interval.
    """
    gap = np.diff(time)
    speed = np.diff(deflection) / gap
    inner = np.arange(1, speed.size - 1)
    larger = np.maximum(np.abs(speed[inner - 1]), np.abs(speed[inner + 1]))
    coarse = _coarseness(time, inner)
    before, after, steady = _speeds(speed, inner, (STEADY + coarse) * larger)
    strictly = _speeds(speed, inner, STEADY * larger)[2]
    by_others = _as_others(deflection, time, inner, before, after, ~steady)
    steady |= by_others
    strictly |= by_others
    turned, beside = np.abs(before - after), np.maximum(gap[inner - 1], gap[inner + 1])
    length = gap[inner] / beside
    apart = (turned >= APART * larger) & (turned * gap[inner] >= SMALLEST * full_range)
    some = np.flatnonzero(steady & apart & ((before * after < 0) | (length <= LONGER)))
    doubt = _in_doubt(speed[inner], before, after, length, rests, stood)[some]
    rows = inner[some]
    with np.errstate(all="ignore"):
        clock = time[rows] + gap[rows] * ((speed[inner] - after) / (before - after))[some]
    way = deflection[rows] + before[some] * (clock - time[rows])
    least, by_rounding = np.maximum(INSIDE, 0.5 * coarse[some]), (coarse * larger)[some]
    for k in np.flatnonzero((by_rounding > 0) & ~by_others[some]):
        crossing = _crossing(deflection, time, int(rows[k]), float(by_rounding[k]))
        if np.isfinite(crossing[0]):
            (clock[k], way[k]), least[k] = crossing, INSIDE
        elif not strictly[some[k]]:
            clock[k], way[k] = np.nan, np.nan
    found = (clock - time[rows] > least * np.minimum(gap[rows], gap[rows - 1])) & (
        time[rows + 1] - clock > least * np.minimum(gap[rows], gap[rows + 1])
    )
    turns = np.sign(before - after)[some]
    near = SAME * np.abs(before * beside)[some]
    found = _met(found, doubt, way, turns, near)
    farther = np.where(length[some] > LONGER, 0.5 * np.abs(before[some] * gap[rows]), 0.0)
    seen = _turns_at_readings(deflection, rows[found])
    found &= ~_refuted(found, way, turns, np.stack([near, farther]), seen)
    # Two in a row are one, which is at the reading between them as far as the clock knows.
    found &= by_others[some] | ~np.any(np.abs(rows[:, None] - rows[found]) == 1, axis=1)
    return rows[found], way[found], clock[found]


def _as_others(
    deflection: Array, time: Array, inner: NDArray[np.intp], before: Array, after: Array, unknown: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """(n,) True where the disc left a rest of two intervals or more, or came to one, at the speed of all other moves of
    the test (`_one_speed`), its own being ``unknown`` (n,). ``before`` and ``after`` (n,) m/s become these there.
    """
    known, moved, as_high = _one_speed(np.diff(deflection), np.diff(time))
    if not known:
        return np.zeros(inner.size, np.bool_)
    along = moved[inner]
    some = unknown & (along != 0) & as_high[inner]
    long = np.pad(moved == 0, 2)  # a turn midway between two readings is a rest in one interval, too
    leaves = some & long[inner + 1] & long[inner] & (moved[inner + 1] == along)
    comes = some & long[inner + 3] & long[inner + 4] & (moved[inner - 1] == along)
    before[leaves], after[leaves] = 0.0, known * along[leaves]
    before[comes], after[comes] = known * along[comes], 0.0
    return np.asarray(leaves | comes)


def _one_speed(step: Array, gap: Array) -> tuple[float, Array, NDArray[np.bool_]]:
    """(m/s, (M,), (M,)): the speed of all moves between rests, 0 if they have none in common; to which side each of the
    intervals moves, 0 at rest; and True in moves as high as one that shows the speed. ``step`` and ``gap``: (M,) m, s.

    Intervals beside a rest may be of both: those between others say the speed, and none is faster. Two are as fast. A
    lower move, as for a preload, may have another speed.
    """
    size = np.abs(step) / gap
    moved = np.where(size <= STOOD * np.max(size), 0.0, np.sign(step))
    within = np.flatnonzero((moved[1:-1] != 0) & (moved[:-2] == moved[1:-1]) & (moved[2:] == moved[1:-1])) + 1
    if not within.size or np.all(moved != 0):
        return 0.0, moved, moved != 0
    known = float(np.median(size[within]))
    one = np.all(np.abs(size[within] - known) <= STEADY * known) and np.max(size) <= (1 + STEADY) * known
    move = np.cumsum(np.diff(moved, prepend=moved[0]) != 0)
    height = np.bincount(move, np.abs(step))[move]
    as_high = height >= (1 - STEADY) * np.min(height[within])
    return known if one and np.sum(size >= (1 - STEADY) * known) >= 2 else 0.0, moved, as_high


def _in_doubt(speed: Array, before: Array, after: Array, length: Array, rests: bool, stood: float) -> NDArray[np.bool_]:
    """(n,) True where the disc turned in an interval in which it may have stood still: its ends are in one place, or it
    is longer than those beside it by the factor ``length`` (n,), which two others in which the disc went on are not, or
    the disc ``rests`` elsewhere. ``speed`` (n,) m/s there, ``before`` and ``after`` it; up to the part ``stood`` of
    these the ends are in one place.
    """
    larger = np.maximum(np.abs(before), np.abs(after))
    went_on = (np.abs(before - after) < APART * larger) & (np.abs(speed - before) < APART * larger)
    others = np.sort(length[went_on])[-2:]
    missed = min(AS_LONG * float(others[0]), MISSED) if others.size == 2 and not rests else 0.0
    longer = (length > LONGER) & (length > missed)
    return np.asarray((before * after < 0) & ((np.abs(speed) <= stood * larger) | longer))


def _met(
    found: NDArray[np.bool_], doubt: NDArray[np.bool_], way: Array, turns: Array, near: Array
) -> NDArray[np.bool_]:
    """(n,) ``found``, but where the disc may have stood still (``doubt``) only those whose place ``way`` (n,) m is as
    ``near`` (n,) m to that of another one which ``turns`` (n,) to the same side, and is found in any case.
    """
    sure, out = found & ~doubt, found.copy()
    for k in np.flatnonzero(found & doubt):
        out[k] = np.any(np.abs(way[sure & (turns == turns[k])] - way[k]) <= near[k])
    return out


def _turns_at_readings(deflection: Array, rows: NDArray[np.intp]) -> tuple[Array, Array]:
    """((t,) m, (t,)): where readings (N,) m turn, and to which side, but for those beside corners after ``rows``."""
    step = np.sign(np.diff(deflection))
    at = 1 + np.flatnonzero(step[:-1] * step[1:] < 0)
    at = at[~np.isin(at, [*rows, *(rows + 1)])]
    return deflection[at], step[at - 1]


def _refuted(
    found: NDArray[np.bool_], way: Array, turns: Array, reach: Array, seen: tuple[Array, Array]
) -> NDArray[np.bool_]:
    """(n,) True for a turn ``found`` in a long interval, where it would be at ``way`` (n,) m and another one to the
    same side, in a short interval or ``seen`` at a reading, is not near, but a little before it: a disc that stood
    there leaves as much. ``reach`` : (2, n) m, how near, and how far before; 0 in a short interval.
    """
    (near, farther), out = reach, np.zeros(found.size, np.bool_)
    short = found & (farther == 0)
    for k in np.flatnonzero(found & (farther > 0)):
        others = np.concatenate([way[short & (turns == turns[k])], seen[0][seen[1] == turns[k]]])
        before = turns[k] * (way[k] - others)
        stood = np.any((before > near[k]) & (before < farther[k]))
        out[k] = stood and not np.any(np.abs(before) <= near[k])
    return out


def _coarseness(time: Array, inner: NDArray[np.intp]) -> Array:
    """(n,) by what part two speeds in intervals beside ``inner`` (n,) may differ for the times being rounded.

    No more than these intervals differ: times on an even clock are no rounded ones.
    """
    each = np.diff(time)
    gap, rest = each[inner], time - time[0]
    beside = each[np.clip(inner[:, None] + np.arange(-2, 3), 0, each.size - 1)]
    uneven = np.max(beside, axis=1) - np.min(beside, axis=1)
    for step in ROUNDED:
        if np.all(np.abs(rest / step - np.round(rest / step)) < ROUND_OFF):
            shortest = np.minimum(gap, np.min(beside, axis=1))
            part = np.where(uneven > 0.5 * step, np.minimum(2 * step, uneven), 0.0) / shortest
            return np.where(part <= COARSEST, part, 0.0)
    return np.zeros(gap.size)


def _crossing(deflection: Array, time: Array, row: int, most: float) -> tuple[float, float]:
    """(s, m) where lines through the readings up to ``row`` and from the next one on cross, as far as intervals are as
    fast as those beside them, by no more than ``most`` m/s.
    """
    lines = []
    for first, side in ((row, -1), (row + 1, 1)):
        end = first + 2 * side
        speed = (deflection[first + side] - deflection[first]) / (time[first + side] - time[first])
        while 0 <= end < time.size and abs(end - first) < MOST_READ:
            now = (deflection[end] - deflection[end - side]) / (time[end] - time[end - side])
            if abs(now - speed) > most:
                break
            end += side
        part = np.arange(first, end, side)
        if _bent(time[part], deflection[part], most):
            return np.nan, np.nan
        lines.append(np.polyfit(time[part] - time[row], deflection[part], 1))
    (v1, x1), (v2, x2) = lines
    if v1 == v2:
        return np.nan, np.nan
    since = float((x2 - x1) / (v1 - v2))
    return time[row] + since, float(x1 + v1 * since)


def _bent(time: Array, deflection: Array, most: float) -> bool:
    """True where the speed changes from one half of (n,) readings to the other by more than times rounded so that two
    intervals differ by ``most`` m/s can make it, or where there are too few for that to be seen.
    """
    half = time.size // 2
    if half < 2 or not np.any(deflection != deflection[0]):
        return half < 2
    near, far = (np.polyfit(time[s], deflection[s], 1)[0] for s in (slice(half + 1), slice(half, None)))
    return bool(abs(near - far) > BENT * most / half)


def _speeds(speed: Array, inner: NDArray[np.intp], most: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """((n,) m/s before, (n,) after, (n,)): True where the speeds beside ``inner`` (n,) are known, which differ
    by no more than ``most`` (n,) from one interval to the next.
    """
    (before, steady_before), (after, steady_after) = (_steady(speed, inner, side, most) for side in (-1, 1))
    as_fast = np.abs(np.abs(before) - np.abs(after)) <= most
    return before, after, (steady_before & steady_after) | ((steady_before | steady_after) & as_fast)


def _steady(speed: Array, inner: NDArray[np.intp], side: int, most: Array) -> tuple[Array, NDArray[np.bool_]]:
    """((n,) m/s, (n,)): mean of the two intervals on one ``side`` of each, and True, where these differ by no more than
    ``most`` (n,); else that of the next one.
    """
    near = speed[inner + side]
    far = speed[np.clip(inner + 2 * side, 0, speed.size - 1)]
    there = (inner + 2 * side >= 0) & (inner + 2 * side < speed.size)
    agree = there & (np.abs(near - far) <= most)
    return np.where(agree, 0.5 * (near + far), near), agree
