"""How long a campaign takes, before it begins: from rehearsals of its runs, and from what other analyses take of those.

A run of each material with each set of effects is rehearsed in a folder that is thrown away, with all that belongs to
it: starts, walk, predictions, page. It walks `STEPS` steps at most; what it says itself to lack is added. What is not
rehearsed within `PATIENCE` is taken for as long as the mean of what is. Each worker starts, and loads compiled code at
its first run. The other analyses solve the same forward model
more often: so many runs as `SHARES` says.
"""

from __future__ import annotations

import heapq
import resource
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
PATIENCE = 180.0  # s of a processor
SHARES = {"sample": 1.0, "compare": 1.2, "valleys": 0.6, "diagnose": 3.7, "loop": 10.0}
"""How many runs an analysis of one hypothesis takes as long as.

Means over the neo-Hookean and Gent's film on both ranges of the paper, where single ones were off by a factor of two; a
loop is counted as two diagnoses and three runs.
"""

Kind = tuple[str, ...]


@dataclass(frozen=True)
class Pace:
    """s that something takes by the clock, while this machine does what it does now, and of a processor alone."""

    clock: float
    processor: float

    def times(self, many: float) -> Pace:
        return Pace(many * self.clock, many * self.processor)


def total(paces: Sequence[Pace]) -> Pace:
    """One after the other."""
    return Pace(sum(p.clock for p in paces), sum(p.processor for p in paces))


@dataclass(frozen=True)
class Estimate:
    """What would run, and for how long.

    tasks : how many of each analysis are left to do
    work : s of one core that they take
    starting : s of one core in which the workers start and load compiled code
    seconds : by the clock until the last one is done, on ``workers``
    done, refused : tasks that are done already, and why others cannot be
    rehearsed : s by the clock that a run of each kind takes, as measured
    """

    tasks: Mapping[str, int]
    work: Mapping[str, float]
    starting: float
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
            "starting_core_seconds": self.starting,
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
    paces, loading = _rehearsed(left, tell)
    start = total([_start(), loading]) if left else Pace(0.0, 0.0)
    times = [(task, _pace(task, paces)) for task in left]
    analyses = Counter(task.analysis for task in left)
    return Estimate(
        tasks=analyses,
        work={a: sum(pace.processor for task, pace in times if task.analysis == a) for a in analyses},
        starting=start.processor * min(workers, len(left)),
        seconds=_wall([(task, pace.clock) for task, pace in times], workers) + start.clock,
        workers=workers,
        done=len(able) - len(left),
        refused=tuple(task.fault for task in made.tasks if task.fault),
        rehearsed={kind: pace.clock for kind, pace in paces.items()},
    )


def _kind(claim: Mapping[str, Any]) -> Kind:
    return (claim["material"], *claim["effects"])


def _rehearsed(left: Sequence[Task], tell: Callable[[str], None]) -> tuple[dict[Kind, Pace], Pace]:
    """What a run of each kind takes, empty if none can be made; and what the first run of a process takes longer."""
    first: dict[Kind, Task] = {}
    for task in left:
        for claim in task.claims:
            first.setdefault(_kind(claim), replace(task, claims=(claim,)))
    found: dict[Kind, Pace] = {}
    cold = warm = Pace(0.0, 0.0)
    began = time.process_time()
    for kind, task in first.items():
        if found and time.process_time() - began > PATIENCE:
            break
        tell(f"Timing {'+'.join(kind)}")
        try:
            if not found:
                cold = _rehearse(task)  # loads what all of them need, once in each worker
                found[kind] = warm = _rehearse(task)
            else:
                found[kind] = _rehearse(task)
        except BayesmembraneError:
            continue  # the campaign will refuse it, and say why
    return found, Pace(max(0.0, cold.clock - warm.clock), max(0.0, cold.processor - warm.processor))


def _rehearse(task: Task) -> Pace:
    """What one run takes, of which a part is walked."""
    options = {"sampling": {"ess": 1000.0}, "page": False, **(task.options or {})}
    walk = {**options["sampling"]}
    walk["most_steps"] = max(min(walk.get("most_steps", STEPS), STEPS), walk.get("chunk", 300))
    short = replace(task, analysis="sample", options={**options, "sampling": walk})
    told: list[Progress] = []
    began, busy = time.perf_counter(), time.process_time()
    with tempfile.TemporaryDirectory(prefix="rehearsal-") as name:
        perform(short, Path(name).resolve(), lambda _, now: told.append(now) if isinstance(now, Progress) else None)
    made = Pace(time.perf_counter() - began, time.process_time() - busy)
    lacking = told[-1].seconds_left if told else 0.0
    return made.times(1.0 + lacking / made.clock) if lacking > 0 else made


def _start() -> Pace:
    """What the start of a worker takes."""
    began, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-c", "import bayesmembrane.app.tasks"], check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Pace(time.perf_counter() - began, processor)


def _pace(task: Task, paces: Mapping[Kind, Pace]) -> Pace:
    """What a task takes of one worker."""
    if not paces:
        return Pace(0.0, 0.0)
    mean = total([*paces.values()]).times(1 / len(paces))
    return total([paces.get(_kind(claim), mean) for claim in task.claims]).times(SHARES[task.analysis])


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
    rows.append(["start of the workers", "", duration(found.starting)])
    table("What would run", ["analysis", "tasks", "time of one core"], rows)
    for fault in found.refused:
        say(f"Cannot be done: {fault}")
    already = f"{found.done} tasks are done already. " if found.done else ""
    say(f"{already}On {found.workers} workers about {duration(found.seconds) or '0 s'}.")
