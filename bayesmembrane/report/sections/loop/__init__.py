"""A closed loop: errors before and after, what could explain them, what moved, what could not be seen."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.diagnosis.left.heldout import held_out
from bayesmembrane.diagnosis.loop import Loop
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.ground.stored import read
from bayesmembrane.report.blocks import Block, Figure, Heading, Part, Text, points
from bayesmembrane.report.runs import Shown
from bayesmembrane.report.sections.base import Glance, Section, Subject, of_kind
from bayesmembrane.report.sections.diagnosis import explanations, finding, limits
from bayesmembrane.report.sections.diagnosis.figures import Place, Residual, discrepancy_picture, residual_picture
from bayesmembrane.report.sections.loop.tables import errors_table, moved_table, scores_table
from bayesmembrane.report.sections.loop.way import Waypoint, waypoints
from bayesmembrane.words.diagnosis import set_aside
from bayesmembrane.words.hypothesis import spoken
from bayesmembrane.words.language import listed
from bayesmembrane.words.loop import left_sentence
from bayesmembrane.words.moved import changes
from bayesmembrane.words.rounds import (
    answer,
    bound_sentences,
    deciding,
    moved,
    rival_sentences,
    stages,
    subject,
    validation_sentences,
)


class LoopSection(Section):
    """Every loop under a heading of its own; the page answers with them first."""

    name = "loop"
    title = "What was missing"
    order = 10
    shows = Loop

    def reads(self, folder: Path) -> Any | None:
        return read(folder, "loop")

    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        return [b for p in self.parts(results) for b in (Heading(p.title), *p.blocks)]

    def parts(self, results: Sequence[Any]) -> Sequence[Part]:
        loops = of_kind(results, Loop)
        return [_part(found, number if len(loops) > 1 else 0) for number, found in enumerate(loops, 1)]

    def answer(self, results: Sequence[Any]) -> Sequence[str]:
        """A paragraph for each round and one for the modulus; one for each loop where there are several."""
        loops = of_kind(results, Loop)
        if len(loops) == 1:
            return [*answer(loops[0]), *moved(loops[0])[:1]]
        return [f"{subject(found)}: {' '.join(answer(found))}" for found in loops]

    def glances(self, results: Sequence[Any]) -> Sequence[Glance]:
        return [Glance("loop", subject(found), finding(deciding(found))) for found in of_kind(results, Loop)]

    def subject(self, results: Sequence[Any]) -> Subject | None:
        loops = of_kind(results, Loop)
        if not loops or of_kind(results, Shown):
            return None  # the calibrations tell more
        films = dict.fromkeys(found.rounds[0].before.run.measurement.specimen.name for found in loops)
        return Subject(tuple(films), f"What was missing: {'; '.join(map(subject, loops))}.")


def _part(found: Loop, number: int) -> Part:
    end = f" {number}" if number else ""
    first, last = found.rounds[0].diagnosis, found.rounds[-1].diagnosis
    way = waypoints(found)
    where = set_aside(first.validation)
    blocks: list[Block] = [Text(text) for text in answer(found)]
    blocks += points([*validation_sentences(found), *bound_sentences(found), *moved(found), *rival_sentences(found)])
    blocks.append(_residuals(found, way))
    blocks += [errors_table(way, where, f"loop errors{end}"), scores_table(way, f"loop scores{end}")]
    blocks += _left(found, last)
    before, after = stages(found)
    if any(r.changed for r in found.rounds):
        blocks.append(Heading("How the parameters moved"))
        blocks.append(moved_table(changes(before.run, after.run), f"loop parameters{end}"))
    rounds = [r.diagnosis for r in found.rounds if r.diagnosis.verdict != "adequate"]
    for i, d in enumerate(rounds, 1):
        of, which = (f", round {i}", f" round {i}") if len(rounds) > 1 else ("", "")
        blocks += explanations(d, f"What could explain it{of}", f"loop candidates{end}{which}")
    blocks += limits(deciding(found), last, (f"loop confounded{end}", f"loop power{end}"))
    return Part(f"loop{end.strip()}", f"What was missing: {subject(found)}", tuple(blocks))


def place_of(found: Loop) -> Place:
    """Where the points lie, which were set aside, and their noise as the last diagnosis has it."""
    m, d = found.rounds[0].before.run.measurement, found.rounds[-1].diagnosis
    mask = held_out(m) if d.validation is not None else np.zeros(len(m), dtype=bool)
    return Place(m.deflection, m.time, m.leg, m.cycle, mask, d.noise.each)


def residual_rows(way: Sequence[Waypoint]) -> list[Residual]:
    """The model as given above, the last one that was added below; the leading rival if none was."""
    first = way[0]
    rows = [Residual(_row_title("Before", first), first.candidate.residual)] if len(way) > 1 else []
    if not rows:
        return [Residual(_row_title("As given", first), first.candidate.residual)]
    added = [m for m in way[1:] if m.added]
    last = added[-1] if added else way[1]
    word = "After" if added else "The first rival, not added"
    return [*rows, Residual(_row_title(word, last), last.candidate.residual)]


def _row_title(word: str, m: Waypoint) -> str:
    return f"{word}: {m.title}, rms {1e3 * m.error.rmse_N:.3g} mN"


def _residuals(found: Loop, way: Sequence[Waypoint]) -> Figure:
    place, rows = place_of(found), residual_rows(way)
    against = ["deflection", place.along[1].partition(" ")[0]]
    against += ["by cycle"] if np.unique(place.cycle).size > 1 else []
    order = "; the model as given above, the one with what was found below" if len(rows) > 1 else ""
    caption = (
        f"Measured less fitted force (mN) against {listed(against)}{order}. Grey: what the measurement's own noise "
        "does. The lines are means of neighbours: where they leave the middle of the band, or loading and unloading "
        "part, something is missing. All points were fitted here; the hollow ones are those set aside for the held-out "
        "errors of the table."
    )
    alt = "Residuals " + " and ".join(f"{r.title[0].lower()}{r.title[1:]}" for r in rows)
    return Figure(residual_picture(place, rows), alt, caption)


def _left(found: Loop, last: Diagnosis) -> list[Block]:
    if found.left is None:
        return []
    caption = (
        f"{left_sentence(found.left)} Lines and bands: mean and two standard deviations of the process that is kept "
        "for it along the way of the disc; it has no name, and predicts nothing for another test."
    )
    picture = discrepancy_picture(place_of(found), last.null.residual, found.left.mean, found.left.sd)
    model = spoken(last.null.hypothesis)
    alt = f"What {model} leaves, with the mean and the band of the process kept for it"
    return [
        Heading("What is left, without a name"),
        Figure(picture, alt, caption),
    ]
