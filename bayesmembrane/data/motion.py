"""Phases of a test read off its deflections: legs, cycles, first loading, and whether the order makes sense."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.parameters import Array

REVERSAL = 0.005
"""A reversal of the deflection counts as a new leg beyond this part of the whole range; less is jitter."""
LONG, SWINGS, MOST_JITTER = 200, 12.0, 0.05
"""From so many readings on the noise of the deflections is asked for: legs turn where they leave an extreme by so many
standard deviations (two extremes of 200 000 readings lie nine apart), but by no more than this part of the range."""
HELD, STILL = 12, 0.1
"""Readings of a hold, at least, and the part of the speed before it at which the disc counts as standing still."""
SHORT_REST = 4
"""Steps of a rest that is no hold, at least, and of the motion between two of them."""
NO_STEP, SCATTER = 1e-3, 6.0
"""Of the mean step between two readings: what is less is none; of the median distance of the readings of a hold from
their median: what is farther is on its way."""
MOST_HELD = 4000
"""In a longer record holds are looked for in means of neighbours, half as many as this."""
CONTRADICTED = 0.1
"""Of all readings: where legs turn, as many may be counted to the other one."""
NOMINAL_SPEED = 1e-3
"""m/s: without times the disc counts as moved at this speed, so that a second is a millimetre of travel."""
OVER = 0.98
"""Of the largest deflection of a first leg: a loading is all but over there, and what follows may be a hold."""
WINDOW = 9  # steps over which a speed is averaged
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
    said_leg, said_cycle : (N,) `leg` and `cycle` as whoever measured says them, or None: then they are read off
    """

    deflection: Array
    time: Array | None
    full_range: float
    across: Array | None = None
    said_leg: Array | None = None
    said_cycle: Array | None = None

    @cached_property
    def leg(self) -> NDArray[np.int8]:
        """(N,) +1 while the deflection grows, -1 while it falls."""
        return legs(self.deflection) if self.said_leg is None else self.said_leg.astype(np.int8)

    @cached_property
    def cycle(self) -> NDArray[np.int64]:
        """(N,) number of the cycle, from 1."""
        return cycles(self.leg) if self.said_cycle is None else self.said_cycle.astype(np.int64)

    @property
    def said(self) -> bool:
        """Whether legs or cycles were said."""
        return self.said_leg is not None or self.said_cycle is not None

    def up_to(self, end: int) -> Motion:
        """The first ``end`` stations."""
        parts = (self.deflection, self.time, self.across, self.said_leg, self.said_cycle)
        deflection, time, across, leg, cycle = (None if v is None else v[:end] for v in parts)
        assert deflection is not None
        return Motion(deflection, time, self.full_range, across, leg, cycle)

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
    def jitter(self) -> float:
        """m: less is no movement."""
        return jitter(self.deflection)

    @cached_property
    def first_turn(self) -> float:
        """s on the `clock`: when the first leg ends, or the last reading is taken."""
        turns = np.flatnonzero(np.diff(self.leg))
        return float(self.clock[turns[0] if turns.size else -1])

    @cached_property
    def pace(self) -> float:
        """m/s: mean speed of the first loading, until it is all but over; `NOMINAL_SPEED` without times."""
        turns = np.flatnonzero(np.diff(self.leg))
        first = self.deflection[: int(turns[0]) + 1 if turns.size else None]
        there = int(np.argmax(first >= OVER * np.max(first)))
        took, went = float(self.clock[there]), float(first[there])
        return went / took if self.time is not None and took > 0 and went > 0 else NOMINAL_SPEED

    @cached_property
    def speed(self) -> Array:
        """(N,) m/s: speed of the disc, averaged over neighbours on the same leg.

        `NOMINAL_SPEED` without times, and where the disc never moves.
        """
        if self.time is None or self.time.size < 2:
            return np.full(self.deflection.size, NOMINAL_SPEED)
        speed = np.abs(np.diff(self.deflection)) / np.diff(self.time)
        middle = np.empty(self.deflection.size)
        for leg in self._each_leg:
            # The steps that end and begin on this leg; a leg of one point has those around it.
            low, high = max(leg[0] - (leg.size < 2), 0), max(leg[-1], leg[0] + 1)
            smooth = _moving_mean(speed[low:high])
            middle[leg] = np.interp(leg, np.arange(low, low + smooth.size) + 0.5, smooth)
        fastest = float(np.max(middle))
        return np.maximum(middle, SLOWEST * fastest) if fastest > 0 else np.full(middle.size, NOMINAL_SPEED)

    @cached_property
    def rests(self) -> NDArray[np.bool_]:
        """(N,) True where the disc stands still.

        That is in `holds`, but for what is still or again on its way at their ends, and in shorter ones than these
        where all readings of the motion differ. It has just moved where it stops.
        """
        out = _short_rests(self.deflection)
        for still in holds(self.deflection):
            away = np.abs(self.deflection[still] - np.median(self.deflection[still]))
            there = np.flatnonzero(away <= SCATTER * np.median(away) + NO_STEP * np.mean(self.steps))
            out[still[there[0] + 1 : there[-1] + 1]] = True  # what flickers between its ends is at rest, too
        return out

    @cached_property
    def moving_speed(self) -> Array:
        """(N,) m/s: as `speed`, but zero where the disc `rests`, and not averaged across a rest.

        It is the mean over the steps that end at the readings around one: where a disc stops it has just moved.
        """
        if self.time is None or not np.any(self.rests):
            return self.speed
        speed, out = np.abs(np.diff(self.deflection)) / np.diff(self.time), np.zeros(self.deflection.size)
        for leg in self._each_leg:
            moving = leg[~self.rests[leg]]
            for part in np.split(moving, np.flatnonzero(np.diff(moving) > 1) + 1):
                # The steps that end at these readings; the first reading of all has the one that begins there.
                ends = np.maximum(part - 1, 0)
                out[part] = _moving_mean(speed[ends]) if part.size else 0.0
        return out

    @property
    def _each_leg(self) -> list[NDArray[np.intp]]:
        """The points of every leg, in order."""
        return np.split(np.arange(self.leg.size), np.flatnonzero(np.diff(self.leg)) + 1)

    @cached_property
    def leg_speed(self) -> Array:
        """(N,) m/s: median speed on the leg that a point is on, rest left out; `NOMINAL_SPEED` without times."""
        out = np.empty(self.speed.size)
        for leg in self._each_leg:
            speed = self.speed[leg]
            out[leg] = np.median(speed[speed >= STILL * np.max(speed)])
        return out


