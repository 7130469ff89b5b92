"""The tables of a closed loop."""

from __future__ import annotations

import math
from collections.abc import Sequence

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.left.heldout import Misfit
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.diagnosis.thresholds import EXPLANATION
from bayesmembrane.ground.registry import components
from bayesmembrane.report.sections.loop.reading import Change, Model, effect_title, spoken_hypothesis
from bayesmembrane.report.style import spoken
from bayesmembrane.report.tables import Column, Table, Value
from bayesmembrane.words.diagnosis import size_in_words

MOST_CANDIDATES = 20


def errors_table(found: Sequence[Model], where: str, name: str) -> Table:
    """Errors of every model on the way, in sample and on points that were set aside."""
    columns = (
        Column("model", "model"),
        Column("rmse_mN", "root mean square (mN)", ".3g"),
        Column("max_mN", "largest (mN)", ".3g"),
        Column("reduced_chi2", "reduced chi-square", ".3f"),
        Column("heldout_rmse_mN", "held out: root mean square (mN)", ".3g"),
        Column("heldout_max_mN", "held out: largest (mN)", ".3g"),
        Column("heldout_reduced_chi2", "held out: reduced chi-square", ".3f"),
        Column("heldout_coverage_90", "held out: inside the 90 % band", "%"),
    )
    rows = tuple((_labelled(m), *_error(m.error), *_error(m.held_out), m.covered) for m in found)
    caption = (
        "Residuals before and after, by the measurement's own noise (a reduced chi-square of 1 is noise alone). Held "
        f"out: {where}; predicted by the model fitted to the other points."
    )
    return Table(name, caption, columns, rows)


def _error(error: Misfit | None) -> tuple[Value, ...]:
    return (None, None, None) if error is None else (1e3 * error.rmse_N, 1e3 * error.max_N, error.reduced_chi2)


def _labelled(model: Model) -> str:
    return model.title if model.added else f"{model.title} (not added)"


def scores_table(found: Sequence[Model], name: str) -> Table:
    """Evidence, prediction of left-out points and coverage of the models that were sampled."""
    columns = (
        Column("model", "model"),
        Column("log_evidence", "ln Z", ".2f"),
        Column("log_evidence_sd", "+-", ".2f"),
        Column("elpd_loo", "elpd, leave one out", ".1f"),
        Column("loo_se", "+-", ".1f"),
        Column("coverage_90", "inside the 90 % band", "%"),
    )
    rows = tuple(
        (_labelled(m), s.log_evidence, s.log_evidence_sd, s.elpd_loo, s.loo_se, s.coverage)
        for m in found
        if (s := m.stage) is not None
    )
    caption = (
        "From the posteriors: evidence by bridge sampling, expected log predictive density of points left out one by "
        "one (with its standard error), and the part of the measured points that the 90 % predictive band holds. The "
        "band contains the noise that a model infers, so that it can cover what it does not explain."
    )
    return Table(name, caption, columns, rows)


def ranking_table(d: Diagnosis, name: str) -> Table:
    """Every candidate that was refitted, the most probable first."""
    columns = (
        Column("candidate", "candidate"),
        Column("size", "size"),
        Column("log_bayes_factor", "ln Bayes factor", "+.1f"),
        Column("unexplained", "unexplained", "%"),
        Column("explains", "explains it"),
        Column("at_bound", "at a bound"),
        Column("in_answer", "in the answer"),
    )
    members = {j.candidate.label for j in d.members} if d.verdict != "unknown" else set()
    rows = []
    for j in d.ranking[:MOST_CANDIDATES]:
        c = j.candidate
        rows.append(
            (
                candidate_title(c, d.null),
                ", ".join(sizes(c, d.null)) or "-",
                j.log_evidence - d.null.log_evidence,
                j.unexplained,
                j.explains,
                ", ".join(spoken(n) for n in c.at_bound) or "-",
                c.label in members,
            )
        )
    caption = (
        f"What could explain the residual of {spoken_hypothesis(d.null.hypothesis)}: each candidate was refitted with "
        "the material. ln Bayes factor: against the model as it was (Laplace approximation). Unexplained: part of the "
        "lack of fit that is left; a candidate explains the curve if that is noise, or at most "
        f"{100 * EXPLANATION.unexplained:g} %."
    )
    if len(d.ranking) > MOST_CANDIDATES:
        caption += f" The {MOST_CANDIDATES} most probable of {len(d.ranking)}."
    return Table(name, caption, columns, tuple(rows))


