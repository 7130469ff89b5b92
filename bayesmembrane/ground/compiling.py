"""numba's compiled code on the disk, so that no state of the disk harms a computation.

numba notes a function in its index before the code itself is there. A full disk, or a process killed between the two,
leaves an index that points to code of another version, which the next process runs; and what cannot be written or read
ends in a traceback. Here the code comes first, under a name that nothing has, and what fails costs time only.

A compiler never gives back what it took, 0.2 GB for the first material: it works in a copy of this process that ends
with it, and this one reads what that left on the disk.
"""

from __future__ import annotations

import hashlib
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba.core import event
from numba.core.caching import FunctionCache, IndexDataCacheFile

PATIENCE = 300
"""Seconds after which a copy that compiles is given up, and this process does it."""


def compiled(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """A decorator as `numba.njit` with ``options``, whose code is kept on the disk where that is possible."""

    def wrap(function: Callable[..., Any]) -> Any:
        made = numba.njit(function, **options)
        # Where nothing can be written numba finds no place: then each process compiles for itself.
        with suppress(RuntimeError, OSError):
            made._cache = _Cache(made)
        return made

    return wrap


def for_kernel(values: Any) -> Any:
    """Floats as a kernel takes them: in C's order, and writable.

    What may only be read is another type to numba, for which all of a kernel would be compiled again.
    """
    if isinstance(values, np.ndarray) and values.dtype == float and values.flags.carray:  # asked for very often
        return values
    return np.require(values, float, ("C", "W"))


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

    def __init__(self, dispatcher: Any) -> None:
        super().__init__(dispatcher.py_func)
        self._dispatcher = dispatcher
        stamp = self._impl.locator.get_source_stamp()
        self._cache_file = _File(self._cache_path, self._impl.filename_base, stamp)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        found = super().load_overload(sig, target_context)
        if found is None and _Copies.serve():
            _in_a_copy(lambda: self._dispatcher.compile(sig))
            found = super().load_overload(sig, target_context)
            _Copies.failed = found is None
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        except OSError:
            self.disable()


class _Copies:
    """Whether copies of this process compile: not once that failed, nor where a system or threads make it unsafe.

    inside : this is such a copy
    """

    failed, inside = False, False

    @classmethod
    def serve(cls) -> bool:
        can = sys.platform == "linux" and threading.current_thread() is threading.main_thread()
        return can and not cls.failed and not cls.inside


def _in_a_copy(work: Callable[[], Any]) -> None:
    """Do ``work`` in a copy of this process, of which nothing stays but what it wrote."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads, none of which compiles
        process = os.fork()
    if process:
        _wait(process)
        return
    try:
        _alone()
        work()
    finally:
        os._exit(0)


def _wait(process: int) -> None:
    try:
        os.waitpid(process, 0)
    except BaseException:  # an interrupt: whoever comes next compiles it
        os.kill(process, signal.SIGKILL)
        os.waitpid(process, 0)
        raise


def _alone() -> None:
    """Let go of what this copy has of the process it was made of: signals, locks, pipes, and whom that tells."""
    _Copies.inside = True
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM):
        signal.signal(number, signal.SIG_DFL)
    signal.alarm(PATIENCE)
    nowhere = os.open(os.devnull, os.O_RDWR)
    for place in range(3):
        os.dup2(nowhere, place)
    os.closerange(3, os.sysconf("SC_OPEN_MAX"))