def _moving_mean(values: Array) -> Array:
    """Of `WINDOW` neighbours, or of as many as there are."""
    one = np.ones(min(WINDOW, values.size))
    return np.asarray(np.convolve(values, one, "same") / np.convolve(np.ones(values.size), one, "same"))


def legs(deflection: Array) -> NDArray[np.int8]:
    """(N,) +1 on loading and -1 on unloading legs of the deflections (N,), reversals within `REVERSAL` left aside."""
    tolerance = jitter(deflection)
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
    return np.asarray((leg > 0) & (deflection >= reached(deflection) - jitter(deflection)))


def reached(deflection: Array) -> Array:
    """(N,) m: the largest deflection so far. In a long record no single reading sets it alone."""
    if deflection.size < LONG:
        return np.maximum.accumulate(deflection)
    before, here, after = deflection[:-2], deflection[1:-1], deflection[2:]
    middle = np.maximum(np.minimum(before, here), np.minimum(np.maximum(before, here), after))
    return np.maximum.accumulate(np.concatenate([deflection[:1], middle, deflection[-1:]]))


def _leaves(deflection: Array, start: int, tolerance: float) -> int:
    """The first reading after ``start`` that is farther from it than the tolerance, or their number."""
    low, step = start, 4 * HELD
    while low < deflection.size:
        away = np.flatnonzero(np.abs(deflection[low : low + step] - deflection[start]) > tolerance)
        if away.size:
            return low + int(away[0])
        low, step = low + step, 2 * step
    return int(deflection.size)


def holds(deflection: Array) -> list[NDArray[np.intp]]:
    """The readings of each time at which the disc stands still: `HELD` and more of them within the jitter, after a way
    at least ten times as fast.
    """
    if deflection.size > MOST_HELD:
        return _holds_of_means(deflection)
    tolerance, n = jitter(deflection), deflection.size
    found, i = [], 0
    while i + HELD <= n:
        if abs(deflection[i + HELD - 1] - deflection[i]) > tolerance:
            i += 1
            continue
        end = _leaves(deflection, i, tolerance)
        before = abs(deflection[i] - deflection[max(i - HELD, 0)]) / HELD
        during = abs(deflection[end - 1] - deflection[i]) / max(end - i, 1)
        if end - i >= HELD and during < STILL * before:
            found.append(np.arange(i, end))
            i = end
        else:
            i += 1
    return found


def _short_rests(deflection: Array) -> NDArray[np.bool_]:
    """(N,) True after each of at least `SHORT_REST` steps in a row that are hardly any.

    Not where the steps between those come one at a time: so does a coarse encoder show a motion that goes on.
    """
    out = np.zeros(deflection.size, np.bool_)
    steps = np.abs(np.diff(deflection))
    if not steps.size:
        return out
    still = steps <= NO_STEP * np.mean(steps)
    parts = np.split(np.arange(steps.size), np.flatnonzero(np.diff(still)) + 1)
    moves = [part.size for part in parts if not still[part[0]]]
    if moves and np.median(moves) >= SHORT_REST:
        for part in parts:
            out[part + 1] = still[part[0]] and part.size >= SHORT_REST
    return out


