"""A closed loop in sentences, and as the JSON answer of ``loop``."""

from __future__ import annotations

from typing import Any

from bayesmembrane.diagnosis.left.discrepancy import Discrepancy
from bayesmembrane.diagnosis.loop import Loop, Round, Stage, moved
from bayesmembrane.diagnosis.other_tests import OtherTest
from bayesmembrane.words import diagnosis as words
from bayesmembrane.words.language import percent
from bayesmembrane.words.seen import Seen, seen


def document(found: Loop) -> dict[str, Any]:
    """Plain values: the JSON answer of ``loop``, but for the place of its report."""
    return {
        "rounds": [round_document(r) for r in found.rounds],
        "sentence": sentence(found),
        "left": None if found.left is None else left_sentence(found.left, seen(found.rounds[0].diagnosis.measurement)),
        "predicted": [other_document(other) for other in found.others],
    }


def other_document(found: OtherTest) -> dict[str, Any]:
    """What was predicted of a test that no fit saw."""
    return {
        "specimen": found.measurement.specimen.name,
        "points": len(found.measurement),
        "rmse_before_N": found.rmse_before,
        "rmse_after_N": found.rmse_after,
        "inside_90": found.covered,
        "scatter": found.scatter,
        "sentence": other_sentence(found),
    }


def other_sentence(found: OtherTest) -> str:
    """The same in words."""
    how = seen(found.measurement)
    apart = f" (specimens {percent(found.scatter)} apart)" if found.scatter else ""
    return (
        f"{found.measurement.specimen.name}, which no fit saw, is predicted to {how.error(found.rmse_after)} root mean "
        f"square ({how.error(found.rmse_before)} by the model as given); the 90 % band{apart} holds "
        f"{percent(found.covered)} of its points."
    )


def round_document(found: Round) -> dict[str, Any]:
    """The answer of ``diagnose`` with both posteriors and how the material moved."""
    return {
        **words.document(found.diagnosis),
        "before": _stage(found.before),
        "after": _stage(found.after),
        "leaders": [{"model": s.run.hypothesis.label(), **_stage(s)} for s in found.leaders],
        "moved": moved(found.before.run, found.after.run),
    }


def sentence(found: Loop) -> str:
    """What was changed, and how it ended."""
    steps = []
    for r in found.rounds:
        if not r.changed:
            continue
        old, new = r.before.run.hypothesis, r.after.run.hypothesis
        if new.material is not old.material:
            steps.append(f"{new.material.title} instead of {old.material.title}")
        steps += [e.title for e in new.effects if e.name not in {e.name for e in old.effects}]
    start = f"Changed: {', '.join(steps)}. " if steps else ""
    thinned = "" if found.thinned is None else f" {words.thinning_sentence(found.thinned)}"
    return start + words.sentence(found.rounds[-1].diagnosis) + thinned


def left_sentence(left: Discrepancy, how: Seen) -> str:
    """Size and scale of what is kept without a name."""
    length = f"{how.travel_scale[0] * left.length:.3g}"
    disc = f"{length} {how.travel_scale[1]} of the disc's way"
    way = f"{length} of {how.travel} along the test" if how.bare else disc
    return f"What is left is kept without a name: about {how.error(left.amplitude)}, varying over {way}."


def _stage(found: Stage) -> dict[str, Any]:
    """The run's own values, and what the loop adds."""
    run, status = found.run, found.run.status
    return {
        "run": str(run.path) if run.path else run.name,
        "posterior": status["posterior"],
        "ess_bulk": status["ess_bulk"],
        "r_hat": status["r_hat"],
        "log_evidence": found.log_evidence,
        "log_evidence_sd": found.log_evidence_sd,
        "elpd_loo": found.elpd_loo,
        "loo_se": found.loo_se,
        "coverage_90": found.coverage,
    }
