"""How long a campaign takes, before it begins.

What is foretold is the time of a processor, for the clock hangs on what else the machine does; by the clock it is
this time on as many processors as there are workers. What tasks take is told by rehearsals (`app.survey`); command and
workers start and end, and each worker loads compiled code with its first task.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from pathlib import Path
from typing import Any

from bayesmembrane.app.rehearsal import Pace
from bayesmembrane.app.standing import duration
from bayesmembrane.app.survey import Survey, surveyed
from bayesmembrane.app.terminal import say, table
from bayesmembrane.campaign.plan import Plan
from bayesmembrane.campaign.record import ENDED, read_records
from bayesmembrane.campaign.task import Task


@dataclass(frozen=True)
class Estimate:
    """What would run, and for how long.

    tasks : how many of each analysis are left to do
    work : s of a processor that they take
    starting : s of a processor in which command and workers start and load compiled code
    whole : s of a processor that all of it takes
    by_clock : s by the clock until the last one is done, on ``workers`` that have a processor each
    done, refused : tasks that are done already, and why others cannot be
    rehearsed : s of a processor that the tasks take that were rehearsed, on average of each kind
    """

    tasks: Mapping[str, int]
    work: Mapping[str, float]
    starting: float
    whole: Pace
    by_clock: Pace
    workers: int
    done: int
    refused: tuple[str, ...]
    rehearsed: Mapping[str, float]

    def document(self) -> dict[str, Any]:
        """Plain values: the JSON answer of ``campaign run --dry-run``."""
        return {
            "tasks": dict(self.tasks),
            "core_seconds": dict(self.work),
            "starting_core_seconds": self.starting,
            "whole_core_seconds": self.whole.likely,
            "whole_core_seconds_range": [self.whole.least, self.whole.most],
            "seconds": self.by_clock.likely,
            "seconds_range": [self.by_clock.least, self.by_clock.most],
            "workers": self.workers,
            "done": self.done,
            "refused": list(self.refused),
            "rehearsed": dict(self.rehearsed),
        }


def estimated(campaign: Path, made: Plan, workers: int, tell: Callable[[str], None]) -> Estimate:
    """What is left to do of a plan, and how long it takes on so many ``workers``; ``tell`` hears what is rehearsed."""
    if workers < 1:
        raise ValueError(f"{workers} workers do nothing")
    ended = {key for key, record in read_records(campaign).items() if record.state in ENDED}
    able = [task for task in made.tasks if not task.fault]
    left = [task for task in able if task.key not in ended]
    survey = surveyed(left, tell)
    times = [(task, survey.pace(task)) for task in left]
    analyses = Counter(task.analysis for task in left)
    busy = min(workers, len(left))
    starting = survey.start * (1 + busy) + survey.loading * busy
    alone = 2 * survey.start + survey.loading
    schedule = [_wall([(task, getattr(p, luck)) for task, p in times], workers) for luck in ("likely", "least", "most")]
    return Estimate(
        tasks=analyses,
        work={a: sum(pace.likely for task, pace in times if task.analysis == a) for a in analyses},
        starting=starting,
        whole=reduce(Pace.and_then, (pace for _, pace in times), Pace(starting, starting, starting)),
        by_clock=Pace(*(seconds + alone for seconds in schedule)),
        workers=workers,
        done=len(able) - len(left),
        refused=tuple(task.fault for task in made.tasks if task.fault),
        rehearsed=_rehearsed(left, survey),
    )


def _rehearsed(tasks: Sequence[Task], survey: Survey) -> dict[str, float]:
    found: dict[str, list[float]] = {}
    for task in tasks:
        if task.key in survey.found:
            found.setdefault(survey.kinds[task.key].label, []).append(survey.pace(task).likely)
    return {label: sum(times) / len(times) for label, times in found.items()}


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
    rows.append(["start and end of command and workers", "", duration(found.starting)])
    table("What would run", ["analysis", "tasks", "time of one core"], rows)
    for fault in found.refused:
        say(f"Cannot be done: {fault}")
    already = f"{found.done} tasks are done already. " if found.done else ""
    say(f"{already}{in_words(found.whole)} of one core; on {found.workers} workers about {in_words(found.by_clock)}.")


def in_words(pace: Pace) -> str:
    """The likely time, with the range unless that says nothing."""
    likely, least, most = (duration(s) or "0 s" for s in (pace.likely, pace.least, pace.most))
    return likely if least == most else f"{likely} ({least} to {most})"