def _holds_of_means(deflection: Array) -> list[NDArray[np.intp]]:
    """Of a long record: the holds of means of neighbours, which have less noise. Shorter ones are not told."""
    each = -(-2 * deflection.size // MOST_HELD)
    whole = deflection.size // each
    means = np.mean(deflection[: whole * each].reshape(whole, each), axis=1)
    return [np.arange(part[0] * each, (part[-1] + 1) * each) for part in holds(means)]


def check_time(time: Array, places: list[str]) -> None:
    """Raise `DataError` at the first of the times (N,) that is not above the one before; ``places`` name the rows."""
    late = np.flatnonzero(np.diff(time) <= 0)
    if late.size:
        k = int(late[0]) + 1
        raise DataError(
            f"the time does not increase ({time[k]:g} s after {time[k - 1]:g} s)", places[k], "sort the lines by time"
        )


def contradicted(motion: Motion) -> tuple[str, ...]:
    """A note, where the legs that were said are not those that the deflections show in many readings."""
    if motion.said_leg is None:
        return ()
    against = legs(motion.deflection) != motion.said_leg
    for still in holds(motion.deflection):
        against[still] = False
    rows = int(np.sum(against))
    if rows <= CONTRADICTED * against.size:
        return ()
    said = f"the column direction contradicts the motion in {rows} of {against.size} rows"
    return (f"{said}: it was believed, and should be 1 while the deflection grows and -1 while it falls",)


Filed = Callable[[float], tuple[str, str]]
"""Of a deflection in m: what a file calls it, and its value there."""


def in_mm(deflection: float) -> tuple[str, str]:
    """As files of a lifted disc have it."""
    return "deflection", f"{1e3 * deflection:g} mm"


def check_order(deflection: Array, places: list[str], filed: Filed = in_mm) -> None:
    """Raise `DataError` where deflections (N,) without times cannot be the order of a test; ``places`` name the rows.

    File order is then time order: the film is loaded first, a reversal lasts at least two steps, and no deflection is
    measured twice in a row but where the disc turns, which ends one leg and begins the next, or where it rests at zero.
    A single step back is a line in the wrong place.
    """
    step = np.diff(deflection)
    same = _not_at_a_turn(deflection, step)
    if same.size:
        k = int(same[0]) + 1
        fault = "the {} {} stands there twice".format(*filed(deflection[k]))
        raise DataError(fault, places[k], "remove one line or add time_s")
    name = filed(0.0)[0]
    remedy = f"sort the lines by {name}, or add time_s if the film was really moved like this"
    if np.any(step) and step[np.flatnonzero(step)[0]] < 0:
        raise DataError(f"the {name} falls from the first line on", places[1], remedy)
    moved = np.flatnonzero(step)
    starts = np.flatnonzero(np.diff(np.sign(step[moved]))) + 1
    lengths = np.diff(np.append(starts, moved.size))
    short = np.flatnonzero(lengths < 2)
    if short.size:
        k = int(moved[starts[short[0]]]) + 1
        here, before = (filed(deflection[i])[1] for i in (k, k - 1))
        fault = f"the {name} is not in order ({here} after {before})"
        raise DataError(fault, places[k], remedy)


def _not_at_a_turn(deflection: Array, step: Array) -> NDArray[np.intp]:
    """Numbers of the steps (N - 1,) that are none, although the disc goes on the same way or stands away from zero."""
    sign = np.sign(step)
    turned = _last_way(sign) * _last_way(sign[::-1])[::-1]  # from the way before to the way after; 0 where one is none
    return np.flatnonzero((sign == 0) & (turned >= 0) & ((turned > 0) | (deflection[:-1] != 0)))


def _last_way(sign: Array) -> Array:
    """(N,) the last of the signs (N,) so far that is not 0; 0 where none is."""
    return np.asarray(sign[np.maximum.accumulate(np.where(sign != 0, np.arange(sign.size), 0))])


def jitter(deflection: Array) -> float:
    """m, of deflections (N,) m: less is no movement; in a long record, what noise alone can make."""
    reach = float(np.max(deflection) - np.min(deflection))
    if deflection.size < LONG:
        return REVERSAL * reach
    bends = np.abs(np.diff(deflection, 2))  # of white noise: sqrt(6) times its standard deviation
    noise = float(np.median(bends)) / (0.6745 * math.sqrt(6.0))
    return max(REVERSAL * reach, min(SWINGS * noise, MOST_JITTER * reach))
