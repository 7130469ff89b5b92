"""The index of a campaign: every task in one SQLite file, so that nobody opens ten thousand folders.

It says nothing that does not stand in the plan and the records, and is made again from them at any time; so it needs no
syncing, and a damaged one is replaced.
"""

from __future__ import annotations

import hashlib
import json
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bayesmembrane.campaign.plan import Plan, read_plan
from bayesmembrane.campaign.record import RECORDS, REFUSED, WAITING, Record, read_records
from bayesmembrane.campaign.task import Task
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.files import write_text
from bayesmembrane.ground.locks import is_held
from bayesmembrane.ground.plain import json_text

INDEX, OWNER = "index.sqlite", "owner.lock"
SEAL = "index.sha256"
VERSION = 1

_COLUMNS = {
    "key": "TEXT PRIMARY KEY",
    "place": "INTEGER",
    "analysis": "TEXT",
    "film": "TEXT",
    "label": "TEXT",
    "noise": "TEXT",
    "convexity": "TEXT",
    "reach": "TEXT",
    "claims": "TEXT",
    "needs": "TEXT",
    "state": "TEXT",
    "reason": "TEXT",
    "recorded": "INTEGER",
    "ess": "REAL",
    "tau": "REAL",
    "r_hat": "REAL",
    "acceptance": "REAL",
    "failed": "REAL",
    "seconds": "REAL",
    "attempts": "INTEGER",
    "folder": "TEXT",
    "page": "TEXT",
    "found": "TEXT",
}
NUMBERS = ("ess", "tau", "r_hat", "acceptance", "failed")
"""What ``found`` says of a sampled run in numbers; columns of their own, so that they can be asked for."""


@dataclass(frozen=True)
class Entry:
    """A task in the index; the fields are those of `Task` and `Record`, and ``failed`` a share of all evaluations."""

    key: str
    analysis: str
    film: str
    label: str
    noise: str
    convexity: str
    reach: str
    claims: tuple[Mapping[str, Any], ...]
    state: str
    reason: str
    seconds: float | None
    attempts: int
    folder: str
    page: str
    found: Mapping[str, Any]


