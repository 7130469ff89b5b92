"""What the tasks of a campaign take of a processor, from rehearsals of some of them.

The first of each kind is rehearsed (`app.rehearsal`): runs first, those of each material before others of it. All
rehearsals of runs take `PATIENCE` at most, and the last of them to its first step. Of every other analysis the first
task is done whole, unless that takes longer than `LONGEST`, and those of other kinds while that is cheap. Time that is
left goes to further runs, as long as the dry run takes no more than `PART` of the campaign. What is not rehearsed is
taken for the mean of its kind, or of what is most like it; an analysis of which nothing is known takes as long as so
many runs as `SHARES` says.
"""

from __future__ import annotations

import resource
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

from bayesmembrane.app.rehearsal import NOTHING, Pace, Rehearsal, rehearse
from bayesmembrane.app.tasks import measured
from bayesmembrane.campaign.pool import LocalPool
from bayesmembrane.campaign.task import Task
from bayesmembrane.ground.errors import BayesmembraneError

PATIENCE = 180.0  # s of a processor for runs
FEWEST = 15.0  # s of it for a kind of them, as long as there are any; and for the kinds of each other analysis
LONGEST = 600.0  # s of it for each other analysis
PART = 0.2
SHARES = {"sample": 1.0, "compare": 1.2, "valleys": 0.6, "diagnose": 3.7, "loop": 10.0}
"""How many runs an analysis of one hypothesis takes as long as.

Means over the neo-Hookean and Gent's film on both ranges of the paper, where single ones were off by a factor of two; a
loop is counted as two diagnoses and three runs.
"""
ROUGHLY = 2.0  # factor by which these are off
LUCK = 1.5
"""Factor by which tasks of the same kind differ, of other films and other seeds."""


@dataclass(frozen=True)
class TaskKind:
    """What tasks have in common that take about as long: ``claims`` in words, ``readings`` to the next power of two."""

    analysis: str
    materials: tuple[str, ...]
    claims: tuple[str, ...]
    reach: str
    rig: str
    readings: int

    @property
    def label(self) -> str:
        """All of it in one line."""
        asked = self.claims[0] if len(self.claims) == 1 else f"{len(self.claims)} hypotheses"
        return f"{self.analysis}: {asked}, {self.reach}, {self.rig} of about {self.readings} readings"

    def likeness(self, other: TaskKind) -> int:
        """How much two kinds of the same analysis have in common: 0 all of it, 3 nothing."""
        if self == other:
            return 0
        return 1 if self.claims == other.claims else 2 if self.materials == other.materials else 3


def kind_of(task: Task) -> TaskKind:
    """The kind of a task; without rig and readings if its measurement is not what was planned."""
    rig, readings = _measured(task.curve, task.specimen, task.data, task.end)
    size = 2 ** (readings - 1).bit_length() if readings else 0
    claims = tuple(f"{'+'.join([c['material'], *c['effects']])} {c['noise']} {c['convexity']}" for c in task.claims)
    return TaskKind(task.analysis, tuple(str(c["material"]) for c in task.claims), claims, task.reach, rig, size)


@cache
def _measured(curve: str, specimen: str, data: str, end: float | None) -> tuple[str, int]:
    try:
        whole = measured(Task("sample", "", curve, specimen, data, end))
    except BayesmembraneError:
        return "", 0
    return whole.rig.name, len(whole if end is None else whole.up_to(end))


@dataclass
class Survey:
    """What is known of tasks.

    kinds : of all tasks, by their keys
    found : what rehearsals found, by the keys of the tasks
    start, loading : s of a processor for start and end of a process, and for what a worker loads with its first task
    spent : s of a processor that the rehearsals took
    """

    kinds: Mapping[str, TaskKind]
    found: dict[str, Rehearsal] = field(default_factory=dict)
    start: float = 0.0
    loading: float = 0.0
    spent: float = 0.0

    def pace(self, task: Task) -> Pace:
        """What a task takes of one worker."""
        known = self.found.get(task.key)
        if known is not None and known.over:
            return known.pace
        alike = self._alike(self.kinds[task.key])
        if alike is None:
            alike = self._as_runs(task)
        if known is None:
            return alike
        longer = known.pace.least  # it was given up then
        return Pace(
            max(alike.likely, ROUGHLY * longer), max(alike.least, longer), max(alike.most, 2 * ROUGHLY * longer)
        )

    def _alike(self, kind: TaskKind) -> Pace | None:
        """Of what is most like this kind among what was rehearsed; None if there is nothing."""
        others = [(self.kinds[k], r.pace) for k, r in self.found.items() if r.over]
        others = [(other, pace) for other, pace in others if other.analysis == kind.analysis]
        if not others:
            return None
        best = min(kind.likeness(other) for other, _ in others)
        paces = [pace for other, pace in others if kind.likeness(other) == best]
        likely = sum(p.likely for p in paces) / len(paces)
        luck = LUCK if best == 0 else LUCK * ROUGHLY
        return Pace(likely, min(p.least for p in paces) / luck, max(p.most for p in paces) * luck)

    def _as_runs(self, task: Task) -> Pace:
        kind, whole = self.kinds[task.key], NOTHING
        for material, claim in zip(kind.materials, kind.claims, strict=True):
            one = self._alike(replace(kind, analysis="sample", materials=(material,), claims=(claim,)))
            whole = whole.and_then(one or NOTHING)
        share = SHARES[task.analysis]
        return Pace(whole.likely * share, whole.least * share / ROUGHLY, whole.most * share * ROUGHLY)


