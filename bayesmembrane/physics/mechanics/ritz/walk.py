"""On from the last state of a path that was lost: does it go on with better elements and shorter steps, or end?"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.mechanics.request import Request, Spared, extensibility
from bayesmembrane.physics.mechanics.ritz import kernels
from bayesmembrane.physics.mechanics.ritz.batch import STRIDE, Shapes, films, path, run, shear_modulus
from bayesmembrane.physics.mechanics.solution import Status

# A walk goes on in rounds: through all deflections that are left, or, after a loss, in so many steps up to it.
ROUNDS, STEPS = 6, 16
# A step that takes more is tried in shorter ones.
MOST_ITERATIONS = 15
# From the flat film: to this part of the first deflection.
NEXT_TO_NOTHING = 0.01
# A path ends where what is left up to the next state is shorter than this part of the deflection, and at the same end
# for two bases if they differ by less than that.
SHORT, SAME_END = 2e-3, 0.02
# A path that ends with less than this of P11 / (G d) ends because ellipticity is about to be lost there.
NEARLY_BENT = 0.1
# A film of the kind that is spared is not walked on once a state, exact or not, shows it by this margin.
RULED_OUT_ON_THE_WAY = 1e-3
LOOSE_GAIN, LOOSE_VARIATION = 1e-5, 2e-2

Rows = NDArray[np.intp]
Mask = NDArray[np.bool_]


def nearly_resolved(result: Array, d: Array) -> Mask:
    """(B, N) True where the next bubbles would change the force by less than 1e-3 or so."""
    even = result[:, kernels.VARIATION] < LOOSE_VARIATION
    with np.errstate(invalid="ignore"):  # no force, or one without bounds: not resolved
        return np.asarray(even & (result[:, kernels.GAIN] < LOOSE_GAIN * np.abs(result[:, kernels.FORCE] * d)))


@dataclass(frozen=True)
class Met:
    """Results (K, rows) at K pairs of film and column, and their shapes."""

    film: Rows
    column: Rows
    found: Array
    shapes: Shapes


@dataclass
class Stand:
    """Where L walks stand.

    Attributes
    ----------
    rows : (L,) the films
    at, shapes : (L,) scaled deflections reached, and the solutions there
    lost : (L,) the next deflection that was tried in vain, inf if none, nan if not even the flat film was found
    near : (L,) True where the state reached is nearly resolved
    stiff, last : (L,) least P11 at the last deflection that was asked for, or at the start; and where the walk stands
    least : (2, L) least margins of convexity and ellipticity met on the way
    """

    rows: Rows
    at: Array
    shapes: Shapes
    lost: Array
    near: Mask
    stiff: Array
    last: Array
    least: Array

    @classmethod
    def new(cls, rows: Rows, at: Array, shapes: Shapes) -> Self:
        far = np.full(rows.size, np.inf)
        return cls(rows, at, shapes, far, np.zeros(rows.size, np.bool_), far.copy(), far.copy(), np.stack([far, far]))

    @property
    def short(self) -> Mask:
        """True where the path ends here, as far as this basis can tell."""
        return np.asarray(self.lost - self.at <= SHORT * self.at)


class Walks:
    """Paths of B films at ascending scaled deflections d (B, N), with the traces (B, 2n + E, N) of one polynomial."""

    def __init__(self, request: Request, d: Array, trace: Array) -> None:
        self.request, self.d, self.trace = request, d, trace
        self.before = self.now = Stand.new(np.empty(0, np.intp), np.empty(0), Shapes.flat(request.ratio, 0, 0))

    def on(self, lost: Mask, level: int) -> Met:
        """Towards the ``lost`` (B, N) deflections, with the elements of a level, from the last state of each film."""
        rows = np.flatnonzero(np.any(lost, axis=1))
        left = lost[rows]
        now = self._start(rows, np.argmax(left, axis=1), level)
        self.before, self.now = self.now, now
        parts, going = [], np.ones(rows.size, np.bool_)
        for _ in range(ROUNDS):
            sweeping = np.isinf(now.lost)
            for some in (np.flatnonzero(going & sweeping), np.flatnonzero(going & ~sweeping)):
                if some.size:
                    parts.append(self._round(some, left, level))
            going &= np.any(left, axis=1) & ~now.short & ~np.isnan(now.lost) & ~self._passed()
            if not np.any(going):
                break
        film, column, found = (np.concatenate([getattr(p, n) for p in parts]) for n in ("film", "column", "found"))
        return Met(film, column, found, Shapes.joined([p.shapes for p in parts]))

    def rest(self) -> None:
        """Nobody walks with the elements of this level: as for a film that does not in a batch that does."""
        self.before, self.now = self.now, Stand.new(np.empty(0, np.intp), np.empty(0), self.now.shapes.of([]))

    def reasons(self, level: int) -> tuple[Rows, NDArray[np.int8]]:
        """Films whose path ended in the last walk, as far as that can be believed, and why (`Status`)."""
        now, some = self.now, films(self.request, self.now.rows)
        gd = shear_modulus(some)
        ends = np.full(len(self.d), np.nan)
        ends[self.before.rows] = np.where(self.before.short, self.before.at, np.nan)
        # A nearly resolved state would be found by any basis; another one has to find the same end.
        same = now.near | (np.abs(now.at - ends[now.rows]) < SAME_END * now.at)
        # Chains that lock end the path by stiffening: that is no loss of stability.
        endless = np.isinf(extensibility(some))
        believed = now.short & same & endless
        # P11 goes to zero like the root of the distance: it falls by more than half, or is small already.
        passed, bent = self._passed(), (now.last < NEARLY_BENT * gd) | (now.last < 0.5 * now.stiff)
        # Already the flat film has no stiffness: that needs no path.
        flat = some.material.derivatives(some.parameters.T, some.prestretch, some.prestretch)[3]
        unstable = np.isnan(now.lost) & ~(flat > 0)
        believed, bent = believed | unstable, bent | unstable
        if self.request.spare is not Spared.NONE:
            # What lies beyond is reached, if at all, through states that rule the film out; and one that several bases
            # lose is worth no more effort where a prior is about to judge it.
            believed |= passed | ((level > 1) & endless)
        reason = np.where(passed | bent, Status.NOT_ELLIPTIC, Status.INDEFINITE).astype(np.int8)
        return now.rows[believed], reason[believed]

    def _passed(self) -> Mask:
        """(L,) True for films with a state on the way for which they are spared."""
        if self.request.spare is Spared.NONE:
            return np.zeros(self.now.rows.size, np.bool_)
        margin = self.now.least[0 if self.request.spare is Spared.NOT_CONVEX else 1]
        return np.asarray(margin < -RULED_OUT_ON_THE_WAY)

    def _start(self, rows: Rows, first: Rows, level: int) -> Stand:
        """From where the last walk stands, else the last state before the ``first`` lost column, else the flat film."""
        ratio, last = self.request.ratio, self.now
        shapes, at = Shapes.flat(ratio, rows.size, level), NEXT_TO_NOTHING * self.d[rows, first]
        place = np.full(len(self.d), -1)
        place[last.rows] = np.arange(last.rows.size)
        known = place[rows] >= 0
        known[known] = last.at[place[rows[known]]] < self.d[rows[known], first[known]]
        if np.any(known):
            old = place[rows[known]]
            at[known] = last.at[old]
            shapes.put(known, last.shapes.of(old).placed(at[known], level))
        if np.any(fresh := ~known & (first > 0)):
            row, column = rows[fresh], first[fresh] - 1
            at[fresh] = self.d[row, column]
            one = Shapes.from_trace(self.trace[row, :, column], Shapes.flat(ratio, row.size, 0).ends, 0)
            shapes.put(fresh, self._settled(one.placed(at[fresh], level), row, at[fresh], level))
        return Stand.new(rows, at, shapes)

    def _settled(self, shapes: Shapes, rows: Rows, at: Array, level: int) -> Shapes:
        """Elements that one polynomial asks for, mended by what they themselves would gain; many need it."""
        if level == 1:
            return shapes
        keep = np.ones(1, np.bool_)
        result, trace = run(films(self.request, rows), (at[None], keep), shapes, level, most=MOST_ITERATIONS)
        good = result[:, kernels.STATUS, 0] != Status.ITERATION_LIMIT
        found = Shapes.from_trace(trace[..., 0], shapes.ends, level).of(good)
        shapes.put(good, found.placed(at[good], level))
        return shapes

    def _round(self, some: Rows, left: Mask, level: int) -> Met:
        """One run of some walks, all after a loss or none; ``left`` (L, N) loses the columns that are met."""
        now = self.now
        grid, column = self._plan(some, left[some], level)
        request, start = films(self.request, now.rows[some]), now.shapes.of(some)
        if np.isfinite(now.lost[some[0]]):
            start = start.placed(now.at[some], level)
            now.shapes.put(some, start)
        keep = np.ones(len(grid), np.bool_)
        result, trace = run(request, (grid, keep), start, level, self.request.sensitivities, MOST_ITERATIONS)
        there = np.logical_and.accumulate(result[:, kernels.STATUS] != Status.ITERATION_LIMIT, axis=1)
        reached, each = np.sum(there, axis=1), np.arange(some.size)
        margins = np.where(there[:, None], result[:, (kernels.CONVEX, kernels.ELLIPTIC)], np.inf)
        now.least[:, some] = np.minimum(now.least[:, some], np.min(margins, axis=2).T)
        now.lost[some] = np.append(grid, np.full((1, some.size), np.inf), axis=0)[reached, each]
        asked = there & (column >= 0)
        known = np.max(np.where(asked, np.arange(len(grid)), -1), axis=1)
        fresh = (known >= 0) | np.isinf(now.stiff[some])
        now.stiff[some[fresh]] = result[each, kernels.LEAST_P11, np.maximum(known, 0)][fresh]
        good, last = reached > 0, np.maximum(reached - 1, 0)
        self._move(some[good], result[each, :, last][good], trace[each, :, last][good], grid[last, each][good])
        # A state that is not found again is left behind: from the flat film.
        self._restart(some[~good])
        k, at = np.nonzero(asked)
        left[some[k], column[k, at]] = False
        shapes = Shapes.from_trace(trace[k, :, at], start.ends[k], level)
        return Met(now.rows[some[k]], column[k, at], result[k, :, at], shapes)

    def _plan(self, some: Rows, left: Mask, level: int) -> tuple[Array, Rows]:
        """Deflections (M, K) to go through, beginning where the walks stand, and the column of each or -1, (K, M)."""
        now, d = self.now, self.d[self.now.rows[some]]
        at, lost = now.at[some], now.lost[some]
        if np.isfinite(lost[0]):
            grid = at + (lost - at) * np.arange(STEPS + 1)[:, None] / STEPS
            grid[-1] = lost
            column = np.full((some.size, STEPS + 1), -1)
            exact = left & (d == lost[:, None])
            column[:, -1] = np.where(np.any(exact, axis=1), np.argmax(exact, axis=1), -1)
            return grid, column
        # The columns that are left come first; the last of them is repeated.
        order, count = np.argsort(~left, axis=1, kind="stable"), np.sum(left, axis=1)
        places = np.arange(int(np.max(count)))
        order = np.take_along_axis(order, np.minimum(places, count[:, None] - 1), axis=1)
        grid, keep = path(at, np.take_along_axis(d, order, axis=1), STRIDE / 2**level)
        column = np.full((some.size, len(grid)), -1)
        column[:, keep] = np.where(places < count[:, None], order, -1)
        return grid, column

    def _move(self, some: Rows, result: Array, trace: Array, at: Array) -> None:
        """Some walks stand now at these results (K, rows)."""
        now, size = self.now, self.now.shapes.unknowns.shape[1]
        now.near[some] = nearly_resolved(result[..., None], at[:, None])[:, 0]
        now.at[some], now.last[some] = at, result[:, kernels.LEAST_P11]
        now.shapes.unknowns[some], now.shapes.gains[some] = trace[:, :size], trace[:, size:]

    def _restart(self, some: Rows) -> None:
        """Some walks begin again with the flat film; those that did are given up."""
        now = self.now
        flat = ~np.any(now.shapes.unknowns[some], axis=1)
        now.lost[some] = np.where(flat, np.nan, np.inf)
        again = some[~flat]
        now.at[again] = NEXT_TO_NOTHING * self.d[now.rows[again], 0]
        now.shapes.unknowns[again] = 0.0
