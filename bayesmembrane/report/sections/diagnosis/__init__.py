"""A diagnosis on its own: what the model misses, what could explain it, and what this measurement cannot tell."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.diagnosis.left.heldout import held_out
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.stored import read
from bayesmembrane.report.blocks import Block, Figure, Heading, Lead, Part, Text, points
from bayesmembrane.report.sections.base import Glance, Section, Subject, of_kind
from bayesmembrane.report.sections.diagnosis.figures import PARTS, Place, Residual, residual_picture
from bayesmembrane.report.sections.diagnosis.lead import lead, steps_of
from bayesmembrane.report.sections.diagnosis.tables import (
    before_and_after,
    confounded_table,
    power_table,
    ranking_table,
)
from bayesmembrane.words import diagnosis as words
from bayesmembrane.words.brief import of_diagnosis
from bayesmembrane.words.candidates import bounds, rivals, validation_sentence
from bayesmembrane.words.hypothesis import spoken
from bayesmembrane.words.language import listed, sentence
from bayesmembrane.words.seen import seen


class DiagnosisSection(Section):
    """Every diagnosis under a heading of its own; those of a closed loop are in the loop's part."""

    name = "diagnosis"
    title = "What may be missing"
    order = 15
    shows = Diagnosis

    def reads(self, folder: Path) -> Any | None:
        return read(folder, "diagnosis")

    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        return [b for p in self.parts(results) for b in (Heading(p.title), *p.blocks)]

    def parts(self, results: Sequence[Any]) -> Sequence[Part]:
        found = of_kind(results, Diagnosis)
        several = len(found) > 1
        return [_part(d, f" {number}" if several else "") for number, d in enumerate(found, 1)]

    def answer(self, results: Sequence[Any]) -> Sequence[str]:
        found = of_kind(results, Diagnosis)
        if len(found) == 1:
            return [words.sentence(found[0])]
        return [f"{film_and_model(d)}: {words.sentence(d)}" for d in found]

    def lead(self, results: Sequence[Any]) -> Lead | None:
        found = of_kind(results, Diagnosis)
        return lead_of(found[0]) if len(found) == 1 else None

    def glances(self, results: Sequence[Any]) -> Sequence[Glance]:
        return [Glance("diagnosis", film_and_model(d), finding(d)) for d in of_kind(results, Diagnosis)]

    def subject(self, results: Sequence[Any]) -> Subject | None:
        found = of_kind(results, Diagnosis)
        if not found:
            return None
        names = "; ".join(map(film_and_model, found)) if len(found) > 1 else _model(found[0])
        curves = list(dict.fromkeys(seen(d.measurement).curve for d in found))
        films = tuple(dict.fromkeys(d.measurement.specimen.name for d in found))
        return Subject(films, f"A diagnosis of {names}.", curves[0] if len(curves) == 1 else "force curve")


def film_and_model(d: Diagnosis) -> str:
    """The film and the model that were asked about."""
    return f"{d.measurement.specimen.name}, {_model(d)}"


def _model(d: Diagnosis) -> str:
    return spoken(d.null.hypothesis) if d.declared else "no energy declared"


def finding(d: Diagnosis) -> str:
    """The verdict, and the model that it names."""
    return f"{d.verdict}: {spoken(d.hypothesis)}" if d.explains else d.verdict


def lead_of(d: Diagnosis) -> Lead:
    """Its first screen."""
    return lead(of_diagnosis(d), steps_of(d), d)


def _part(d: Diagnosis, end: str) -> Part:
    """All of a diagnosis; one of several, with an ``end`` to its names, begins with its first screen."""
    told = [*(s for s in [validation_sentence(d)] if s), *bounds(d)]
    blocks: list[Block] = [
        *([lead_of(d)] if end else []),
        Text(words.finding_sentence(d)),
        *points(told),
        _residuals(d),
        before_and_after(d, f"diagnosis errors{end}"),
    ]
    if d.verdict != "adequate":
        blocks += explanations(d, "What could explain it", f"diagnosis candidates{end}")
    blocks += limits(d, d, ("diagnosis confounded" + end, "diagnosis power" + end))
    return Part(
        f"diagnosis{end.strip()}", f"What may be missing: {film_and_model(d) if end else _model(d)}", tuple(blocks)
    )


def place_of(d: Diagnosis, sd: Array | None = None) -> Place:
    """Where the points lie, which were set aside, and their noise."""
    m = d.measurement
    mask = held_out(m) if d.validation is not None else np.zeros(len(m), dtype=bool)
    leg, cycle = m.leg, m.cycle
    if not m.rig.has_path:  # states have no legs and no cycles
        leg, cycle = np.ones_like(leg), np.ones_like(cycle)
    return Place(m.deflection, m.time, leg, cycle, mask, d.noise.each if sd is None else sd, seen(m), m.rig.has_path)


def _residuals(d: Diagnosis) -> Figure:
    how = seen(d.measurement)
    rows = [
        Residual(
            f"As given: {spoken(d.null.hypothesis)}, root mean square {how.error(d.before.rmse_N)}", d.null.residual
        )
    ]
    if d.best is not d.null:
        title = f"The most probable: {spoken(d.best.hypothesis)}, root mean square {how.error(d.after.rmse_N)}"
        rows.append(Residual(title, d.best.residual))
    return residuals_figure(place_of(d), rows)


def residuals_figure(place: Place, rows: Sequence[Residual]) -> Figure:
    """What models leave, the first one above."""
    how = place.how
    against = [how.travel, place.along[1].rpartition(" (")[0]]
    against += ["by cycle"] if np.unique(place.cycle).size > 1 else []
    order = "; the model as given above, the one with what was found below" if len(rows) > 1 else ""
    hollow = ""
    if np.any(place.held_out):
        hollow = " All points were fitted here; the hollow ones are those held out for the errors of the table."
    lines = ""
    if place.leg.size >= PARTS:
        parted = ", or loading and unloading part" if np.any(place.leg < 0) else ""
        lines = f" The lines are means of neighbours: where they leave the middle of the band{parted}, something is "
        lines += "missing."
    caption = (
        f"{how.origin.capitalize()} less fitted {how.load} ({how.small[1]}) against {listed(against)}{order}. Grey: "
        f"what noise does.{lines}{hollow}"
    )
    alt = "Residuals " + " and ".join(f"{r.title[0].lower()}{r.title[1:]}" for r in rows)
    return Figure(residual_picture(place, rows), alt, caption)


def explanations(d: Diagnosis, heading: str, name: str) -> list[Block]:
    """The candidates, and what would tell those of an ambiguous answer apart; ``name`` is that of the table."""
    told = rivals(d) if d.verdict == "ambiguous" else []
    return [Heading(heading), *points(told), ranking_table(d, name)]


def limits(d: Diagnosis, last: Diagnosis, names: tuple[str, str]) -> list[Block]:
    """What the measurement cannot tell: of what was found in ``d``, and of the model that was diagnosed ``last``.

    names : of the tables of effects that look alike, and of effects that would have shown
    """
    out: list[Block] = []
    if d.confounded:
        out.append(confounded_table(d, names[0]))
    if d.absorbed:
        out.append(Text("The material absorbs without trace, so that no residual shows it:"))
        out += points([sentence(s) for s in words.absorbed_sentences(d)])
    if d.unsought:
        out.append(Text(words.unsought_sentence(d)))
    if last.power:
        out.append(power_table(last, names[1]))
    return [Heading("What this measurement cannot tell"), *out] if out else []
