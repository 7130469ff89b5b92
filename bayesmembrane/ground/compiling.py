"""numba's compiled code on the disk, so that no state of the disk harms a computation.

numba notes a function in its index before the code itself is there. A full disk, or a process killed between the two,
leaves an index that points to code of another version, which the next process runs; and what cannot be written or read
ends in a traceback. Here the code comes first, under a name that nothing has, and what fails costs time only.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numba
from numba.core import event
from numba.core.caching import FunctionCache, IndexDataCacheFile


def compiled(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """A decorator as `numba.njit` with ``options``, whose code is kept on the disk where that is possible."""

    def wrap(function: Callable[..., Any]) -> Any:
        made = numba.njit(function, **options)
        # Where nothing can be written numba finds no place: then each process compiles for itself.
        with suppress(RuntimeError, OSError):
            made._cache = _Cache(made.py_func)
        return made

    return wrap


@contextmanager
def compilation() -> Iterator[Compilation]:
    """What is compiled while the body runs, and not read from the disk."""
    found = Compilation()
    with event.install_listener("numba:compile", found):
        yield found


class Compilation(event.Listener):  # type: ignore[misc]
    """``seconds`` of a processor that compiling took."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._begun: list[float] = []

    def on_start(self, event: Any) -> None:
        self._begun.append(time.process_time())

    def on_end(self, event: Any) -> None:
        began = self._begun.pop()
        if not self._begun:  # what a function calls is compiled within it
            self.seconds += time.process_time() - began


class _File(IndexDataCacheFile):  # type: ignore[misc]
    """The index of a function, and the files with its code."""

    def save(self, key: Any, data: Any) -> None:
        # A name that nothing else has, so that processes that compile side by side cannot take each other's code.
        stamp = repr((key, self._source_stamp)).encode()
        name = self._data_name(int.from_bytes(hashlib.sha256(stamp).digest()[:8], "big"))
        self._save_data(name, data)
        self._save_index({**self._load_index(), key: name})

    def load(self, key: Any) -> Any:
        try:
            return super().load(key)
        except Exception:  # whatever a pickle that is cut or damaged raises
            with suppress(OSError):
                Path(self._index_path).unlink(missing_ok=True)
            return None


class _Cache(FunctionCache):  # type: ignore[misc]
    """Code that is kept; what cannot be kept is compiled again by the next process."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        stamp = self._impl.locator.get_source_stamp()
        self._cache_file = _File(self._cache_path, self._impl.filename_base, stamp)

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        except OSError:
            self.disable()
