"""Stopping a computation from beside it, as Ctrl-C stops it: the same in a process and in a thread of Dask.

Signals reach only the main thread of a process, and a Dask worker computes in another one. Python raises an exception
in any thread that is named to it (PyThreadState_SetAsyncExc), at its next line of Python.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable
from typing import TypeVar

Result = TypeVar("Result")

LOOK = 1.0  # s


def until(due: Callable[[], bool], work: Callable[[], Result], every: float = LOOK) -> Result:
    """What ``work`` returns; ``due`` is asked beside it, and once it says so `KeyboardInterrupt` is raised in the work.

    The work may take that as it takes Ctrl-C: store, and return or raise. It is raised once at most.
    """
    beside = _Beside(threading.get_ident(), due, every)
    beside.start()
    try:
        return work()
    finally:
        beside.end()
        if beside.fired:
            _deliver()


class _Beside(threading.Thread):
    """The thread that asks."""

    def __init__(self, target: int, due: Callable[[], bool], every: float) -> None:
        super().__init__(daemon=True)
        self.target, self.due, self.every = target, due, every
        self.over, self.guard, self.fired = threading.Event(), threading.Lock(), False

    def run(self) -> None:
        while not self.over.wait(self.every):
            if self.due():
                with self.guard:
                    if not self.over.is_set():
                        self.fired = True
                        ctypes.pythonapi.PyThreadState_SetAsyncExc(
                            ctypes.c_ulong(self.target), ctypes.py_object(KeyboardInterrupt)
                        )
                return

    def end(self) -> None:
        """Nothing is raised from here on but what is on its way."""
        self.over.set()
        with self.guard:
            pass


def _deliver() -> None:
    """Give what is on its way the line of Python that it waits for, so that it is raised here and not later."""
    for _ in range(100):
        pass
