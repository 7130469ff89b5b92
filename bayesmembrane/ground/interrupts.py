"""Being asked to stop: by Ctrl-C, by a signal to end, or by whoever called."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType

SIGNALS = (signal.SIGINT, signal.SIGTERM)
AGAIN = 0.01  # s, until an interrupt that got lost is raised once more

Stop = Callable[[], bool]
"""Asked again and again: whether to stop now."""


def never() -> bool:
    """A `Stop` that goes on."""
    return False


class StopAsked:
    """Whether somebody asked to stop; once true it stays so."""

    def __init__(self, stop: Stop) -> None:
        self.signalled, self._stopped, self._stop = False, False, stop

    def __call__(self) -> bool:
        self._stopped = self._stopped or self.signalled or self._stop()
        return self._stopped


@contextmanager
def deferred(stop: Stop = never) -> Iterator[StopAsked]:
    """While the body runs, SIGINT and SIGTERM only make what this yields true, as ``stop`` does; a second one raises.

    For a body that looks every now and then and ends at a good place. In threads, where signals do not arrive, only
    ``stop`` counts.
    """
    asked = StopAsked(stop)
    if threading.current_thread() is not threading.main_thread():
        yield asked
        return

    def note(number: int, frame: FrameType | None) -> None:
        if asked.signalled:
            raise KeyboardInterrupt
        asked.signalled = True

    with _handled(note):
        yield asked


@contextmanager
def held_back() -> Iterator[None]:
    """While the body runs, SIGINT and SIGTERM wait, and arrive after it: for what is short, and wrong if half done."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    waiting = list[int]()
    with _handled(lambda number, frame: waiting.append(number)):
        yield
    for number in waiting:
        signal.raise_signal(number)


@contextmanager
def raised() -> Iterator[None]:
    """While the body runs, SIGTERM raises KeyboardInterrupt, as SIGINT does; in threads nothing changes."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    with insistent(), _handled(signal.default_int_handler):
        yield


@contextmanager
def insistent() -> Iterator[None]:
    """While the body runs, an interrupt that nobody could catch is not told, but raised again a moment later.

    A signal may arrive while Python calls a finaliser, the callback of a weak reference, or a compiled function that
    cannot raise, as the one by which SciPy reads its Sobol numbers. What is raised there is told on standard error and
    lost (`sys.unraisablehook`); compiled functions have its traceback printed before (`sys.excepthook`).
    """
    lost_before, told_before = sys.unraisablehook, sys.excepthook
    due = threading.Event()  # one interrupt may come both ways

    def signal_again() -> None:
        due.clear()
        _signal_main_thread()

    def later() -> None:
        if not due.is_set():
            due.set()
            threading.Timer(AGAIN, signal_again).start()

    def raise_again(lost: sys.UnraisableHookArgs) -> None:
        if issubclass(lost.exc_type, KeyboardInterrupt):
            later()
        else:
            lost_before(lost)

    def tell(kind: type[BaseException], error: BaseException, where: TracebackType | None) -> None:
        if issubclass(kind, KeyboardInterrupt):
            later()
        else:
            told_before(kind, error, where)

    sys.unraisablehook, sys.excepthook = raise_again, tell
    try:
        yield
    finally:
        sys.unraisablehook, sys.excepthook = lost_before, told_before


def _signal_main_thread() -> None:
    """SIGTERM, unless that would end the process without a word: whoever handled it has gone by now."""
    if callable(signal.getsignal(signal.SIGTERM)) and (main := threading.main_thread().ident):
        signal.pthread_kill(main, signal.SIGTERM)


@contextmanager
def _handled(handler: Callable[[int, FrameType | None], object]) -> Iterator[None]:
    before = {number: signal.getsignal(number) for number in SIGNALS}
    # What is ignored stays so: a worker leaves Ctrl-C to the process that it works for.
    before = {number: old for number, old in before.items() if old is not signal.SIG_IGN}
    try:
        for number in before:
            signal.signal(number, handler)
        yield
    finally:
        for number, old in before.items():
            # None stands for a handler that Python did not set, and cannot set again.
            signal.signal(number, signal.SIG_DFL if old is None else old)
