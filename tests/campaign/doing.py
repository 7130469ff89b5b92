"""Work for the tasks of the tests, at the top of a module that workers import quickly."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.campaign.task import Task
from bayesmembrane.campaign.work import Found
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.jobs import Tell


def quick(task: Task, campaign: Path, tell: Tell) -> Found:
    """A number that follows from the seed."""
    tell("quick", "drawing")
    return Found(sampled(task))


def sampled(task: Task) -> dict[str, Any]:
    """What a run would say of itself."""
    x = np.random.default_rng(task.seed).normal(7.0, 0.1, 100)
    return {
        "parameters": {"c1": [float(x.mean()), float(x.min()), float(x.max())]},
        "ess": 100.0,
        "tau": 2.0,
        "r_hat": 1.0,
        "acceptance": 0.5,
        "failed": 0.0,
        "converged": True,
    }


def slow(task: Task, campaign: Path, tell: Tell) -> Found:
    """Steps of 20 ms that are kept on disk, so that whoever comes next goes on with them."""
    kept = campaign / "films" / f"{task.key}.steps"
    kept.parent.mkdir(parents=True, exist_ok=True)
    done = int(kept.read_text()) if kept.exists() else 0
    for step in range(done, 100):
        time.sleep(0.02)
        part = kept.with_suffix(f".{os.getpid()}")
        part.write_text(str(step + 1))
        part.replace(kept)
        tell("slow", f"step {step}")
    with (campaign / "films" / f"{task.key}.ends").open("a") as file:
        file.write("x")
    return Found(sampled(task))


def deadly_once(task: Task, campaign: Path, tell: Tell) -> Found:
    """Kills its worker the first time."""
    mark = campaign / f"{task.key}.died"
    if not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return quick(task, campaign, tell)


def deadly(task: Task, campaign: Path, tell: Tell) -> Found:
    """Kills its worker each time, where the seed is odd."""
    if task.seed % 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return quick(task, campaign, tell)


def faulty(task: Task, campaign: Path, tell: Tell) -> Found:
    """Goes wrong in several ways."""
    if task.seed % 3 == 0:
        raise SettingsError("this film cannot be", remedy="choose another")
    if task.seed % 3 == 1:
        raise ZeroDivisionError("nobody foresaw this")
    return quick(task, campaign, tell)


def deaf(task: Task, campaign: Path, tell: Tell) -> Found:
    """Does not come back for an hour, whoever asks."""
    time.sleep(3600)
    return Found({})


def suicide() -> None:
    """Kill this process."""
    os.kill(os.getpid(), signal.SIGKILL)
