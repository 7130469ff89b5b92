"""A task of a campaign rehearsed: what it takes of a processor, in a folder that is thrown away.

It is the task itself, with its starts, its lessons, its seed, its predictions and its page. Where a run is not over
within its patience, the steps that it lacks are told by its autocorrelation times and the lesson that comes next; of
other analyses nothing is known then but that they take longer.
"""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.app.analyses import Work
from bayesmembrane.app.tasks import PAGES, measured, perform, sample
from bayesmembrane.calibration.sampling.chains import Chains
from bayesmembrane.calibration.sampling.convergence import LEAST_STEPS, LEAST_TAUS, convergence
from bayesmembrane.calibration.sampling.proposals.learned import next_lesson
from bayesmembrane.calibration.sampling.segments import Segments
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.campaign.task import Task
from bayesmembrane.campaign.work import FILMS
from bayesmembrane.ground.compiling import compilation
from bayesmembrane.ground.errors import BayesmembraneError
from bayesmembrane.ground.jobs import silent
from bayesmembrane.report.page import write_report

LONG = 2500
"""Steps in which the walks of emcee's ensembles end, nearly all of them."""


@dataclass(frozen=True)
class Pace:
    """s of a processor that something takes, likely, and from ``least`` to ``most``."""

    likely: float
    least: float
    most: float

    def and_then(self, other: Pace) -> Pace:
        """One after the other, both by the same luck."""
        return Pace(self.likely + other.likely, self.least + other.least, self.most + other.most)


NOTHING = Pace(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Rehearsal:
    """What a task takes (``pace``; the least of it if the task was not ``over``), and ``took`` s until that was known.

    ``fault`` says why it cannot be done, and is "" if it can. A run counts as over for how long it takes is foretold;
    ``whole`` says whether it is there for a comparison to rest on.
    """

    pace: Pace
    took: float
    over: bool = True
    whole: bool = True
    fault: str = ""


class _TooLongError(BaseException):
    """Patience is at an end; nothing of the program handles it."""


def rehearse(task: Task, place: Path, patience: float) -> Rehearsal:
    """What a task takes, done for about ``patience`` s of a processor at most, in the campaign ``place``.

    Compiling is no part of it: that is done once, and kept.
    """
    began, left, over = time.process_time(), NOTHING, True
    with compilation() as compiling:
        try:
            if task.analysis == "sample":
                left = _run(task, place, patience)
            else:
                over = _in_time(task, place, patience)
        except BayesmembraneError as error:
            return Rehearsal(NOTHING, time.process_time() - began, fault=str(error))
    took = time.process_time() - began
    made = took - compiling.seconds
    return Rehearsal(Pace(made, made, made).and_then(left), took, over, over and left is NOTHING)


def _in_time(task: Task, place: Path, patience: float) -> bool:
    """Do a task; False if that takes longer."""
    try:
        with _for_at_most(patience):
            perform(task, place, silent)
    except _TooLongError:
        return False
    return True


@contextmanager
def _for_at_most(seconds: float) -> Iterator[None]:
    """Raise `_TooLongError` when the body has taken so much of the processor."""

    def over(*_: Any) -> None:
        raise _TooLongError

    before = signal.signal(signal.SIGPROF, over)
    try:
        # Again and again: what is raised while something is tidied away is lost.
        signal.setitimer(signal.ITIMER_PROF, max(seconds, 1e-3), 1.0)
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


# ---- runs ------------------------------------------------------------------------------------------------------------


def _run(task: Task, place: Path, patience: float) -> Pace:
    """What a run lacks that was walked for ``patience`` s; `NOTHING` if it is over."""
    walk = (task.options or {})["sampling"]
    marks: list[float] = []
    began = time.process_time()

    def over() -> bool:
        marks.append(time.process_time())
        return len(marks) > 1 and marks[-1] - began > patience  # one step, or block of steps, tells what one takes

    answer, _ = sample(
        task, measured(task), Work(task.seed, place / FILMS / task.film, float(walk.get("ess", Work.ess)), stop=over)
    )
    if (task.options or {}).get("page") and answer.folder is not None:
        write_report([answer.folder], place / PAGES / task.key)
    chains = Segments(answer.folder).read() if answer.result.interrupted and answer.folder is not None else None
    return NOTHING if chains is None else _left(chains, Settings(**walk), marks)


def _left(chains: Chains, settings: Settings, marks: Sequence[float]) -> Pace:
    """s that a walk lacks which was at a processor's time ``marks`` whenever it asked whether to go on."""
    least, likely, most = (max(0.0, steps - chains.steps) for steps in ends(chains, settings))
    # Of the proposal that it has now, if that is known by some steps.
    now = chains.steps - max([0, *chains.lessons])
    some = now if chains.mixture is None and LEAST_STEPS <= now < len(marks) else 0
    steps = some or chains.steps - 1
    each = (marks[-1] - marks[-1 - some if some else 0]) / max(1, steps)
    return Pace(each * likely, each * least, each * most)


def ends(chains: Chains, settings: Settings) -> tuple[float, float, float]:
    """Steps at which a walk ends at least, likely, and at most, as far as it knows its autocorrelation times.

    A lesson that comes before enough has been walked makes it begin anew; at most two of them do, and tau is twice what
    it seems.
    """
    cap = float(settings.most_steps)
    if chains.steps < LEAST_STEPS:
        return float(settings.chunk), float(settings.chunk), min(LONG, cap)
    found = convergence(chains)
    wanted = (chains.steps - found.burn) * settings.ess / float(np.min(found.ess))
    enough = max(LEAST_TAUS * float(np.max(found.tau)), wanted)
    least = likely = max(float(chains.steps), found.burn + enough)
    most = float(chains.steps + LONG)
    if (lesson := next_lesson(chains)) < sys.maxsize:
        if likely > lesson:
            likely = lesson + enough
        most = next_lesson(replace(chains, lessons=(*chains.lessons, lesson))) + 2 * enough
    return min(least, cap), min(likely, cap), min(max(likely, most), cap)
