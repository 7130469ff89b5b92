"""How long a campaign takes, before it begins: from rehearsals of its runs, and from what other analyses take of those.

A run of each material with each set of effects is rehearsed in a folder that is thrown away, with all that belongs to
it: starts, walk, predictions, page. It walks `STEPS` steps at most; what it says itself to lack is added. What is not
rehearsed within `PATIENCE` is taken for as long as the mean of what is. The other analyses solve the same forward model
more often: so many runs as `SHARES` says.
"""

from __future__ import annotations

import heapq
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from bayesmembrane.app.standing import duration
from bayesmembrane.app.tasks import perform
from bayesmembrane.app.terminal import say, table
from bayesmembrane.calibration.sampling.walk import Progress
from bayesmembrane.campaign.plan import Plan
from bayesmembrane.campaign.record import ENDED, read_records
from bayesmembrane.campaign.task import Task
from bayesmembrane.ground.errors import BayesmembraneError

STEPS = 400
PATIENCE = 180.0  # s
SHARES = {"sample": 1.0, "compare": 1.2, "valleys": 0.6, "diagnose": 3.7, "loop": 10.0}
"""How many runs an analysis of one hypothesis takes as long as.

Means over the neo-Hookean and Gent's film on both ranges of the paper, where single ones were off by a factor of two; a
loop is counted as two diagnoses and three runs.
"""

Kind = tuple[str, ...]


@dataclass(frozen=True)
class Estimate:
    """What would run, and for how long.

    tasks : how many of each analysis are left to do
    work : s of one core that they take
    seconds : until the last one is done, on ``workers``
    done, refused : tasks that are done already, and why others cannot be
    rehearsed : s that a run of each kind takes, as measured
    """

    tasks: Mapping[str, int]
    work: Mapping[str, float]
    seconds: float
    workers: int
    done: int
    refused: tuple[str, ...]
    rehearsed: Mapping[Kind, float]

    def document(self) -> dict[str, Any]:
        """Plain values: the JSON answer of ``campaign run --dry-run``."""
        return {
            "tasks": dict(self.tasks),
            "core_seconds": dict(self.work),
            "seconds": self.seconds,
            "workers": self.workers,
            "done": self.done,
            "refused": list(self.refused),
            "rehearsed": {"+".join(kind): seconds for kind, seconds in self.rehearsed.items()},
        }


def estimated(campaign: Path, made: Plan, workers: int, tell: Callable[[str], None]) -> Estimate:
    """What is left to do of a plan whose folder is ``campaign``, there or not, and for how long; ``tell`` says what is
    being timed. Nothing is written there.
    """
    ended = {key for key, record in read_records(campaign).items() if record.state in ENDED}
    able = [task for task in made.tasks if not task.fault]
    left = [task for task in able if task.key not in ended]
    paces, start = _rehearsed(left, tell), _start()
    times = [(task, _seconds(task, paces)) for task in left]
    work: Counter[str] = Counter()
    for task, seconds in times:
        work[task.analysis] += seconds  # type: ignore[assignment]  # a counter of times
    return Estimate(
        tasks=Counter(task.analysis for task in left),
        work=work,
        seconds=_wall(times, workers) + (start if left else 0.0),
        workers=workers,
        done=len(able) - len(left),
        refused=tuple(task.fault for task in made.tasks if task.fault),
        rehearsed=paces,
    )


def _kind(claim: Mapping[str, Any]) -> Kind:
    return (claim["material"], *claim["effects"])


def _rehearsed(left: Sequence[Task], tell: Callable[[str], None]) -> dict[Kind, float]:
    """s that a run of each kind takes; empty if none can be made."""
    first: dict[Kind, Task] = {}
    for task in left:
        for claim in task.claims:
            first.setdefault(_kind(claim), replace(task, claims=(claim,)))
    found: dict[Kind, float] = {}
    began = time.monotonic()
    for kind, task in first.items():
        if found and time.monotonic() - began > PATIENCE:
            break
        tell(f"Timing {'+'.join(kind)}")
        try:
            if not found:
                _rehearse(task)  # loads what all of them need, which is no part of their time
            found[kind] = _rehearse(task)
        except BayesmembraneError:
            continue  # the campaign will refuse it, and say why
    return found


def _rehearse(task: Task) -> float:
    """s of one run, of which a part is walked."""
    options = {"sampling": {"ess": 1000.0}, "page": False, **(task.options or {})}
    walk = {**options["sampling"]}
    walk["most_steps"] = max(min(walk.get("most_steps", STEPS), STEPS), walk.get("chunk", 300))
    short = replace(task, analysis="sample", options={**options, "sampling": walk})
    told: list[Progress] = []
    began = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="rehearsal-") as name:
        perform(short, Path(name).resolve(), lambda _, now: told.append(now) if isinstance(now, Progress) else None)
    seconds = time.perf_counter() - began
    lacking = told[-1].seconds_left if told else 0.0
    return seconds + (lacking if lacking > 0 else 0.0)


def _start() -> float:
    """s in which a worker starts."""
    began = time.perf_counter()
    subprocess.run([sys.executable, "-c", "import bayesmembrane.app.tasks"], check=True)
    return time.perf_counter() - began


def _seconds(task: Task, paces: Mapping[Kind, float]) -> float:
    """s that a task takes of one worker."""
    if not paces:
        return 0.0
    mean = sum(paces.values()) / len(paces)
    return SHARES[task.analysis] * sum(paces.get(_kind(claim), mean) for claim in task.claims)


def _wall(times: Sequence[tuple[Task, float]], workers: int) -> float:
    """s until all are done: each goes to the worker that is free first, once its needs are done."""
    free = [0.0] * workers
    done: dict[str, float] = {}
    for task, seconds in times:
        begins = max([heapq.heappop(free), *(done.get(need, 0.0) for need in task.needs)])
        done[task.key] = begins + seconds
        heapq.heappush(free, done[task.key])
    return max(free)


def show_estimate(found: Estimate) -> None:
    """The estimate on the terminal."""
    rows = [[a, str(n), duration(found.work[a])] for a, n in found.tasks.items()]
    table("What would run", ["analysis", "tasks", "time of one core"], rows)
    for fault in found.refused:
        say(f"Cannot be done: {fault}")
    already = f"{found.done} tasks are done already. " if found.done else ""
    say(f"{already}On {found.workers} workers about {duration(found.seconds) or '0 s'}.")
