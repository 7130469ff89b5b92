"""A closed loop in a report: errors before and after, what could explain them, what moved, what could not be seen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bayesmembrane.diagnosis.left.heldout import held_out
from bayesmembrane.diagnosis.loop import Loop
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.diagnosis.thresholds import NEXT_TEST
from bayesmembrane.report.blocks import Block, Section
from bayesmembrane.report.sections.loop.figures import Place, Residual, discrepancy_picture, residual_picture
from bayesmembrane.report.sections.loop.reading import (
    Change,
    Model,
    changes,
    deciding,
    models,
    modulus_of,
    spoken_hypothesis,
    stages,
)
from bayesmembrane.report.sections.loop.tables import (
    candidate_title,
    confounded_table,
    errors_table,
    moved_table,
    power_table,
    ranking_table,
    scores_table,
    sizes,
)
from bayesmembrane.report.sentences import listed
from bayesmembrane.report.style import spoken
from bayesmembrane.report.tables import Table
from bayesmembrane.words.diagnosis import absorbed_sentences, experiment_sentence, sentence, set_aside
from bayesmembrane.words.loop import left_sentence

MATTERS = 1.0  # standard deviations: a smaller change of a parameter is none
SAME = 1e-3


def loop_sections(loops: Sequence[Loop]) -> list[Section]:
    """A section for each loop."""
    return [_section(found, number if len(loops) > 1 else 0) for number, found in enumerate(loops, 1)]


def loop_answers(loops: Sequence[Loop]) -> list[str]:
    """What to read first of each loop, a paragraph for each round and one for the modulus; named where several are."""
    if len(loops) == 1:
        return [*answer(loops[0]), *moved_sentences(loops[0])[:1]]
    return [f"{_subject(found)}: {' '.join(answer(found))}" for found in loops]


def answer(found: Loop) -> list[str]:
    """What was found and added, with the size, and how it ended."""
    told = [sentence(r.diagnosis) for r in found.rounds]
    told = [told[0], *(f"With that: {s}" for s in told[1:])]
    last = found.rounds[-1]
    if last.changed:
        told.append(
            f"The loop stops after {len(found.rounds)} round{'s' if len(found.rounds) > 1 else ''}: whether "
            f"{spoken_hypothesis(last.after.run.hypothesis)} is adequate has not been asked."
        )
    return told


def _subject(found: Loop) -> str:
    m = found.rounds[0].before.run.measurement
    end = 1e3 * float(np.max(m.deflection))
    return f"{m.specimen.name}, {spoken_hypothesis(found.rounds[0].diagnosis.null.hypothesis)} up to {end:.4g} mm"


def _section(found: Loop, number: int) -> Section:
    end = f" {number}" if number else ""
    first, last = found.rounds[0].diagnosis, found.rounds[-1].diagnosis
    way = models(found)
    where = set_aside(first.validation)
    blocks = [Block("text", text) for text in answer(found)]
    told = [*validation_sentences(found), *bound_sentences(found), *moved_sentences(found), *rival_sentences(found)]
    blocks += [Block("list", lines=tuple(told))] if told else []
    blocks.append(_residuals(found, way))
    blocks += [_table(errors_table(way, where, f"loop errors{end}")), _table(scores_table(way, f"loop scores{end}"))]
    blocks += _left(found, last)
    before, after = stages(found)
    if any(r.changed for r in found.rounds):
        blocks.append(Block("heading", "How the parameters moved"))
        blocks.append(_table(moved_table(changes(before.run, after.run), f"loop parameters{end}")))
    blocks += _explanations(found, end)
    blocks += _limits(found, end)
    return Section(f"loop{end.strip()}", f"What was missing: {_subject(found)}", tuple(blocks))


# ---- sentences -------------------------------------------------------------------------------------------------------


def validation_sentences(found: Loop) -> list[str]:
    """Which points were set aside, and whether the others choose the same model."""
    told = []
    for r in found.rounds:
        d = r.diagnosis
        if d.validation is None or d.verdict in ("adequate", "unknown"):
            continue
        v, best = d.validation, d.best.hypothesis.label()
        labels = {c.hypothesis.label(): spoken_hypothesis(c.hypothesis) for c in (j.candidate for j in d.ranking)}
        same = (
            f"the others choose the same model, {labels.get(v.chosen, v.chosen)}"
            if v.chosen == best
            else f"the others choose {labels.get(v.chosen, v.chosen)} instead: the choice rests on the points left out"
        )
        fall = f"their root mean square goes from {1e3 * v.before.rmse_N:.3g} to {1e3 * v.after.rmse_N:.3g} mN"
        told.append(f"Set aside before looking: {set_aside(v)}. Without these points {same}; {fall}.")
    if not told and found.rounds[-1].diagnosis.validation is None:
        told.append("No points were set aside: there are too few.")
    return told


def bound_sentences(found: Loop) -> list[str]:
    """Estimates at a bound, of the models on the way and of all that an answer rests on."""
    told = []
    for r in found.rounds:
        d = r.diagnosis
        for c in [d.null, *(j.candidate for j in d.members)]:
            if c.at_bound:
                names = listed(spoken(n) for n in c.at_bound)
                told.append(
                    f"{spoken_hypothesis(c.hypothesis)}: the estimate of {names} lies at its bound. Take it as a "
                    "limit, not as a value."
                )
    return list(dict.fromkeys(told))


def moved_sentences(found: Loop) -> list[str]:
    """How the material moved, and why that matters."""
    before, after = stages(found)
    if not any(r.changed for r in found.rounds):
        return []
    every = [c for c in changes(before.run, after.run) if c.material or c.name == "shear modulus"]
    modulus, rest = every[0], every[1:]
    told = [modulus_sentence(modulus, spoken_hypothesis(after.run.hypothesis))]
    # What only scales with the modulus says nothing new.
    known = [c for c in rest if abs(c.in_sd) > MATTERS and abs(c.share - modulus.share) > SAME]
    if known:
        names = listed(
            f"{spoken(c.name)} by {100 * c.share:+.2g} % ({c.in_sd:+.1f} sd)"
            for c in sorted(known, key=lambda c: -abs(c.in_sd))
        )
        told.append(
            f"The shape of the curve moves too: {names}. Every prediction made with the first calibration, of another "
            "test or beyond this range, carries what it imitated."
        )
    return told


def rival_sentences(found: Loop) -> list[str]:
    """What the modulus is under each explanation of an ambiguous answer: whether the choice matters for the film."""
    last = found.rounds[-1]
    if not last.leaders:
        return []
    every = [(spoken_hypothesis(s.run.hypothesis), modulus_of(s.run)) for s in (last.before, *last.leaders)]
    values = "; ".join(f"{mean:.4g} +- {sd:.2g} MPa in {name}" for name, (mean, sd) in every)
    means, sds = np.array([m for _, m in every[1:]]).T
    apart = float(np.ptp(means))
    matters = apart > float(np.max(sds))
    end = "Which of them is right decides the modulus." if matters else "Which of them is right matters little for it."
    return [f"The shear modulus is {values}. {end}"]


def modulus_sentence(c: Change, model: str) -> str:
    """What the change of the modulus means to a user."""
    start = f"In {model} the shear modulus is {c.after[0]:.4g} +- {c.after[1]:.2g} MPa instead of {c.before[0]:.4g}"
    if abs(c.in_sd) <= MATTERS:
        return (
            f"{start}: {100 * c.share:+.2g} %, within the {c.before[1]:.2g} MPa that were stated before. The modulus "
            "of the first calibration could be used."
        )
    return (
        f"{start}: {100 * c.share:+.2g} %, {abs(c.in_sd):.1f} of the standard deviations that were stated before. The "
        "first calibration had bent the material to imitate what it lacked, and was surer of it than it should have "
        "been."
    )


# ---- blocks ----------------------------------------------------------------------------------------------------------


def place_of(found: Loop) -> Place:
    """Where the points lie, which were set aside, and their noise as the last diagnosis has it."""
    m, d = found.rounds[0].before.run.measurement, found.rounds[-1].diagnosis
    mask = held_out(m) if d.validation is not None else np.zeros(len(m), dtype=bool)
    return Place(m.deflection, m.time, m.leg, m.cycle, mask, d.noise.each)


def residual_rows(way: Sequence[Model]) -> list[Residual]:
    """The model as given above, the last one that was added below; the leading rival if none was."""
    first = way[0]
    rows = [Residual(_row_title("Before", first), first.candidate.residual)] if len(way) > 1 else []
    if not rows:
        return [Residual(_row_title("As given", first), first.candidate.residual)]
    added = [m for m in way[1:] if m.added]
    last = added[-1] if added else way[1]
    word = "After" if added else "The first rival, not added"
    return [*rows, Residual(_row_title(word, last), last.candidate.residual)]


def _row_title(word: str, m: Model) -> str:
    return f"{word}: {m.title}, rms {1e3 * m.error.rmse_N:.3g} mN"


def _residuals(found: Loop, way: Sequence[Model]) -> Block:
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
    return Block("figure", picture=residual_picture(place, rows), alt=alt, caption=caption)


def _left(found: Loop, last: Diagnosis) -> list[Block]:
    if found.left is None:
        return []
    caption = (
        f"{left_sentence(found.left)} Lines and bands: mean and two standard deviations of the process that is kept "
        "for it along the way of the disc; it has no name, and predicts nothing for another test."
    )
    picture = discrepancy_picture(place_of(found), last.null.residual, found.left.mean, found.left.sd)
    model = spoken_hypothesis(last.null.hypothesis)
    alt = f"What {model} leaves, with the mean and the band of the process kept for it"
    return [
        Block("heading", "What is left, without a name"),
        Block("figure", picture=picture, alt=alt, caption=caption),
    ]


def _explanations(found: Loop, end: str) -> list[Block]:
    out = []
    rounds = [r.diagnosis for r in found.rounds if r.diagnosis.verdict != "adequate"]
    for number, d in enumerate(rounds, 1):
        of = f", round {number}" if len(rounds) > 1 else ""
        out.append(Block("heading", f"What could explain it{of}"))
        if d.verdict == "ambiguous":
            out.append(Block("list", lines=tuple(_rivals(d))))
        out.append(_table(ranking_table(d, f"loop candidates{end}{f' round {number}' if of else ''}")))
    return out


def _rivals(d: Diagnosis) -> list[str]:
    """The ambiguous set, and what to measure to tell its members apart."""
    best = max(j.log_evidence for j in d.members)
    told = []
    for j in d.members:
        behind = best - j.log_evidence
        words = "the most probable" if behind == 0 else f"{behind:.1f} behind in ln of the evidence"
        size = ", ".join(sizes(j.candidate, d.null))
        told.append(f"{candidate_title(j.candidate, d.null)}{f' ({size})' if size else ''}: {words}.")
    clear = [e for e in d.experiments if e.separation >= NEXT_TEST.clear]
    rest = [
        f"{e.what} ({e.separation:.1f} standard deviations)" for e in d.experiments if e.separation < NEXT_TEST.clear
    ]
    told += [f"To tell them apart: {experiment_sentence(e)}." for e in clear]
    if not clear:
        told.append("None of the further tests that were simulated would tell them apart.")
    if rest:
        told.append(f"What would not settle it: {listed(rest)}.")
    return told


def _limits(found: Loop, end: str) -> list[Block]:
    d, last = deciding(found), found.rounds[-1].diagnosis
    out = [Block("heading", "What this measurement cannot tell")]
    if d.confounded:
        out.append(_table(confounded_table(d, f"loop confounded{end}")))
    if d.absorbed:
        lines = tuple(f"{s[0].upper()}{s[1:].rstrip('.')}." for s in absorbed_sentences(d))
        out += [Block("text", "The material absorbs without trace, so that no residual shows it:")]
        out.append(Block("list", lines=lines))
    if last.power:
        out.append(_table(power_table(last, f"loop power{end}")))
    return out if len(out) > 1 else []


def _table(table: Table) -> Block:
    return Block("table", table=table)
