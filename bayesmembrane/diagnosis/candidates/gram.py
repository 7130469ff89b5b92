"""1 + D B^T B D and its inverse, for columns B of which many are orthogonal to each other.

With those apart last, C = (P Q; Q^T R), R diagonal, E = Q R^-1 and the complement S = P - E Q^T of I. Schur,

    C^-1 = (S^-1, -S^-1 E; -E^T S^-1, R^-1 + E^T S^-1 E),    ln det C = ln det S + ln det R,

so that only S, of the few other columns, is factorised.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.symmetric import eigh

Place = slice | NDArray[np.intp]
"""Numbers of columns; a slice, which costs no copy, where they stand side by side."""


@dataclass(frozen=True, eq=False)
class Gram:
    """B^T B of m columns, not all of them apart.

    inner (a, a), mixed (a, l), squares (l,) : of the columns that are not apart, of these with those, and of those
    places : where the columns stand that are not apart, and those that are
    """

    inner: Array
    mixed: Array
    squares: Array
    places: tuple[Place, Place]

    @classmethod
    def of(cls, columns: Array, apart: NDArray[np.bool_]) -> Self:
        """Of columns (N, m); those ``apart`` (m,) are orthogonal to each other."""
        places = _place(np.flatnonzero(~apart)), _place(np.flatnonzero(apart))
        a, b = (columns[:, p] for p in places)
        return cls(a.T @ a, a.T @ b, np.einsum("ni,ni->i", b, b), places)

    @property
    def finite(self) -> bool:
        """True if all of it are numbers."""
        return bool(np.all(np.isfinite(self.inner)) and np.all(np.isfinite(self.squares)))

    def plus_one(self, scale: Array) -> Inverse | None:
        """1 + D B^T B D with D of ``scale`` (m,); None where doubles do not hold it."""
        own, other = (scale[p] for p in self.places)
        with np.errstate(over="ignore", invalid="ignore"):
            rest = 1.0 + self.squares * other * other
            mixed = self.mixed * own[:, None] * other
            part = mixed / rest
            c = self.inner * own * own[:, None]
            c[np.diag_indices(own.size)] += 1.0
            c -= part @ mixed.T
        if not (np.all(np.isfinite(c)) and np.all(np.isfinite(rest))):
            return None
        # LAPACK by itself, without SciPy's checks: this is done thousands of times.
        factor, fault = lapack.dpotrf(c.T, lower=1)
        if not fault:
            return Inverse(factor, None, part, rest, self.places)
        value, vector = eigh(c)
        value = np.maximum(value, 1.0)  # none is below 1: what is, is round-off
        return Inverse(np.diag(np.sqrt(value)), (vector / value) @ vector.T, part, rest, self.places)


@dataclass(frozen=True, eq=False)
class Inverse:
    """C^-1 of C = 1 + D B^T B D.

    factor : (a, a) lower triangular with S = L L^T; of its eigenvalues alone where round-off leaves no such, and
        ``known`` is S^-1
    part, rest : E (a, l) and R (l,)
    """

    factor: Array
    known: Array | None
    part: Array
    rest: Array
    places: tuple[Place, Place]

    @property
    def log_det(self) -> float:
        """ln det C."""
        return 2 * float(np.sum(np.log(np.diag(self.factor)))) + float(np.sum(np.log(self.rest)))

    def times(self, values: Array) -> Array:
        """C^-1 v of v (m,)."""
        a, b = self.places
        right, out = values[a] - self.part @ values[b], np.empty(values.size)
        out[a] = lapack.dpotrs(self.factor, right, lower=1)[0] if self.known is None else self.known @ right
        out[b] = values[b] / self.rest - self.part.T @ out[a]
        return out

    @cached_property
    def whole(self) -> Array:
        """(m, m) C^-1: as dear as all the rest, and not asked for where a value is enough."""
        a, b = self.places
        out = np.empty((sum(self.part.shape), sum(self.part.shape)))
        inner = self._inner
        mixed = inner @ self.part
        last = self.part.T @ mixed
        last[np.diag_indices(len(last))] += 1 / self.rest
        for rows, columns, values in ((a, a, inner), (b, b, last), (a, b, -mixed), (b, a, -mixed.T)):
            out[_cells(rows, columns)] = values
        return out

    @property
    def _inner(self) -> Array:
        if self.known is not None:
            return self.known
        half, _ = lapack.dpotri(self.factor, lower=1)
        inverse: Array = np.tril(half)
        inverse += np.tril(half, -1).T
        return inverse


def _place(numbers: NDArray[np.intp]) -> Place:
    if not numbers.size:
        return slice(0, 0)
    first, last = int(numbers[0]), int(numbers[-1])
    return slice(first, last + 1) if last - first + 1 == numbers.size else numbers


def _cells(rows: Place, columns: Place) -> Any:
    """What indexes those rows and columns of a matrix."""
    if isinstance(rows, slice) or isinstance(columns, slice):
        return rows, columns
    return np.ix_(rows, columns)
