"""Fresh processes, one for each core, and how far they are."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from queue import Empty
from threading import Thread
from typing import Any

Tell = Callable[[str, Any], None]
"""(label of a job, how far it is: a `Progress` of sampling or a text; "" is the end)."""

Submit = Callable[..., "Future[None]"]


@contextmanager
def workers(tell: Tell) -> Iterator[Submit]:
    """Something that takes ``(work, label, *arguments)``; the work is called with the arguments and a `Tell`."""
    context = multiprocessing.get_context("spawn")
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    with context.Manager() as manager, ProcessPoolExecutor(cores, mp_context=context) as pool:
        queue, stop = manager.Queue(), list[bool]()
        listener = Thread(target=_listen, args=(queue, tell, stop), daemon=True)
        listener.start()
        try:
            yield lambda work, label, *given: pool.submit(_in_worker, work, label, given, queue)
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise
        finally:
            stop.append(True)
            listener.join(timeout=2)


def _in_worker(work: Callable[..., None], label: str, given: tuple[Any, ...], queue: Any) -> None:
    queue.put((label, "working"))
    work(*given, lambda name, now: queue.put((name, now)))
    queue.put((label, ""))


def _listen(queue: Any, tell: Tell, stop: list[bool]) -> None:
    while not stop:
        try:
            tell(*queue.get(timeout=0.2))
        except Empty:
            continue
        except (EOFError, OSError):
            return
