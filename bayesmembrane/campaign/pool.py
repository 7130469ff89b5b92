"""Workers on this machine: processes that may die, each one alone.

`concurrent.futures` gives up all of its processes when one of them dies; here its task goes to a fresh one.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable
from concurrent.futures import Future
from multiprocessing.connection import Connection, wait
from queue import Empty, SimpleQueue
from threading import Lock, Thread
from typing import Any, Protocol, TypeVar

from bayesmembrane.ground.errors import BayesmembraneError
from bayesmembrane.ground.jobs import cores

Result = TypeVar("Result")

DEATHS = 3
"""Workers that a task may cost before it counts as what kills them."""


class WorkerDiedError(BayesmembraneError):
    """A task has cost several workers."""


class Executor(Protocol):
    """Where tasks run. A worker that dies costs its task another attempt, and nothing else.

    ahead : tasks that it is given at most: what is out costs memory, and what comes later cannot overtake it
    """

    ahead: int

    def submit(self, work: Callable[..., Result], *given: Any) -> Future[Result]:
        """Start ``work(*given)`` somewhere and soon; both must be picklable.

        The future raises `WorkerDiedError` where that costs `DEATHS` workers.
        """

    def workers(self) -> int:
        """How many tasks run side by side just now."""

    def abandon(self) -> None:
        """Forget what waits, and end what runs as a power cut would."""

    def close(self) -> None:
        """Let the workers go, when nothing runs."""


Job = tuple[Future[Any], Callable[..., Any], tuple[Any, ...]]


class LocalPool:
    """An `Executor` of ``count`` processes (None: one for each core)."""

    def __init__(self, count: int | None = None) -> None:
        count = count or cores()
        self.ahead = 2 * count
        self._jobs: SimpleQueue[Job | None] = SimpleQueue()
        self._context = multiprocessing.get_context("spawn")
        self._guard, self._over = Lock(), False
        self._processes: dict[int, Any] = {}
        self._threads = [Thread(target=self._keep, args=(i,), daemon=True) for i in range(count)]
        for thread in self._threads:
            thread.start()

    def submit(self, work: Callable[..., Result], *given: Any) -> Future[Result]:
        """See `Executor`."""
        future: Future[Result] = Future()
        self._jobs.put((future, work, given))
        return future

    def workers(self) -> int:
        """See `Executor`."""
        return len(self._threads)

    def abandon(self) -> None:
        """See `Executor`."""
        with self._guard:
            self._over = True
            for process in self._processes.values():
                process.kill()
        try:
            while True:
                job = self._jobs.get_nowait()
                if job is not None:
                    job[0].cancel()
        except Empty:
            self.close()

    def close(self) -> None:
        """See `Executor`."""
        for _ in self._threads:
            self._jobs.put(None)
        for thread in self._threads:
            thread.join(timeout=10)

    # ---- one worker --------------------------------------------------------------------------------------------------

    def _keep(self, place: int) -> None:
        """Keep one process, and give it a job after the other; a fresh one where it dies."""
        pipe: Connection | None = None
        while (job := self._jobs.get()) is not None:
            if job[0].set_running_or_notify_cancel():
                pipe = self._served(place, pipe, job)
        if pipe is not None:
            pipe.close()
            self._processes[place].join(timeout=5)

    def _served(self, place: int, pipe: Connection | None, job: Job) -> Connection | None:
        """The pipe to a living process, once the job is answered; None if the last one died of it."""
        future, work, given = job
        for _ in range(DEATHS):
            pipe = pipe or self._begun(place)
            if pipe is None:
                future.set_exception(KeyboardInterrupt())
                return None
            answer = self._asked(pipe, self._processes[place], work, given)
            if answer is not None:
                good, value = answer
                (future.set_result if good else future.set_exception)(value)
                return pipe
            pipe.close()
            pipe = None
        future.set_exception(
            WorkerDiedError(
                f"{DEATHS} workers died of it, the last with status {self._processes[place].exitcode}",
                remedy="most often memory is short: use fewer workers",
            )
        )
        return None

    def _begun(self, place: int) -> Connection | None:
        """A fresh process, and our end of the pipe to it; None if it is all over."""
        ours, theirs = self._context.Pipe()
        process = self._context.Process(target=_serve, args=(theirs,), daemon=True)
        with self._guard:
            if self._over:
                return None
            process.start()
            self._processes[place] = process
        theirs.close()
        return ours

    @staticmethod
    def _asked(
        pipe: Connection, process: Any, work: Callable[..., Any], given: tuple[Any, ...]
    ) -> tuple[bool, Any] | None:
        """(whether it went well, what came back); None if the process died."""
        try:
            pipe.send((work, given))
            while pipe not in wait([pipe, process.sentinel]):
                if not process.is_alive() and not pipe.poll():
                    return None
            answer: tuple[bool, Any] = pipe.recv()
            return answer
        except (EOFError, OSError):
            process.join(timeout=5)
            return None


# ---- in the process --------------------------------------------------------------------------------------------------


def _serve(pipe: Connection) -> None:
    """Answer jobs until the pipe is closed. Ctrl-C is the client's business, which tells the tasks to stop."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_die_with, args=(multiprocessing.parent_process(),), daemon=True).start()
    while True:
        try:
            work, given = pipe.recv()
        except EOFError:
            return
        try:
            answer: tuple[bool, Any] = (True, work(*given))
        except BaseException as error:
            answer = (False, error)
        pipe.send(answer)


def _die_with(parent: Any) -> None:
    """End with the process that began us: nobody would take the answer, and whoever resumes wants the lock."""
    wait([parent.sentinel])
    os._exit(1)
