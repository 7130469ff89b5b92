"""Work on the cores there are: fresh processes, and messages on how far they are."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing.managers import SyncManager
from queue import Empty
from threading import Thread
from typing import Any, Protocol, TypeVar

from bayesmembrane.ground.interrupts import insistent

Tell = Callable[[str, Any], None]
"""(label of a job, how far it is)."""

Result = TypeVar("Result")


class Submit(Protocol):
    """Starts ``work(*given, tell)``, somewhere and soon; ``work`` and what is given must be picklable."""

    def __call__(self, work: Callable[..., Result], *given: Any) -> Future[Result]: ...


def cores() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def silent(label: str, message: Any) -> None:
    """A `Tell` that tells nobody."""


@contextmanager
def workers(tell: Tell = silent, count: int | None = None) -> Iterator[Submit]:
    """Something that takes work, in ``count`` processes (None: one for each core); 1 works at once, in this one.

    What the work tells arrives at ``tell``, in a thread of this process. Any exception in the body, Ctrl-C among them,
    cancels what has not begun and asks what has to end: KeyboardInterrupt is raised in it, or deferred where it stores
    what it has (`interrupts.deferred`). Workers end with this process, even if it is killed. Scripts that use more than
    one process need the usual ``if __name__ == "__main__"``.
    """
    count = cores() if count is None else count
    if count == 1:
        yield lambda work, *given: _at_once(work, given, tell)
        return
    context = multiprocessing.get_context("spawn")
    manager = SyncManager(ctx=context)
    manager.start(_follow_parent)
    others = set(multiprocessing.active_children())
    with manager, ProcessPoolExecutor(count, mp_context=context, initializer=_prepare) as pool:
        queue, stop = manager.Queue(), list[bool]()
        listener = Thread(target=_listen, args=(queue, tell, stop), daemon=True)
        listener.start()
        try:
            yield lambda work, *given: pool.submit(_in_worker, work, given, queue)
        except BaseException:
            for worker in set(multiprocessing.active_children()) - others:
                worker.terminate()
            pool.shutdown(wait=True, cancel_futures=True)
            raise
        finally:
            stop.append(True)
            listener.join(timeout=2)


def _at_once(work: Callable[..., Result], given: tuple[Any, ...], tell: Tell) -> Future[Result]:
    done: Future[Result] = Future()
    done.set_result(work(*given, tell))
    return done


class _Worker:
    """This process, if it is a worker: whether it is at something, and whether it was asked to end."""

    busy, ended = False, False


def _in_worker(work: Callable[..., Result], given: tuple[Any, ...], queue: Any) -> Result:
    if _Worker.ended:  # the pool hands out one piece of work more than there are workers
        raise KeyboardInterrupt
    _Worker.busy = True
    try:
        with insistent():
            return work(*given, lambda label, message: queue.put((label, message)))
    except KeyboardInterrupt:
        _Worker.ended = True
        raise
    finally:
        _Worker.busy = False
        give_back()


def give_back() -> None:
    """Return freed memory to the system, where the C library keeps it for work as large as before.

    Between pieces of work that ask for memory of other shapes: 0.1 GB of a diagnosis are none of a sampler's.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if os.name == "posix" else None
    if trim is not None:
        trim(0)


def _prepare() -> None:
    """Leave Ctrl-C to the parent, which tells its workers once; and end when it ends."""

    def end(number: int, frame: Any) -> None:
        _Worker.ended = True
        if _Worker.busy:
            raise KeyboardInterrupt

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, end)
    _follow_parent()


def _follow_parent() -> None:
    """End this process with the one that started it, however that ends: nobody waits for what it does any more."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        Thread(target=_end_after, args=(parent,), daemon=True).start()


def _end_after(parent: Any) -> None:
    parent.join()
    os._exit(1)


def _listen(queue: Any, tell: Tell, stop: list[bool]) -> None:
    while not stop:
        try:
            tell(*queue.get(timeout=0.2))
        except Empty:
            continue
        except (EOFError, OSError):
            return