class Index:
    """The index in an open connection. Raises `StorageError` for what SQLite complains about."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self.connection = connection

    def note(self, records: Iterable[Record]) -> None:
        """Take over what became of tasks."""
        rows = [_of_record(record) for record in records]
        names = ", ".join(f"{name} = :{name}" for name in rows[0] if name != "key") if rows else ""
        if rows:
            with self.connection:
                self.connection.executemany(f"UPDATE tasks SET {names} WHERE key = :key", rows)

    def counts(self) -> dict[str, dict[str, int]]:
        """How many tasks are in which state, by analysis."""
        found: dict[str, dict[str, int]] = {}
        for analysis, state, count in self.connection.execute(
            "SELECT analysis, state, count(*) FROM tasks GROUP BY analysis, state ORDER BY min(place)"
        ):
            found.setdefault(analysis, {})[state] = count
        return found

    def reasons(self) -> list[tuple[str, str, int]]:
        """(state, reason, how many tasks) of those that were tried and are not done, the most frequent first."""
        return list(
            self.connection.execute(
                "SELECT state, reason, count(*) FROM tasks WHERE reason != '' GROUP BY state, reason "
                "ORDER BY count(*) DESC, min(place)"
            )
        )

    def sampled(self) -> dict[str, float | None]:
        """Least and mean ESS, largest tau, and mean acceptance of what is sampled; and how many fell short of it."""
        row = self.connection.execute(
            "SELECT min(ess), avg(ess), max(tau), avg(acceptance), max(failed) FROM tasks WHERE ess IS NOT NULL"
        ).fetchone()
        return dict(zip(("least_ess", "mean_ess", "largest_tau", "mean_acceptance", "most_failed"), row, strict=True))

    def spent(self) -> dict[str, tuple[int, float]]:
        """How many tasks of an analysis are done, and the mean time of one, s."""
        rows = self.connection.execute(
            "SELECT analysis, count(*), avg(seconds) FROM tasks WHERE state = 'done' GROUP BY analysis"
        )
        return {analysis: (count, seconds) for analysis, count, seconds in rows}

    def states(self) -> dict[str, str]:
        """The state of every task by its key, in the order of the plan."""
        return dict(self.connection.execute("SELECT key, state FROM tasks ORDER BY place"))

    def attempts(self) -> dict[str, int]:
        """How often tasks were begun, by key, where they were."""
        return dict(self.connection.execute("SELECT key, attempts FROM tasks WHERE attempts > 0"))

    def about(self) -> dict[str, str]:
        """Name and file of the campaign."""
        return dict(self.connection.execute("SELECT name, value FROM about"))

    def entries(self, keys: Sequence[str] | None = None) -> Iterator[Entry]:
        """Tasks in the order of the plan; those with these ``keys``, or all."""
        names = [n for n in _COLUMNS if n in Entry.__dataclass_fields__]
        asked = f"SELECT {', '.join(names)} FROM tasks"
        given: tuple[str, ...] = ()
        if keys is not None:
            asked += f" WHERE key IN ({', '.join('?' * len(keys))})"
            given = tuple(keys)
        for row in self.connection.execute(f"{asked} ORDER BY place", given):
            values = dict(zip(names, row, strict=True))
            values["claims"] = tuple(json.loads(values["claims"]))
            yield Entry(**{**values, "found": json.loads(values["found"])})


@contextmanager
def opened(campaign: Path) -> Iterator[Index]:
    """The index of a campaign, made from plan and records if it is missing, damaged, or behind them.

    While a client works on the campaign it is that client who keeps it up to date. Raises `StorageError` if there is no
    campaign.
    """
    path = campaign / INDEX
    connection = _connected(path)
    if connection is None or (not is_held(campaign / OWNER) and _old(campaign, path)):
        if connection is not None:
            connection.close()
        rebuild(campaign, read_plan(campaign))
        connection = _connected(path)
    if connection is None:
        raise StorageError("the index of the campaign cannot be read", str(path), "remove the file")
    with closing(connection):
        try:
            yield Index(connection)
        except (sqlite3.Error, UnicodeDecodeError) as error:
            raise StorageError(f"the index of the campaign cannot be used ({error})", str(path), "remove it") from None


def rebuild(campaign: Path, plan: Plan) -> Path:
    """Make the index anew from a plan and the records that lie there; returns its path. Raises `StorageError`."""
    path, part = campaign / INDEX, campaign / f".{INDEX}"
    changed = _changed(campaign)
    records = read_records(campaign)
    try:
        part.unlink(missing_ok=True)
        with closing(sqlite3.connect(part)) as connection, connection:
            connection.execute("PRAGMA synchronous = OFF")
            connection.execute("PRAGMA journal_mode = OFF")
            connection.execute(f"PRAGMA user_version = {VERSION}")
            connection.execute(f"CREATE TABLE tasks ({', '.join(f'{n} {t}' for n, t in _COLUMNS.items())})")
            connection.execute("CREATE TABLE about (name TEXT, value TEXT)")
            connection.executemany("INSERT INTO about VALUES (?, ?)", [("name", plan.name), ("source", plan.source)])
            connection.execute("CREATE INDEX by_state ON tasks (analysis, state)")
            marks = ", ".join(f":{name}" for name in _COLUMNS)
            rows = (_of_task(i, task, records.get(task.key)) for i, task in enumerate(plan.tasks))
            connection.executemany(f"INSERT INTO tasks VALUES ({marks})", rows)
        if changed:  # what is written from here on makes the index old again
            os.utime(part, ns=(changed, changed))
        part.replace(path)
        seal(campaign)
    except (sqlite3.Error, OSError) as error:
        raise StorageError(
            f"the index of the campaign cannot be written ({error})", str(path), "free some space, or make it writable"
        ) from None
    return path


def _connected(path: Path) -> sqlite3.Connection | None:
    """A connection to an index of this version; None if there is none, or it is damaged."""
    if not path.is_file():
        return None
    connection = sqlite3.connect(path, timeout=10.0)
    try:
        connection.execute("PRAGMA synchronous = OFF")
        (version,) = connection.execute("PRAGMA user_version").fetchone()
        connection.execute("SELECT count(*) FROM tasks, about").fetchone()
    except (sqlite3.DatabaseError, UnicodeDecodeError):  # what SQLite says of it may be no text either
        connection.close()
        return None
    if version != VERSION:
        connection.close()
        return None
    return connection


def seal(campaign: Path) -> None:
    """Note the checksum of an index that nobody changes any more; raises `StorageError` if that cannot be."""
    write_text(campaign / SEAL, _checksum(campaign / INDEX), "the checksum of the index")


def _checksum(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _old(campaign: Path, path: Path) -> bool:
    """Whether an index that nobody works with is to be made again: it is behind, or not what was written."""
    if _behind(campaign, path):
        return True
    try:
        whole = (campaign / SEAL).read_bytes() == _checksum(path).encode()
    except FileNotFoundError:
        return False  # of an earlier version
    return not whole and not is_held(campaign / OWNER)  # a client may just have begun


def _behind(campaign: Path, path: Path) -> bool:
    """Whether records came after the index: of a client that was killed, or of workers that went on without it."""
    return path.stat().st_mtime_ns < _changed(campaign)


def _changed(campaign: Path) -> int:
    """When a record was last written, ns since 1970; 0 if none was: every one is a new entry of its folder."""
    try:
        return (campaign / RECORDS).stat().st_mtime_ns
    except FileNotFoundError:
        return 0


def _of_task(place: int, task: Task, record: Record | None) -> dict[str, Any]:
    first = task.claims[0] if task.claims else {}
    state, reason = (REFUSED, task.fault) if task.fault else (WAITING, "")
    values: dict[str, Any] = dict.fromkeys(_COLUMNS)
    values |= {
        "key": task.key,
        "place": place,
        "analysis": task.analysis,
        "film": task.film,
        "label": task.label,
        "noise": first.get("noise", ""),
        "convexity": first.get("convexity", ""),
        "reach": task.reach,
        "claims": json.dumps(list(task.claims)),
        "needs": json.dumps(list(task.needs)),
        "state": state,
        "reason": reason,
        "recorded": 0,
        "attempts": 0,
        "folder": "",
        "page": "",
        "found": "{}",
    }
    return values if record is None else values | _of_record(record)


def _of_record(record: Record) -> dict[str, Any]:
    return {
        "key": record.key,
        "state": record.state,
        "reason": record.reason,
        "recorded": 1,
        "seconds": record.seconds,
        "attempts": record.attempts,
        "folder": record.folder,
        "page": record.page,
        "found": json_text(dict(record.found)),
        **{name: record.found.get(name) for name in NUMBERS},
    }
