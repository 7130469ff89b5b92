"""The client of a campaign: hands out the tasks whose needs are met, notes what comes back, stops when it is time."""

from __future__ import annotations

import heapq
import signal
import time
import uuid
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from queue import Empty, SimpleQueue
from types import FrameType
from typing import Any

from bayesmembrane.campaign.index import OWNER, Index, opened, rebuild, seal
from bayesmembrane.campaign.plan import Plan
from bayesmembrane.campaign.pool import Executor
from bayesmembrane.campaign.record import ENDED, FAILED, PREEMPTED, Record, read_now, remove_now, write_record
from bayesmembrane.campaign.work import ELSEWHERE, STOPPED, Execute, Order, Perform, execute, write_session
from bayesmembrane.ground.errors import BayesmembraneError, StorageError
from bayesmembrane.ground.locks import held

COMMIT = 1.0  # s between two notes in the index
GRACE = 20.0  # s for tasks to store what they have; then they are ended, and lose what came after their last checkpoint
TRIES = 3  # of a task that was preempted though nobody stopped the campaign
FINISHED, DEADLINE, INTERRUPTED = "finished", "deadline", "interrupted"


@dataclass(frozen=True)
class Session:
    """How a campaign is driven.

    perform : does a task
    deadline : time of day at which it ends, done or not, "07:30"; None: when all is done
    show : is called about every second, with the index
    execute : what a worker runs; another one in tests
    """

    perform: Perform
    deadline: str | None = None
    show: Callable[[Index], None] = lambda _: None
    execute: Execute = execute


@dataclass(frozen=True)
class Ended:
    """How a session ended: "finished", "deadline" or "interrupted"; tasks by their state; the time it took, s."""

    how: str
    states: Mapping[str, int]
    seconds: float


def drive(campaign: Path, plan: Plan, begin: Callable[[], Executor], session: Session) -> Ended:
    """Do what is left to do of a plan, in any order that its needs allow, on the workers that ``begin`` finds.

    SIGINT, SIGTERM and the deadline make the tasks store what they have; what does not within `GRACE` is ended.
    Raises `StorageError` if another process drives the campaign, or its folder cannot be written.
    """
    began = time.monotonic()
    with held(campaign / OWNER, wait=2.0) as ours:
        if not ours:
            raise StorageError(
                "another process works on this campaign", str(campaign), "wait for its end, or stop it; status shows it"
            )
        rebuild(campaign, plan)
        ends = None if session.deadline is None else next_time(session.deadline)
        order = Order(campaign.resolve(), uuid.uuid4().hex, session.perform, ends)
        write_session(campaign, order.session)
        with _signals() as asked, _begun(begin) as executor, opened(campaign) as index:
            how = _Driver(plan, executor, session, order, index, asked).run()
            states = Counter(index.states().values())
        seal(campaign)
    return Ended(how, states, time.monotonic() - began)


def next_time(clock: str, now: datetime | None = None) -> float:
    """The next time that the clock says ``clock`` ("07:30", "07:30:15"), in s since 1970."""
    now = now or datetime.now()
    hours, minutes, seconds = (int(part) for part in (*clock.split(":"), "0")[:3])
    then = now.replace(hour=hours, minute=minutes, second=seconds, microsecond=0)
    return (then if then > now else then + timedelta(days=1)).timestamp()


@contextmanager
def _begun(begin: Callable[[], Executor]) -> Iterator[Executor]:
    """Workers, which are let go in peace at the end, and ended where something went wrong."""
    executor = begin()
    try:
        yield executor
    except BaseException:
        executor.abandon()
        raise
    executor.close()


@contextmanager
def _signals() -> Iterator[list[int]]:
    """A list that receives SIGINT and SIGTERM instead of this process; the second one of a kind is as ever."""
    asked: list[int] = []

    def note(number: int, _: FrameType | None) -> None:
        asked.append(number)
        signal.signal(number, before[number])

    numbers: tuple[int, ...] = (signal.SIGINT, signal.SIGTERM)
    before: dict[int, Any] = {}
    try:
        for number in numbers:
            before[number] = signal.signal(number, note)
    except ValueError:
        pass  # not the main thread: whoever has that one takes the signals
    try:
        yield asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


Back = tuple[str, "Future[Record]"]


