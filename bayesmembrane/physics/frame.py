"""Film and frame in series: the force at which what both give way is what was measured."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.ground.parameters import Array

MOST_ITERATIONS, QUICK, QUICK_LOST = 40, 15, 4
"""Turns of a search, at most; of one in which what a frame remembers moves; and of one of a film without a force."""
CLOSED = 1e-11  # of the largest deflection: so far what both give way may be from the measured one
SHORT, STEEP = 1e-10, 5.0
"""A secant over a shorter step is round-off, one so many times as steep as any before is no slope."""
FALLING = -0.7  # of the slope of the film over that of the frame: one that falls off more steeply is not followed
LONG, TURNS, NEAR = 0.1, 8, 1e-6
"""A step longer than this part of the force is made along the curve of the frame, which takes so many turns to find, or
until one changes the force by no more than the last number."""
PASSES = 12
"""At most, of a frame that remembers: a film without memory of time needs two."""
LEAST, FORGOTTEN = 1e-3, 8
"""Of a force at which the film is slack: the one that is tried beside none at all. And after so many turns brackets are
forgotten: where a film is slack hangs on what it remembers of other points, which are moving, too."""
MORE, PATIENT = 2.0, 12
"""So many times the force of the frame is tried where the film has none, and so often before a row is left so."""

Rows = NDArray[np.intp]
Film = Callable[[Rows, Array], tuple[Array, Array]]
"""Of some rows, at deflections (b, N) m: force (b, N) N, nan where there is none, and about its slope (b, N) N/m."""
Frame = Callable[[Rows, Array, Array], tuple[Array, Array]]
"""Of as many rows as there are forces (b, N) N, and the largest ones before (b, N) N: how far it yields (b, N) m, and
the derivative (b, N) m/N."""


def in_series(
    film: Film, frame: Frame, measured: Array, start: Array | None = None
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """(delta (B, N) m, F (B, N) N, found (B,)): F = film(delta) with delta + frame(F) = ``measured`` (B, N) m.

    The N points are in the order of the test: a frame may remember the largest force so far. It remembers what the
    forces are in each turn of a search; what that does not find is sought with what is remembered standing still.
    """
    delta, force, found = _closed(film, frame, measured, start, None)
    if not np.all(found):
        rows = np.flatnonzero(~found)
        own = None if start is None else start[rows]
        part = _standing_still(partial(_of, film, rows), partial(_of, frame, rows), measured[rows], own)
        delta[rows], force[rows], found[rows] = part
    return delta, force, found


def _standing_still(
    film: Film, frame: Frame, measured: Array, start: Array | None
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """`in_series` where what is remembered stands still in each of several passes, until it does from one to the next.

    Where the force is larger than ever it is that of a frame that remembers nothing, so that this one comes first, or
    the forces of ``start`` (B, N) N do. Where the film has no force there is nothing to be remembered.
    """
    delta, force, found = _closed(film, frame, measured, start, _peaks_before(start, measured))
    peaks, rows, reach = _peaks_before(start, measured), np.arange(len(measured)), _reach(measured)
    for _ in range(PASSES):
        now = _peaks_before(force, measured)
        with np.errstate(invalid="ignore"):
            moved = np.abs(frame(rows, force[rows], now[rows])[0] - frame(rows, force[rows], peaks[rows])[0])
        rows, peaks = rows[np.any(moved > CLOSED * reach, axis=1) & found[rows]], now
        if not rows.size:
            return delta, force, found
        part = _closed(
            partial(_of, film, rows), partial(_of, frame, rows), measured[rows], _rigid(force[rows]), peaks[rows]
        )
        delta[rows], force[rows], found[rows] = part
    found[rows] = False
    return delta, force, found


def _closed(
    film: Film, frame: Frame, measured: Array, start: Array | None, known: Array | None
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """`in_series` with a frame that remembers the forces ``known`` (B, N) N as the largest before; None: those before.

    Newton's method for the force, from ``start`` (B, N) N or from a frame that is rigid. A frame that yields like a
    power of the force less than one is without bounds soft at no force, where a tangent leads astray: long steps are
    made along the film's tangent and the frame's own curve. Slopes are at first those of a film without memory, then
    secants. Where the film is slack, one between a force that was too little and this one is tried. Rows that are found
    rest; those with ``found`` False are not, and have no force.
    """
    rows, reach = np.arange(len(measured)), _reach(measured)
    delta, force, found = np.array(measured), np.full(measured.shape, np.nan), np.zeros(len(measured), np.bool_)
    held = _rigid(film(rows, measured)[0]) if start is None else start
    # Forces of the frame that were too little, since the film has none where they leave it, and that were too much.
    low, high = np.full(measured.shape, -np.inf), np.full(measured.shape, np.inf)
    bracket = _Bracket.of(measured.shape)
    before, steepest = _Step(*np.full((3, *measured.shape), np.nan)), np.zeros(measured.shape)
    for turn in range(MOST_ITERATIONS if known is not None else QUICK):
        peaks = _peaks_before(held, held) if known is None else known[rows]
        yielded, soft = frame(rows, held, peaks)
        at = measured[rows] - yielded
        pull, slope = film(rows, at)
        lost, steepest = np.isnan(pull), np.fmax(steepest, np.abs(slope))
        slack = (pull <= 0) & (held > 0)
        slope = np.where(slack, 0.0, _seen(_Step(at, pull, slope), before, STEEP * steepest, soft, SHORT * reach))
        with np.errstate(all="ignore"):
            step = (pull - held) / (1 + soft * slope)
            near = np.abs(step) * soft <= CLOSED * reach
        here = np.all(near | (lost & (np.isnan(held) | (turn >= PATIENT)) & (known is not None)), axis=1)
        delta[rows[here]], force[rows[here]], found[rows[here]] = at[here], pull[here], True
        if np.all(here):
            break
        new = held + step
        far = np.nonzero(~here[:, None] & (np.abs(step) > LONG * np.abs(held)))
        own = partial(frame, rows[far[0]])
        new[far] = _along(own, (pull + slope * yielded)[far], slope[far], held[far], peaks[far])
        low, high = np.where(lost, held, low), np.where(~lost & (pull < held), held, high)
        with np.errstate(invalid="ignore"):
            between = np.where(np.isinf(high), MORE * np.abs(held), 0.5 * (low + high))
        new = np.where(lost | (new <= low), between, new)
        bracket = _Bracket.of(held.shape) if turn % FORGOTTEN == FORGOTTEN - 1 else bracket.narrowed(held, pull, slack)
        new = bracket.within(new, slack)
        # Where the film has no force nothing may be remembered: such rows are left to those who know what is.
        some = ~here & ~(np.any(lost, axis=1) & (turn >= QUICK_LOST) & (known is None))
        # No chord from where the film is slack says how steep it is.
        before, steepest = _Step(np.where(slack, np.nan, at)[some], pull[some], slope[some]), steepest[some]
        rows, held, low, high, bracket = rows[some], new[some], low[some], high[some], bracket.at(some)
    return delta, force, found


def _of(function: Callable[..., tuple[Array, Array]], rows: Rows, some: Rows, *values: Array) -> tuple[Array, Array]:
    """A film or a frame of ``some`` of these rows."""
    return function(rows[some], *values)


def _reach(measured: Array) -> float:
    return max(float(np.max(np.abs(measured))), 1e-12)


class _Bracket(NamedTuple):
    """Forces (B, N) N of the frame: the largest at which the film pulls more, and the least at which it is slack."""

    little: Array
    much: Array

    @classmethod
    def of(cls, shape: tuple[int, ...]) -> _Bracket:
        """Of none that is known."""
        return cls(np.full(shape, -np.inf), np.full(shape, np.inf))

    def narrowed(self, held: Array, pull: Array, slack: NDArray[np.bool_]) -> _Bracket:
        """By what the film does at the forces ``held``."""
        little = np.where(pull > held, np.fmax(held, self.little), self.little)
        return _Bracket(little, np.where(slack, np.fmin(held, self.much), self.much))

    def within(self, new: Array, slack: NDArray[np.bool_]) -> Array:
        """``new`` forces, but where the film is or was ``slack`` at them one between."""
        beyond = (slack | (new >= self.much)) & (self.little >= 0)
        with np.errstate(invalid="ignore", over="ignore"):
            return np.where(beyond, np.sqrt(np.fmax(self.little, LEAST * self.much) * self.much), new)

    def at(self, rows: NDArray[np.bool_]) -> _Bracket:
        return _Bracket(self.little[rows], self.much[rows])


class _Step(NamedTuple):
    """Where a search is, or was: deflection m and force N of the film, and the slope N/m that it goes on with."""

    at: Array
    pull: Array
    slope: Array


def _seen(here: _Step, before: _Step, steepest: Array, soft: Array, shortest: float) -> Array:
    """The slope of the film's force: that of the last step, which sees what history adds to it, where it was one, or
    what that step went on with where it was a short one, or the one that is known; all (B, N). A film may fall off, by
    less than a frame as ``soft`` follows it.
    """
    with np.errstate(all="ignore"):
        way = here.at - before.at
        secant = np.where(np.abs(way) > shortest, (here.pull - before.pull) / way, before.slope)
        use = np.isfinite(way) & (secant * soft > FALLING) & (secant < steepest)
        return np.where(use, secant, np.where(here.slope * soft > FALLING, here.slope, 0.0))


def _rigid(force: Array) -> Array:
    """The forces (B, N) on a frame that does not yield; the largest of its row where the film has none."""
    most = np.fmax.reduce(np.abs(force), axis=1)[:, None]
    return np.where(np.isnan(force), np.nan_to_num(most), force)


def _peaks_before(force: Array | None, measured: Array) -> Array:
    """(B, N) N: the largest of the forces (B, N) before each, and 0; 0 where no forces are known."""
    if force is None:
        return np.zeros(measured.shape)
    so_far = np.maximum.accumulate(np.fmax(force, 0.0), axis=1)
    return np.concatenate([np.zeros((len(force), 1)), so_far[:, :-1]], axis=1)


def _along(
    yielding: Callable[[Array, Array], tuple[Array, Array]], pull: Array, slope: Array, start: Array, peaks: Array
) -> Array:
    """F (M,) with F + k u(F) = ``pull`` (M,) N, of films with the slope k (M,): by Newton's method for ln |F|, of which
    the logarithm of the left side is nearly a straight line. ``peaks`` (M,) N are the largest forces before.
    """
    rest = yielding(np.zeros((len(pull), 1)), peaks[:, None])[0][:, 0]  # what has seated has no part in the logarithm
    pull = pull - slope * rest
    force, moving = np.where(start * pull > 0, start, pull), np.ones(len(pull), np.bool_)
    with np.errstate(all="ignore"):
        for _ in range(TURNS):
            yielded, soft = (v[:, 0] for v in yielding(force[:, None], peaks[:, None]))
            whole = force + slope * (yielded - rest)
            change = np.log(pull / whole) * whole / (force * (1 + slope * soft))
            force, moving = np.where(moving, force * np.exp(change), force), moving & (np.abs(change) > NEAR)
            if not np.any(moving):
                break
    return np.where((pull == 0) | ~np.isfinite(force), 0.0, force)
