"""A closed loop: errors before and after, what could explain them, what moved, what could not be seen."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bayesmembrane.diagnosis.loop import Loop
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.ground.stored import read
from bayesmembrane.report.blocks import Block, Figure, Heading, Lead, Part, Text, points
from bayesmembrane.report.runs import Shown
from bayesmembrane.report.sections.base import Glance, Section, Subject, of_kind
from bayesmembrane.report.sections.diagnosis import explanations, finding, limits, place_of, residuals_figure
from bayesmembrane.report.sections.diagnosis.figures import Place, Residual, discrepancy_picture
from bayesmembrane.report.sections.diagnosis.lead import Step, lead
from bayesmembrane.report.sections.loop.others import others
from bayesmembrane.report.sections.loop.tables import errors_table, moved_table, scores_table
from bayesmembrane.report.sections.loop.way import Waypoint, waypoints
from bayesmembrane.words.brief import of_loop
from bayesmembrane.words.diagnosis import set_aside
from bayesmembrane.words.hypothesis import spoken
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
from bayesmembrane.words.seen import seen


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
        loops = loops_of(results)
        return [_part(found, number if len(loops) > 1 else 0) for number, found in enumerate(loops, 1)]

    def answer(self, results: Sequence[Any]) -> Sequence[str]:
        """A paragraph for each round and one for the modulus; one for each loop where there are several, whose first
        screens tell the sizes.
        """
        loops = loops_of(results)
        if len(loops) == 1:
            return [*answer(loops[0]), *moved(loops[0])[:1]]
        return [f"{subject(found)}: {' '.join(of_loop(found, sized=False).lines[1:])}" for found in loops]

    def lead(self, results: Sequence[Any]) -> Lead | None:
        loops = loops_of(results)
        return lead_of(loops[0]) if len(loops) == 1 else None

    def glances(self, results: Sequence[Any]) -> Sequence[Glance]:
        return [Glance("loop", subject(found), finding(deciding(found))) for found in loops_of(results)]

    def subject(self, results: Sequence[Any]) -> Subject | None:
        loops = loops_of(results)
        if not loops or of_kind(results, Shown):
            return None  # the calibrations tell more
        films = dict.fromkeys(found.rounds[0].before.run.measurement.specimen.name for found in loops)
        curves = list(dict.fromkeys(seen(found.rounds[0].diagnosis.measurement).curve for found in loops))
        curve = curves[0] if len(curves) == 1 else "force curve"
        return Subject(tuple(films), f"What was missing: {'; '.join(map(subject, loops))}.", curve)


def loops_of(results: Sequence[Any]) -> list[Loop]:
    """Those of ``results``; of synthetic curves last."""
    return sorted(of_kind(results, Loop), key=lambda f: seen(f.rounds[0].diagnosis.measurement).origin == "synthetic")


def lead_of(found: Loop) -> Lead:
    """Its first screen."""
    return lead(of_loop(found), steps_of(found), found.rounds[-1].diagnosis)


def _part(found: Loop, number: int) -> Part:
    """All of a loop; one of several, with a ``number``, begins with its first screen."""
    end = f" {number}" if number else ""
    first, last = found.rounds[0].diagnosis, found.rounds[-1].diagnosis
    way = waypoints(found)
    where = set_aside(first.validation)
    blocks: list[Block] = [lead_of(found)] if number else []
    blocks += [Text(text) for text in answer(found)]
    blocks += points([*validation_sentences(found), *bound_sentences(found), *moved(found), *rival_sentences(found)])
    blocks.append(residuals_figure(_place(found), residual_rows(way)))
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
    blocks += others(found.others, end)
    blocks += limits(deciding(found), last, (f"loop confounded{end}", f"loop power{end}"))
    return Part(f"loop{end.strip()}", f"What was missing: {subject(found)}", tuple(blocks))


def _place(found: Loop) -> Place:
    """Where the points lie, with their noise as the last diagnosis has it."""
    return place_of(found.rounds[0].diagnosis, found.rounds[-1].diagnosis.noise.each)


def steps_of(found: Loop) -> list[Step]:
    """The model as given, the last one that was added, and of an ambiguous answer the first of the rivals."""
    way = waypoints(found)
    first = way[0]
    if len(way) == 1:
        return [_step("as given", first)]
    added = [_step("after", m) for m in way[1:] if m.added]
    rivals = [_step("if the first", m) for m in way[1:] if not m.added]
    return [_step("before", first), *added[-1:], *rivals[:1]]


def _step(title: str, m: Waypoint) -> Step:
    return Step(title, m.of, m.candidate.residual, m.error, m.held_out)


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
    return f"{word}: {m.title}, root mean square {seen(m.of.measurement).error(m.error.rmse_N)}"


def _left(found: Loop, last: Diagnosis) -> list[Block]:
    if found.left is None:
        return []
    kept = left_sentence(found.left, seen(last.measurement))
    caption = (
        f"{kept} Lines and bands: mean and two standard deviations of the process that is kept "
        "for it along the test; it has no name, and predicts nothing for another test."
    )
    picture = discrepancy_picture(_place(found), last.best.residual, found.left.mean, found.left.sd)
    model = spoken(last.best.hypothesis)
    alt = f"What {model} leaves, with the mean and the band of the process kept for it"
    return [
        Heading("What is left, without a name"),
        Figure(picture, alt, caption),
    ]
