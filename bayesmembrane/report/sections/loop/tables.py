"""The tables of a closed loop: errors and scores of every model on the way, and how the parameters moved."""

from __future__ import annotations

from collections.abc import Sequence

from bayesmembrane.ground.registry import components
from bayesmembrane.report.blocks import Column, Table
from bayesmembrane.report.sections.diagnosis.tables import error_cells, error_columns, errors_caption
from bayesmembrane.report.sections.loop.way import Waypoint
from bayesmembrane.words.hypothesis import effect_title
from bayesmembrane.words.language import spoken_parameter
from bayesmembrane.words.moved import Change
from bayesmembrane.words.noises import noise_title
from bayesmembrane.words.seen import seen


def errors_table(found: Sequence[Waypoint], where: str, name: str) -> Table:
    """Errors of every model on the way, in sample and on points that were set aside."""
    how = seen(found[0].of.measurement)
    rows = tuple((_labelled(m), *error_cells(m.error, how), *error_cells(m.held_out, how), m.covered) for m in found)
    return Table(name, errors_caption(where), error_columns(how), rows)


def _labelled(model: Waypoint) -> str:
    return model.title if model.added else f"{model.title} (not added)"


def scores_table(found: Sequence[Waypoint], name: str) -> Table:
    """Evidence, prediction of left-out points and coverage of the models that were sampled."""
    columns = (
        Column("model", "model"),
        Column("noise", "noise model"),
        Column("log_evidence", "ln Z", ".2f"),
        Column("log_evidence_sd", "+-", ".2f"),
        Column("elpd_loo", "elpd, leave one out", ".1f"),
        Column("loo_se", "+-", ".1f"),
        Column("coverage_90", "inside the 90 % band", "%"),
    )
    rows = tuple(
        (
            _labelled(m),
            noise_title(s.run.hypothesis.noise.name),
            s.log_evidence,
            s.log_evidence_sd,
            s.elpd_loo,
            s.loo_se,
            s.coverage,
        )
        for m in found
        if (s := m.stage) is not None
    )
    points = len(found[0].of.measurement)
    caption = (
        f"From the posteriors of {points} readings: evidence by the weights of their proposals or by "
        "bridge sampling, expected log predictive density of points left out one by one (with its standard error), and "
        "the part of the measured points that the 90 % predictive band holds. The band contains the noise that a model "
        "infers, so that it can cover what it does not explain."
    )
    return Table(name, caption, columns, rows)


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
        Column("remark", "remark"),
    )
    rows = tuple((_parameter(c), c.unit, *c.before, *c.after, 100 * c.share, c.in_sd, c.remark or None) for c in found)
    caption = (
        "Posterior mean and standard deviation in the first and in the last calibration. A change of many standard "
        "deviations says that the first one was sure of a wrong value."
    )
    return Table(name, caption, columns, rows).without_empty()


def _parameter(c: Change) -> str:
    block = c.name.partition(".")[0]
    return (
        f"{effect_title(block)}: {spoken_parameter(c.name)}"
        if block in components("effects")
        else spoken_parameter(c.name)
    )