def surveyed(tasks: Sequence[Task], tell: Callable[[str], None]) -> Survey:
    """Rehearse as many of the tasks as it takes, in a worker."""
    survey = Survey({task.key: kind_of(task) for task in tasks})
    if not tasks:
        return survey
    before, pool = _of_children(), LocalPool(1)
    try:
        with tempfile.TemporaryDirectory(prefix="rehearsal-") as name:
            _rehearse(survey, tasks, _Stage(pool, Path(name).resolve(), tell))
    except BaseException:
        pool.abandon()
        raise
    pool.close()
    survey.start = max(0.0, _of_children() - before - survey.spent)
    return survey


def _of_children() -> float:
    """s of a processor that the processes had which this one began, and which have ended."""
    had = resource.getrusage(resource.RUSAGE_CHILDREN)
    return had.ru_utime + had.ru_stime


@dataclass(frozen=True)
class _Stage:
    """Where rehearsals take place."""

    pool: LocalPool
    place: Path
    tell: Callable[[str], None]

    def rehearse(self, survey: Survey, task: Task, patience: float, apart: str = "") -> Rehearsal:
        """Do so, ``apart`` from the others in a folder of that name, and count the time."""
        found = self.pool.submit(rehearse, task, self.place / apart, patience).result()
        survey.spent += found.took
        return found

    def take(self, survey: Survey, task: Task, patience: float) -> None:
        """Take what is found into the survey; what cannot be done the campaign will refuse, and say why."""
        self.tell(f"Timing {survey.kinds[task.key].label}")
        found = self.rehearse(survey, task, patience)
        if not found.fault:
            survey.found[task.key] = found


def _rehearse(survey: Survey, tasks: Sequence[Task], stage: _Stage) -> None:
    """First of each kind, and then what there is time for."""
    firsts = _firsts(survey, tasks)
    runs = [task for task in firsts if task.analysis == "sample"]
    if runs:
        _load(survey, runs[0], stage)
    for number, task in enumerate(runs):
        if survey.found and survey.spent > PATIENCE:
            break
        # More than an equal part, for most of the others will need less.
        stage.take(survey, task, max(FEWEST, 2 * (PATIENCE - survey.spent) / (len(runs) - number + 1)))
    for analysis in dict.fromkeys(task.analysis for task in firsts if task.analysis != "sample"):
        before = survey.spent
        able = [t for t in firsts if t.analysis == analysis and _can_begin(survey, t)]
        for number, task in enumerate(able):
            if survey.spent > before + FEWEST and survey.spent > _allowed(survey, tasks):
                break
            stage.take(survey, task, LONGEST + before - survey.spent)
            if number == 0 and survey.spent - before < FEWEST and not task.needs and task.key in survey.found:
                _again(survey, task, stage)
    for task in sorted(tasks, key=lambda t: t.key):  # in no order
        if (left := min(PATIENCE, _allowed(survey, tasks)) - survey.spent) < 0:
            break
        if task.analysis == "sample" and task.key not in survey.found:
            stage.take(survey, task, max(FEWEST, left))


def _firsts(survey: Survey, tasks: Sequence[Task]) -> list[Task]:
    """The first task of each kind, analyses in order; those of each of its materials before others of them."""
    first: dict[TaskKind, Task] = {}
    for task in tasks:
        first.setdefault(survey.kinds[task.key], task)
    turns: Counter[tuple[str, ...]] = Counter()
    order: dict[str, tuple[int, int]] = {}
    for kind, task in first.items():
        turns[same := (kind.analysis, *kind.materials)] += 1
        order[task.key] = list(SHARES).index(kind.analysis), turns[same]
    return sorted(first.values(), key=lambda task: order[task.key])


def _load(survey: Survey, task: Task, stage: _Stage) -> None:
    """What a worker loads with its first run: begun twice, the second time takes so much less."""
    cold, warm = stage.rehearse(survey, task, 0.0, "cold"), None
    if cold.took < FEWEST:
        warm = stage.rehearse(survey, task, 0.0, "warm")
    survey.loading = max(0.0, cold.pace.least - warm.pace.least) if warm else 0.0


def _again(survey: Survey, task: Task, stage: _Stage) -> None:
    """Do what is cheap a second time: a worker loads what it needs for it with its first task of that kind."""
    cold, warm = survey.found[task.key], stage.rehearse(survey, task, LONGEST, "again")
    if cold.over and warm.over:
        survey.loading += max(0.0, cold.pace.likely - warm.pace.likely)
        survey.found[task.key] = warm


def _can_begin(survey: Survey, task: Task) -> bool:
    """Whether all runs are there on which it rests."""
    return all(need in survey.found and survey.found[need].whole for need in task.needs)


def _allowed(survey: Survey, tasks: Sequence[Task]) -> float:
    """s of a processor that a dry run may take."""
    return PART * sum(survey.pace(task).likely for task in tasks)
