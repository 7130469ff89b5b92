"""What became of a task, and how far one is that is being done: small files that workers write into the campaign.

records/<key>.json   what came out, written whole and synced; never changed once the task is done
now/<key>.json       who works on a task and how far it is; rewritten every few seconds, removed at the end
"""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.plain import plain
from bayesmembrane.ground.sealed import read_json, write_json

RECORDS, NOW = "records", "now"
_WHAT = "the record of a task"

WAITING, RUNNING, PREEMPTED = "waiting", "running", "preempted"
FAILED, REFUSED, DONE = "failed", "refused", "done"
STATES = (WAITING, RUNNING, PREEMPTED, FAILED, REFUSED, DONE)
ENDED = (REFUSED, DONE)
"""States that are not tried again by resuming: of the others it may be another worker, or a free disk, that helps."""

STALE = 60.0  # s without a sign of life, after which a worker on another machine counts as dead


@dataclass(frozen=True)
class Record:
    """What became of a task.

    state : done; refused, where the user must mend something; failed; preempted, where it was stopped from outside
    reason : in a sentence, unless it is done
    trace : of a failure that nobody foresaw
    found : what tables say of it: ESS, parameters, evidence, verdict
    folder, page : of the whole answer, and of its page; relative to the campaign, "" if there is none
    attempts : how often it was begun
    """

    key: str
    state: str
    reason: str = ""
    trace: str = ""
    found: Mapping[str, Any] = field(default_factory=dict)
    folder: str = ""
    page: str = ""
    seconds: float = 0.0
    attempts: int = 1
    worker: str = ""


def write_record(campaign: Path, record: Record) -> Path:
    """Store a record; raises `StorageError` if that cannot be."""
    return write_json(campaign / RECORDS / f"{record.key}.json", asdict(record), _WHAT, indent=None)


def read_record(path: Path) -> Record | None:
    """The record in a file; None if there is none or it is damaged: its task is then done again, and quickly."""
    try:
        record = Record(**read_json(path, _WHAT))
    except (StorageError, TypeError):
        return None
    return record if record.state in STATES and record.key == path.stem else None


def read_records(campaign: Path) -> dict[str, Record]:
    """Every record of a campaign by the key of its task."""
    folder = campaign / RECORDS
    names = os.listdir(folder) if folder.is_dir() else []
    found = (read_record(folder / name) for name in names if name.endswith(".json") and name[0] != ".")
    return {record.key: record for record in found if record is not None}


# ---- while it is being done ------------------------------------------------------------------------------------------


def here() -> str:
    """Which process on which machine this is."""
    return f"{socket.gethostname()}:{os.getpid()}"


def write_now(campaign: Path, key: str, values: Mapping[str, Any]) -> None:
    """Say how far a task is; a reader sees the old file or the new one. Raises `StorageError` if that cannot be."""
    path = campaign / NOW / f"{key}.json"
    part = path.with_suffix(f".{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(json.dumps({**plain(dict(values)), "worker": here(), "at": time.time()}), encoding="utf-8")
        part.replace(path)  # not synced: it says nothing that must survive
    except OSError as error:
        raise StorageError(
            f"the progress of a task cannot be written ({error.strerror or error})",
            str(path),
            "free some space, or make the folder writable",
        ) from None


def remove_now(campaign: Path, key: str) -> None:
    """Nobody works on the task any more."""
    (campaign / NOW / f"{key}.json").unlink(missing_ok=True)


def read_now(campaign: Path) -> dict[str, dict[str, Any]]:
    """How far the tasks are that somebody works on, by key; what a dead worker left is not among them."""
    found = {}
    for path in sorted((campaign / NOW).glob("*.json")):
        try:
            values = json.loads(path.read_bytes())
            if _alive(values):
                found[path.stem] = values
        except (OSError, ValueError, KeyError, TypeError, OverflowError):
            continue  # just removed, or cut by a power failure: nobody is known to work on it
    return found


def _alive(values: Mapping[str, Any]) -> bool:
    host, _, pid = str(values["worker"]).rpartition(":")
    if host != socket.gethostname():
        return time.time() - float(values["at"]) < STALE
    try:
        os.kill(int(pid), 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True  # it is there, and another user's
    return True
