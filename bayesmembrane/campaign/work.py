"""One task in a worker, whatever kind of worker that is: locked, watched, recorded."""

from __future__ import annotations

import json
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from bayesmembrane.campaign.interrupt import until
from bayesmembrane.campaign.record import (
    DONE,
    ENDED,
    FAILED,
    PREEMPTED,
    RECORDS,
    REFUSED,
    Record,
    here,
    read_record,
    remove_now,
    write_now,
    write_record,
)
from bayesmembrane.campaign.task import Task
from bayesmembrane.ground.errors import BayesmembraneError, StorageError
from bayesmembrane.ground.files import write_text
from bayesmembrane.ground.jobs import Tell
from bayesmembrane.ground.locks import held

FILMS, LOCKS, SESSION = "films", "locks", "session.json"
WAIT = 20.0  # s for another worker to let go of a task
TOLD, SIGN_OF_LIFE = 2.0, 15.0  # s between two notes on how far a task is, and at most without one

STOPPED = "it was stopped from outside; resuming goes on with it"
ELSEWHERE = "another process works on it"


@dataclass(frozen=True)
class Found:
    """What performing a task brought.

    values : what tables say of it
    folder, page : where the answer and its page lie, None if nowhere
    interrupted : it stored what it had, and is not done
    """

    values: Mapping[str, Any]
    folder: Path | None = None
    page: Path | None = None
    interrupted: bool = False


class Perform(Protocol):
    """Does a task in the folder of its campaign, and tells how far it is; picklable. KeyboardInterrupt stops it."""

    def __call__(self, task: Task, campaign: Path, tell: Tell) -> Found: ...


@dataclass(frozen=True)
class Order:
    """What every task of a session is told.

    campaign : folder
    session : of the client; a task stops when another session has taken over
    ends : time in s since 1970 at which tasks stop, None if they need not
    """

    campaign: Path
    session: str
    perform: Perform
    ends: float | None = None


def execute(order: Order, task: Task, attempt: int = 1) -> Record:
    """Do a task, unless it is done, and store what became of it.

    Raises `StorageError` where that cannot be stored; whatever the work raises is in the record.
    """
    folder, began = order.campaign, time.monotonic()
    with held(folder / LOCKS / task.key, WAIT) as ours:
        if not ours:
            return Record(task.key, PREEMPTED, ELSEWHERE, worker=here())
        known = read_record(folder / RECORDS / f"{task.key}.json")
        if known is not None and known.state in ENDED:
            return known
        attempts = attempt + (0 if known is None else known.attempts)
        state, reason, trace, found = _done(order, task, _Notes(folder, task))
        remove_now(folder, task.key)
        record = Record(
            task.key,
            state,
            reason,
            trace,
            {} if found is None else found.values,
            _within(folder, None if found is None else found.folder),
            _within(folder, None if found is None else found.page),
            round(time.monotonic() - began, 3),
            attempts,
            here(),
        )
        write_record(folder, record)
        return record


def _done(order: Order, task: Task, notes: _Notes) -> tuple[str, str, str, Found | None]:
    """State, reason, trace, and what was found."""
    notes.write("beginning")

    def due() -> bool:
        notes.live()
        return stopped(order)

    try:
        found = until(due, lambda: order.perform(task, order.campaign, notes.tell))
    except KeyboardInterrupt:
        return PREEMPTED, STOPPED, "", None
    except StorageError as error:
        return FAILED, str(error), "", None
    except BayesmembraneError as error:
        return REFUSED, str(error), "", None
    except Exception as error:  # whatever it is, the other tasks go on, and the page says it on top
        return FAILED, f"{type(error).__name__}: {error}", traceback.format_exc(), None
    return (PREEMPTED, STOPPED, "", found) if found.interrupted else (DONE, "", "", found)


def _within(campaign: Path, place: Path | None) -> str:
    """A place relative to the campaign, so that its folder can be moved."""
    return "" if place is None else str(place.resolve().relative_to(campaign.resolve()))


@dataclass
class _Notes:
    """How far a task is, written now and then."""

    campaign: Path
    task: Task
    last: dict[str, Any] = field(default_factory=dict)
    written: float = 0.0

    def tell(self, label: str, message: Any) -> None:
        """As `ground.jobs.Tell`: a text, or the progress of sampling."""
        if isinstance(message, str):
            self.last = {"doing": message}
        else:
            names = ("steps", "ess", "wanted", "r_hat", "tau", "acceptance", "seconds_left")
            self.last = {"doing": "sampling"} | {n: getattr(message, n) for n in names if hasattr(message, n)}
        if time.monotonic() - self.written >= TOLD:
            self.write()

    def live(self) -> None:
        """Say that somebody works on it, unless that was said lately."""
        if time.monotonic() - self.written >= SIGN_OF_LIFE:
            self.write()

    def write(self, doing: str = "") -> None:
        """Write what is known."""
        self.written = time.monotonic()
        write_now(self.campaign, self.task.key, self.last | ({"doing": doing} if doing else {}))


# ---- the session -----------------------------------------------------------------------------------------------------


def write_session(campaign: Path, session: str, stop: bool = False) -> None:
    """Say whose tasks may work on a campaign, or that they are to stop. Raises `StorageError` if that cannot be."""
    write_text(campaign / SESSION, json.dumps({"session": session, "stop": stop}), "the session of the campaign")


def stopped(order: Order) -> bool:
    """Whether the tasks of a session are to stop: its time is over, its client says so, or another one took over."""
    if order.ends is not None and time.time() >= order.ends:
        return True
    try:
        held = json.loads((order.campaign / SESSION).read_bytes())
        return bool(held["session"] != order.session or held["stop"])
    except (OSError, ValueError, KeyError, TypeError):
        return False  # not to be read just now: the next look will tell


Execute = Callable[[Order, Task, int], Record]
