"""Least squares from many starts at once: the solver's price is per batch, so a start more is nearly free."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.ground.parameters import Array

Residuals = Callable[[Array], tuple[Array, Array]]
"""x (B, k) -> r (B, N) and dr/dx (B, N, k); nan where there is nothing to compare, or no slope."""

DAMPING, EASIER, HARDER, HOPELESS = 1e-2, 0.1, 4.0, 1e12
LEAST_DAMPING = 1e-12
SLOW = 1e-9  # relative decrease of |r|^2 below which a step counts as slow
PATIENCE = 3  # slow steps in a row that end a search
CRAWL, CRAWLS = 1e-3, 4  # the same of a search that is far behind the best one, if nothing else is asked


@dataclass(frozen=True)
class Patience:
    """When a search is given up, or done.

    behind : times the least sum of squares from which on a search that crawls is not waited for
    crawls_below : relative decrease of |r|^2 by one step below which it does
    slow_below : relative decrease of |r|^2 below which a step counts as slow
    slow_by : decrease of |r|^2 below which it does, too
    enough : |r| below which nothing lower is asked for
    settled : relative decrease of |r|^2 below which a whole step, undamped, is not worth taking
    """

    behind: float = np.inf
    crawls_below: float = CRAWL
    slow_below: float = SLOW
    slow_by: float = 0.0
    enough: float = 0.0
    settled: float = 0.0


def descend(
    residuals: Residuals,
    start: Array,
    bounds: tuple[Array, Array],
    iterations: int,
    held: NDArray[np.bool_] | None = None,
    patience: Patience | None = None,
) -> tuple[Array, Array]:
    """min |r(x)|^2 with x between ``bounds`` (k,) from each row of start (M, k), by Marquardt's damped steps

        (J^T J + m diag(J^T J)) s = -J^T r,

    with coordinates at a bound left out while the step would leave it, and those in ``held`` (M, k) left out always.
    A row whose |r|^2 is more than ``patience.behind`` times the least is given up when it crawls: films at the edge of
    what can be solved cost most. One whose |r|^2 falls by less than its part ``patience.slow_below`` a few times in a
    row, or promises no more, is done, and so is one whose |r| is below ``patience.enough``, or for which a whole step
    promises less than ``patience.settled``: to be slow a few times in a row costs as many solutions. Returns x (M, k)
    and |r| (M,), inf where a start has no residuals or no slopes: neither a start nor a step goes where one of them is
    not a number.

    D. W. Marquardt, J. SIAM 11 (1963) 431, with the damping of H. B. Nielsen (IMM-REP-1999-05, Technical University of
    Denmark): it falls as far as the gain is what was promised, and rises faster with every step that gains nothing. A
    row that finds no better point with any damping is done.
    """
    search = Descent(start, bounds, iterations, held, patience or Patience())
    while len(search.asked):
        search.told(*residuals(search.asked))
    return search.x, search.size


class Descent:
    """`descend`, step by step: it asks for residuals, is told them, and asks again until it is done.

    So several searches can go on side by side, whose films are solved together.

    asked : (R, k) points whose residuals are wanted next; none when it is done
    """

    def __init__(
        self,
        start: Array,
        bounds: tuple[Array, Array],
        iterations: int,
        held: NDArray[np.bool_] | None = None,
        patience: Patience | None = None,
    ) -> None:
        count = len(start)
        self.bounds, self.left, self.patience = bounds, iterations, patience or Patience()
        self.x = np.clip(start, *bounds)
        self.free = np.ones(self.x.shape, bool) if held is None else ~held
        self.damping, self.harder = np.full(count, DAMPING), np.full(count, HARDER)
        self.slow, self.crawl = np.zeros(count, int), np.zeros(count, int)
        self.rows = np.arange(count)
        self.asked, self._begun = self.x, False

    @property
    def size(self) -> Array:
        """(M,) |r| of the best points so far."""
        return np.sqrt(self.square)

    def give_up(self) -> None:
        """Ask for nothing more."""
        self.asked = self.asked[:0]

    def told(self, r: Array, jacobian: Array) -> None:
        """Go on with r (R, N) and dr/dx (R, N, k) of what was asked."""
        if self._begun:
            going = self._judged(r, jacobian)
        else:
            self.r, self.jacobian, self.square, self._begun = r, jacobian, _square(r, jacobian), True
            self.normal = _Normal.at(self.x, r, jacobian, self.free, self.bounds)
            going = np.isfinite(self.square)
            going[going] = ~self._done(np.flatnonzero(going))
        self.rows = self.rows[going]
        if self.left == 0:
            self.rows = self.rows[:0]
        self.left -= 1
        step = self.normal.step(self.rows, self.damping[self.rows])
        self.asked = np.clip(self.x[self.rows] + step, *self.bounds)

    def _judged(self, new_r: Array, new_jacobian: Array) -> NDArray[np.bool_]:
        """Take the steps that are better, and suit the damping; (R,) True for searches that go on."""
        rows, square, patience = self.rows, self.square, self.patience
        new_square = _square(new_r, new_jacobian)
        better = new_square < square[rows]
        take, won = rows[better], square[rows] - new_square
        moved = self.asked - self.x[rows]
        promise = square[rows] - _square(self.r[rows] + (self.jacobian[rows] @ moved[:, :, None])[:, :, 0])
        little = np.where(better, won, promise) < np.maximum(patience.slow_below * square[rows], patience.slow_by)
        self.slow[rows] = np.where(little, self.slow[rows] + 1, 0)
        self.crawl[rows] = np.where(better & (won > patience.crawls_below * square[rows]), 0, self.crawl[rows] + 1)
        # A step that promised next to nothing may have won far more: the cube overflows, and is clipped.
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            eased = np.clip(1 - (2 * won / promise - 1) ** 3, EASIER, HARDER)
        self.damping[rows] *= np.where(better, np.where(promise > 0, eased, 1.0), self.harder[rows])
        self.damping = np.maximum(self.damping, LEAST_DAMPING)
        self.harder[rows] = np.where(better, HARDER, 2 * self.harder[rows])
        self._move(take, (self.asked[better], new_r[better], new_jacobian[better], new_square[better]))
        lost = (self.crawl[rows] >= CRAWLS) & (square[rows] / patience.behind > np.min(square))
        going = (self.damping[rows] < HOPELESS) & (self.slow[rows] < PATIENCE) & ~lost
        going[better] &= ~self._done(take)
        return np.asarray(going)

    def _move(self, take: NDArray[np.intp], there: tuple[Array, Array, Array, Array]) -> None:
        """Some of the searches stand at other points now: x, r, dr/dx and |r|^2."""
        for values, new in zip((self.x, self.r, self.jacobian, self.square), there, strict=True):
            values[take] = new
        if take.size:
            x, r, jacobian, _ = there
            self.normal.put(take, _Normal.at(x, r, jacobian, self.free[take], self.bounds))

    def _done(self, rows: NDArray[np.intp]) -> NDArray[np.bool_]:
        """(R,) True for searches where nothing lower is asked for, or no whole step promises enough."""
        square, patience = self.square[rows], self.patience
        done = np.sqrt(square) < patience.enough
        if patience.settled > 0 and rows.size:
            done |= self.normal.promise(rows) < patience.settled * square
        return np.asarray(done)


def _square(r: Array, jacobian: Array | None = None) -> Array:
    """|r|^2 (M,) of r (M, N) with slopes (M, N, k); inf where one of them is not a number, or too large to square."""
    with np.errstate(over="ignore", invalid="ignore"):
        size = np.sum(r * r, axis=1)
        known = np.isfinite(size)
        if jacobian is not None:
            known &= np.isfinite(np.sum(jacobian * jacobian, axis=(1, 2)))
    return np.where(known, size, np.inf)


@dataclass(frozen=True, eq=False)
class _Normal:
    """J^T J and -J^T r at M points, in the metric of its diagonal: ones stand on it, so that the conditioning is that
    of the problem. Coordinates that may not move have nothing else in their rows and columns.

    matrix (M, k, k), right (M, k), root (M, k) : of the diagonal
    moves : (M, k) True for coordinates that may move
    """

    matrix: Array
    right: Array
    root: Array
    moves: NDArray[np.bool_]

    @classmethod
    def at(cls, x: Array, r: Array, jacobian: Array, free: NDArray[np.bool_], bounds: tuple[Array, Array]) -> _Normal:
        low, high = bounds
        gradient = (r[:, None, :] @ jacobian)[:, 0]
        moves = free & ~((x <= low) & (gradient > 0)) & ~((x >= high) & (gradient < 0))
        j = np.where(moves[:, None, :], jacobian, 0.0)
        normal = np.swapaxes(j, 1, 2) @ j  # not by einsum, which does not know BLAS
        diagonal = np.einsum("mkk->mk", normal)
        diagonal = np.maximum(diagonal, 1e-12 * np.max(diagonal, axis=1, keepdims=True) + 1e-300)
        root = np.sqrt(diagonal)
        scaled = normal / root[:, :, None] / root[:, None, :]
        return cls(scaled, np.where(moves, -gradient / root, 0.0), root, moves)

    def step(self, rows: NDArray[np.intp], damping: Array) -> Array:
        """(R, k) Marquardt's step at some of the points."""
        return np.asarray(self._solved(rows, damping) / self.root[rows])

    def promise(self, rows: NDArray[np.intp]) -> Array:
        """(R,) by how much |r|^2 falls by a whole step, undamped, if r is linear."""
        whole = self._solved(rows, np.full(rows.size, LEAST_DAMPING))
        return np.asarray(np.sum(whole * self.right[rows], axis=1))

    def put(self, rows: NDArray[np.intp], other: _Normal) -> None:
        """Other points at some of the places."""
        for name in ("matrix", "right", "root", "moves"):
            getattr(self, name)[rows] = getattr(other, name)

    def _solved(self, rows: NDArray[np.intp], damping: Array) -> Array:
        k = self.right.shape[1]
        matrix = self.matrix[rows]
        matrix[:, np.arange(k), np.arange(k)] += damping[:, None] + ~self.moves[rows]
        return np.asarray(np.linalg.solve(matrix, self.right[rows][:, :, None])[:, :, 0])