def candidate_title(candidate: Candidate, null: Candidate) -> str:
    """What a candidate adds to the model as it was."""
    have = {e.name for e in null.hypothesis.effects}
    added = [e.title for e in candidate.hypothesis.effects if e.name not in have]
    if candidate.hypothesis.material is not null.hypothesis.material:
        added.append(f"the energy {candidate.hypothesis.material.title}")
    return " and ".join(added) or "nothing: the model as it was"


def sizes(candidate: Candidate, null: Candidate) -> list[str]:
    """``slip 0.0021``: sizes of the effects that a candidate adds, in the units that people read."""
    have = {e.name for e in null.hypothesis.effects}
    values = candidate.parameters
    added = [e for e in candidate.hypothesis.effects if e.name not in have]
    return [
        f"{spoken(f'{e.name}.{e.size.name}')} {size_in_words(values[f'{e.name}.{e.size.name}'], e.size.unit)}"
        for e in added
    ]


def moved_table(found: Sequence[Change], name: str) -> Table:
    """Parameters before and after."""
    columns = (
        Column("parameter", "parameter"),
        Column("unit", "unit"),
        Column("before", "before", ".4g"),
        Column("before_sd", "sd", ".2g"),
        Column("after", "after", ".4g"),
        Column("after_sd", "sd", ".2g"),
        Column("change", "change (%)", "+.3g"),
        Column("in_sd", "change (sd before)", "+.2g"),
    )
    rows = tuple((_parameter(c), c.unit, *c.before, *c.after, 100 * c.share, c.in_sd) for c in found)
    caption = (
        "Posterior mean and standard deviation in the first and in the last calibration. A change of many standard "
        "deviations says that the first one was sure of a wrong value."
    )
    return Table(name, caption, columns, rows)


def _parameter(c: Change) -> str:
    block = c.name.partition(".")[0]
    return f"{effect_title(block)}: {spoken(c.name)}" if block in components("effects") else spoken(c.name)


def confounded_table(d: Diagnosis, name: str) -> Table:
    """Pairs of effects whose traces are nearly the same on this protocol."""
    columns = (
        Column("effect", "effect"),
        Column("other", "and"),
        Column("degrees", "degrees between their traces", ".1f"),
    )
    rows = tuple((effect_title(a), effect_title(b), v) for a, b, v in d.confounded)
    caption = (
        "Effects that this measurement hardly tells apart, whichever is at work: angle between what they leave in the "
        "residual after the material has absorbed its part (0: the same, 90: nothing in common)."
    )
    return Table(name, caption, columns, rows)


def power_table(d: Diagnosis, name: str) -> Table:
    """The smallest size of each effect that would have shown, the easiest to see first."""
    columns = (
        Column("effect", "effect"),
        Column("parameter", "size"),
        Column("smallest", "smallest that shows"),
        Column("usual", "usual"),
        Column("ratio", "smallest over usual", ".2g"),
    )
    known = components("effects")
    rows = []
    for effect, smallest in d.power.items():
        size = known[effect]().size
        if math.isfinite(smallest):
            words = (size_in_words(v, size.unit) for v in (smallest, size.scale))
            rows.append((effect_title(effect), spoken(f"{effect}.{size.name}"), *words, smallest / size.scale))
    rows.sort(key=lambda r: float(r[-1]))
    caption = (
        f"What this measurement could have shown beside {spoken_hypothesis(d.null.hypothesis)}: the smallest effect "
        "that the tests would have found nine times out of ten, beside what is usual before the data. An effect whose "
        "ratio is above 1 could be there, of usual size, and not be seen."
    )
    return Table(name, caption, columns, tuple(rows))