@dataclass
class _Driver:
    """One session while it runs."""

    plan: Plan
    executor: Executor
    session: Session
    order: Order
    index: Index
    asked: Sequence[int]
    out: dict[str, Future[Record]] = field(default_factory=dict)
    back: SimpleQueue[Back] = field(default_factory=SimpleQueue)
    tries: Counter[str] = field(default_factory=Counter)
    noted: list[Record] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.tasks = {task.key: task for task in self.plan.tasks}
        self.states = self.index.states()
        left = [t for t in self.plan.tasks if not t.fault and self.states[t.key] not in ENDED]
        self.open = {t.key: {n for n in t.needs if n in self.tasks and self.states[n] not in ENDED} for t in left}
        self.needed: dict[str, list[str]] = {}
        for key, needs in self.open.items():
            for need in needs:
                self.needed.setdefault(need, []).append(key)
        self.place = {task.key: place for place, task in enumerate(self.plan.tasks)}
        self.ready = [(self.place[key], key) for key, needs in self.open.items() if not needs]  # in order: a heap

    def run(self) -> str:
        """Until all is done, or it is time; returns how it ended."""
        how, last = FINISHED, 0.0
        while self.ready or self.out:
            if reason := self._stop():
                how = reason
                break
            self._hand_out()
            self._take_back(0.2)
            if time.monotonic() - last >= COMMIT:
                last = time.monotonic()
                self._commit()
                self.session.show(self.index)
        if how != FINISHED:
            self._end()
        self._commit()
        self.session.show(self.index)
        return how

    def _stop(self) -> str:
        if self.asked:
            return INTERRUPTED
        return DEADLINE if self.order.ends is not None and time.time() >= self.order.ends else ""

    def _hand_out(self) -> None:
        while self.ready and len(self.out) < self.executor.ahead:
            _, key = heapq.heappop(self.ready)
            self.tries[key] += 1
            future = self.executor.submit(self.session.execute, self.order, self.tasks[key], 1)
            self.out[key] = future
            future.add_done_callback(lambda done, key=key: self.back.put((key, done)))  # type: ignore[misc]

    def _take_back(self, wait: float) -> None:
        """What came back, waiting for the first."""
        try:
            key, future = self.back.get(timeout=wait)
            while True:
                self._take(key, future)
                key, future = self.back.get_nowait()
        except Empty:
            return

    def _take(self, key: str, future: Future[Record]) -> None:
        self.out.pop(key, None)
        if future.cancelled() and self._stop():
            return  # it had not begun, and is what it was
        record = self._record(key, future)
        self.states[key] = record.state
        self.noted.append(record)
        again = record.state == PREEMPTED and self.tries[key] < TRIES and not self._stop()
        if again:
            heapq.heappush(self.ready, (len(self.tasks) + self.tries[key], key))  # after all others
        elif record.state in ENDED:
            self._release(key)

    def _release(self, key: str) -> None:
        """Those that waited for this task alone can begin; a refused one is missing in what rests on it."""
        for other in self.needed.pop(key, ()):
            self.open[other].discard(key)
            if not self.open[other]:
                heapq.heappush(self.ready, (self.place[other], other))

    def _record(self, key: str, future: Future[Record]) -> Record:
        """What became of a task, also where its worker could not say so."""
        if future.cancelled():
            return Record(key, PREEMPTED, STOPPED)
        error = future.exception()
        if error is None:
            return future.result()
        if isinstance(error, KeyboardInterrupt):
            return Record(key, PREEMPTED, STOPPED)
        said = str(error) if isinstance(error, BayesmembraneError) else f"{type(error).__name__}: {error}"
        record = Record(key, FAILED, said, attempts=self.tries[key])
        with suppress(StorageError):  # what fails is most often the disk itself: then the index alone says it
            write_record(self.order.campaign, record)
        return record

    def _commit(self) -> None:
        if self.noted:
            self.index.note([r for r in self.noted if r.reason != ELSEWHERE])
            self.noted.clear()

    def _end(self) -> None:
        """Let the tasks store what they have; end those that take longer than `GRACE`."""
        write_session(self.order.campaign, self.order.session, stop=True)
        self.ready.clear()
        begun = read_now(self.order.campaign)  # Dask would forget those, too, and not wait for what they store
        for key, future in list(self.out.items()):
            if key not in begun:
                future.cancel()
        latest = time.monotonic() + GRACE
        while self.out and time.monotonic() < latest:
            self._take_back(0.2)
        if self.out:
            self.executor.abandon()
            self._take_back(2.0)
        for key in self.out:
            self.noted.append(Record(key, PREEMPTED, STOPPED))
            remove_now(self.order.campaign, key)
