"""A diagnosis on its own: what the model misses, what could explain it, and what this measurement cannot tell."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.ground.stored import read
from bayesmembrane.report.blocks import Block, Figure, Heading, Part, Text, points
from bayesmembrane.report.sections.base import Glance, Section, Subject, of_kind
from bayesmembrane.report.sections.diagnosis.figures import Place, Residual, residual_picture
from bayesmembrane.report.sections.diagnosis.tables import (
    before_and_after,
    confounded_table,
    power_table,
    ranking_table,
)
from bayesmembrane.words import diagnosis as words
from bayesmembrane.words.candidates import bounds, rivals, validation_sentence
from bayesmembrane.words.hypothesis import spoken
from bayesmembrane.words.language import sentence


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
        return [words.sentence(d) for d in of_kind(results, Diagnosis)]

    def glances(self, results: Sequence[Any]) -> Sequence[Glance]:
        return [Glance("diagnosis", spoken(d.null.hypothesis), finding(d)) for d in of_kind(results, Diagnosis)]

    def subject(self, results: Sequence[Any]) -> Subject | None:
        names = [spoken(d.null.hypothesis) for d in of_kind(results, Diagnosis)]
        return Subject((), f"A diagnosis of {', '.join(names)}.") if names else None


def finding(d: Diagnosis) -> str:
    """The verdict, and the model that it names."""
    return f"{d.verdict}: {spoken(d.hypothesis)}" if d.explains else d.verdict


def _part(d: Diagnosis, end: str) -> Part:
    told = [*(s for s in [validation_sentence(d)] if s), *bounds(d)]
    blocks: list[Block] = [
        Text(words.sentence(d)),
        *points(told),
        _residuals(d),
        before_and_after(d, f"diagnosis errors{end}"),
    ]
    if d.verdict != "adequate":
        blocks += explanations(d, "What could explain it", f"diagnosis candidates{end}")
    blocks += limits(d, d, ("diagnosis confounded" + end, "diagnosis power" + end))
    return Part(f"diagnosis{end.strip()}", f"What may be missing: {spoken(d.null.hypothesis)}", tuple(blocks))


def _residuals(d: Diagnosis) -> Figure:
    n = d.null.residual.size
    place = Place(None, None, np.ones(n, np.int8), np.ones(n, np.int64), np.zeros(n, np.bool_), d.noise.each)
    rows = [Residual(f"As given: {spoken(d.null.hypothesis)}, rms {1e3 * d.before.rmse_N:.3g} mN", d.null.residual)]
    if d.best is not d.null:
        title = f"The most probable: {spoken(d.best.hypothesis)}, rms {1e3 * d.after.rmse_N:.3g} mN"
        rows.append(Residual(title, d.best.residual))
    return Figure(
        residual_picture(place, rows),
        alt="Residuals " + " and ".join(f"{r.title[0].lower()}{r.title[1:]}" for r in rows),
        caption="Measured less fitted force (mN) in the order of the test (point, -). Grey: what the measurement's own "
        "noise does. The line is the mean of neighbours: where it leaves the middle of the band, something is missing.",
    )


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
    if last.power:
        out.append(power_table(last, names[1]))
    return [Heading("What this measurement cannot tell"), *out] if out else []
