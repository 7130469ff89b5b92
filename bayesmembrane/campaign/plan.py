"""All tasks of a campaign, stored whole, so that resuming asks for exactly the same."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from bayesmembrane.campaign.task import Task
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.sealed import damaged, read_json, write_json

PLAN, FORMAT = "plan.json", 1
_WHAT = "the plan of the campaign"
_AGAIN = "give campaign run the campaign file again: what is done stays done"


@dataclass(frozen=True)
class Plan:
    """What is to be done.

    name : of the campaign
    source : its file
    tasks : in the order in which they begin
    deadline : time of day at which it ends, done or not; None: when all is done
    """

    name: str
    source: str
    tasks: tuple[Task, ...]
    deadline: str | None = None


def write_plan(folder: Path, made: Plan) -> Path:
    """Store a plan in the folder of its campaign, in place of an older one.

    Raises `StorageError` if that cannot be, or the folder holds something else.
    """
    if folder.exists() and not (folder / PLAN).is_file() and (not folder.is_dir() or any(folder.iterdir())):
        raise StorageError("the folder holds files that are no campaign", str(folder), "choose another with --out")
    head = {"program": "bayesmembrane", "format": FORMAT, "name": made.name, "source": made.source}
    body = {"deadline": made.deadline, "tasks": [task.plain() for task in made.tasks]}
    return write_json(folder / PLAN, {**head, **body}, _WHAT, indent=None)


def read_plan(folder: Path) -> Plan:
    """The plan in the folder of a campaign; raises `StorageError` if there is none, or it is damaged."""
    path = folder / PLAN
    if not path.is_file():
        raise StorageError("there is no campaign in this folder", str(folder), "name the folder that campaign run made")
    held = read_json(path, _WHAT, _AGAIN)
    try:
        tasks = tuple(Task.from_plain(values) for values in held["tasks"])
        if held["format"] != FORMAT:
            raise ValueError(f"it has the format {held['format']}, and this version reads {FORMAT}")
        return Plan(str(held["name"]), str(held["source"]), tasks, held["deadline"])
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise damaged(path, _WHAT, f"{type(error).__name__}: {error}", _AGAIN) from None
