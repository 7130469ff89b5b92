"""Steps that become more: in memory while they are few, then in a file without a name of which little is held at once.

An array of a long walk is a view of such a file. What is read of it counts as memory of the process until `let_go`, so
whoever goes through all of it does so by `stretches`.
"""

from __future__ import annotations

import mmap
import tempfile
import weakref
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.ground.parameters import Array

HELD = 2**24  # bytes that stay in memory
STRETCH = 2**24  # bytes that are gone through at once


def followed(values: Array, more: Array) -> Array:
    """(E, steps + s, ...) the ``values`` (E, steps, ...) and (E, s, ...) ``more`` behind them; both stay what they are.

    Where there is no room for a file all of it stays in memory.
    """
    if values.nbytes + more.nbytes > HELD:
        try:
            file = _file_of(values)
            if file is None or file.steps != values.shape[1]:  # of others, or gone on with by others
                file = _StepsFile(values[:, :0])
                file.take(values)
            file.take(more)
            return file.values()
        except OSError:
            pass
    return np.concatenate([values, more], axis=1)


def changed(values: Array, change: Callable[[Array], Array]) -> Array:
    """(E, steps, ...) what ``change`` makes of ``values``, whose steps it takes alike."""
    out = None
    for part in stretches(values):
        out = change(part) if out is None else followed(out, change(part))
    return change(values) if out is None else out


def stretches(values: Array, overlap: int = 0) -> Iterator[Array]:
    """(E, s, ...) all of it in order, ``overlap`` steps of each stretch being the first of the next one."""
    steps = values.shape[1]
    many = steps if _file_of(values) is None else max(1, STRETCH // max(1, values[:, :1].nbytes))
    for first in range(0, max(steps - overlap, 0), max(many, 1)):
        yield values[:, first : first + many + overlap]
        let_go(values)


def picked(values: Array, at: NDArray[np.intp]) -> Array:
    """(E, len(at), ...) the steps ``at`` of the ``values``, in order; nothing of the others stays held."""
    parts, first = [values[:, :0]], 0
    for part in stretches(values):
        last = first + part.shape[1]
        parts.append(part[:, at[(at >= first) & (at < last)] - first])
        first = last
    return np.ascontiguousarray(np.concatenate(parts, axis=1))


def let_go(values: Array) -> None:
    """Hold no longer what was read of ``values``; they can be read again."""
    found = _map_of(values)
    if found is not None and hasattr(mmap, "MADV_DONTNEED"):
        found.madvise(mmap.MADV_DONTNEED)


class _Map(mmap.mmap):
    """A part of a file in the memory of the process."""

    file: _StepsFile


class _StepsFile:
    """Steps (E, ...) one behind the other, in a file that is gone with the last array that shows it."""

    def __init__(self, like: Array) -> None:
        """Raises OSError."""
        self.shape = (like.shape[0], *like.shape[2:])
        self.size = 8 * int(np.prod(self.shape))
        self.steps = 0
        self._file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115, arrays show it
        weakref.finalize(self, self._file.close)

    def take(self, more: Array) -> None:
        """Append (E, s, ...); raises OSError, and what is there stays."""
        # Where it ends, and not where an interruption left it.
        self._file.seek(self.steps * self.size)
        for part in stretches(more):
            left = np.ascontiguousarray(np.swapaxes(part, 0, 1)).data.cast("B")
            while left:
                left = left[self._file.write(left) :]
        self.steps += more.shape[1]

    def values(self) -> Array:
        """(E, steps, ...) what it holds now."""
        found = _Map(self._file.fileno(), self.steps * self.size, access=mmap.ACCESS_READ)
        found.file = self
        return np.swapaxes(np.ndarray((self.steps, *self.shape), np.float64, found), 0, 1)


def _map_of(values: object) -> _Map | None:
    while isinstance(values, np.ndarray):
        values = values.base
    return values if isinstance(values, _Map) else None


def _file_of(values: Array) -> _StepsFile | None:
    found = _map_of(values)
    return None if found is None else found.file
