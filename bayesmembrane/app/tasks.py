"""The tasks of a campaign as verbs: each calls the analysis, and takes from its answer what tables say of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from bayesmembrane.app import analyses
from bayesmembrane.app.analyses import Work
from bayesmembrane.app.answers import Answer
from bayesmembrane.calibration.posterior import FAILURES
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.campaign.task import Task
from bayesmembrane.campaign.work import FILMS, Found
from bayesmembrane.comparison.compare import ranges_of
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.diagnosis.explanation.case import Question
from bayesmembrane.ground.errors import DataError, SettingsError
from bayesmembrane.ground.jobs import Tell
from bayesmembrane.physics.hypothesis import Hypothesis, from_settings

PAGES = "pages"

Values = dict[str, Any]
Verb = Callable[[Task, Measurement, Work], tuple[Answer[Any], Values]]


def perform(task: Task, campaign: Path, tell: Tell) -> Found:
    """Do a task of the campaign in this folder: its answer goes to ``films/<film>/``, its page to ``pages/<key>/``.

    Raises `DataError` if the measurement is not what was planned, and whatever the analysis raises.
    """
    whole, options = measured(task), task.options or {}
    ess = float(options.get("sampling", {}).get("ess", Work.ess))
    work = Work(task.seed, campaign / FILMS / task.film, ess, tell)
    answer, values = known(task.analysis)(task, whole, work)
    interrupted = bool(getattr(answer.result, "interrupted", False))
    page = None
    if options.get("page") and not interrupted and answer.folder is not None:
        from bayesmembrane.report.page import write_report  # on demand: what draws takes 30 MB

        tell("page", "writing its page")
        page = write_report([answer.folder], campaign / PAGES / task.key, tell=lambda sentence: tell("page", sentence))
    return Found(values, answer.folder, page, interrupted)


def measured(task: Task) -> Measurement:
    """The whole measurement of a task; raises `DataError` if it is not what was planned."""
    whole = read_measurement(task.curve, task.specimen)
    part = whole if task.end is None else whole.up_to(task.end)
    if part.data_hash != task.data:
        raise DataError(
            "the measurement is not what it was when the campaign was planned",
            task.curve,
            "give campaign run the campaign file again, which plans for what stands there now",
        )
    return whole


def _part(task: Task, whole: Measurement) -> Measurement:
    return whole if task.end is None else whole.up_to(task.end)


def _claim(task: Task) -> Hypothesis:
    return from_settings(task.claims[0])


def _question(task: Task) -> Question:
    return Question(_claim(task), bool((task.options or {})["declared"]))


# ---- the verbs -------------------------------------------------------------------------------------------------------


def sample(task: Task, whole: Measurement, work: Work) -> tuple[Answer[Any], Values]:
    """The posterior: parameters, and how well it was sampled."""
    walk = Settings(**(task.options or {})["sampling"])
    answer = analyses.sample(_part(task, whole), _claim(task), replace(work, walk=walk), whole=whole)
    return answer, sampled(answer.document)


def sampled(document: Mapping[str, Any]) -> Values:
    """What tables say of a run, from its JSON answer."""
    tally = document["tally"]
    failed = sum(tally.get(outcome.label, 0) for outcome in FAILURES)
    return {
        "parameters": {n: [p["mean"], *p["hdi_94"]] for n, p in document["posterior"].items()},
        "ess": document["ess_bulk"],
        "wanted": document["ess_wanted"],
        "tau": max((tau for tau in document["tau"].values() if tau is not None), default=None),
        "r_hat": document["r_hat"],
        "acceptance": document["acceptance"],
        "evaluations": document["evaluations"],
        "tally": tally,
        "failed": failed / max(1, sum(tally.values())),
        "converged": document["status"] == "converged",
        "sentences": document["sentences"],
    }


def compare(task: Task, whole: Measurement, work: Work) -> tuple[Answer[Any], Values]:
    """The evidence of every hypothesis, in their order."""
    claims = [from_settings(c) for c in task.claims]
    answer = analyses.compare(ranges_of(whole, [] if task.end is None else [task.end]), claims, work, workers=1)
    table = [
        {
            "log_evidence": row["log_evidence"],
            "log_evidence_sd": row["log_evidence_sd"],
            "agreed": row["agreed"],
            "probability": row["posterior_probability"],
            "reason": row["reason"],
        }
        for row in answer.document["table"]
    ]
    document = answer.document
    return answer, {
        "rows": table,
        "agreed": document["agreed"],
        "sentence": document["sentence"] or document["reason"],
    }


def valleys(task: Task, whole: Measurement, work: Work) -> tuple[Answer[Any], Values]:
    """The valley of the loss."""
    answer = analyses.valleys(_part(task, whole), _claim(task), work)
    return answer, {"sentences": answer.document["sentences"]}


def diagnose(task: Task, whole: Measurement, work: Work) -> tuple[Answer[Any], Values]:
    """What the measurement says is missing."""
    answer = analyses.diagnose(_part(task, whole), _question(task), work)
    return answer, _verdict(answer.document)


def loop(task: Task, whole: Measurement, work: Work) -> tuple[Answer[Any], Values]:
    """The same, followed to its end; its runs lie apart, so that nobody else works on them."""
    how = replace(analyses.ADAPTING, out=(work.out or Path()) / "loops" / task.key)
    answer = analyses.loop(_part(task, whole), _question(task), work, how)
    return answer, _verdict(answer.document["rounds"][-1]) | {"rounds": len(answer.document["rounds"])}


def _verdict(document: Mapping[str, Any]) -> Values:
    return {k: document[k] for k in ("verdict", "effects", "material", "sentence", "p_value")}


VERBS: Mapping[str, Verb] = {
    "sample": sample,
    "compare": compare,
    "valleys": valleys,
    "diagnose": diagnose,
    "loop": loop,
}


def known(analysis: str) -> Verb:
    """The verb of an analysis; raises `SettingsError` for one that this version does not have."""
    if analysis not in VERBS:
        raise SettingsError(f'this version has no analysis "{analysis}"', remedy="run it with the version that planned")
    return VERBS[analysis]
