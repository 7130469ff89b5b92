"""What several tests together say is missing, and in which of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.diagnosis.joint.diagnose import JointDiagnosis, JointMember
from bayesmembrane.diagnosis.thresholds import WORDS
from bayesmembrane.ground.stored import read
from bayesmembrane.report.blocks import Block, Column, Figure, Picture, Table, points
from bayesmembrane.report.canvas import encoded, new_figure, style
from bayesmembrane.report.sections.base import Glance, Section, Subject, of_kind
from bayesmembrane.report.style import FAINT, colour
from bayesmembrane.words.diagnosis import set_title
from bayesmembrane.words.hypothesis import effect_title, material_title
from bayesmembrane.words.joint_diagnosis import sentence
from bayesmembrane.words.language import listed
from bayesmembrane.words.seen import seen

ACROSS = 2  # pictures side by side
SHOWN = 8  # sets of effects


class JointDiagnosisSection(Section):
    """Diagnoses of several tests: probabilities, and the residuals of every test before and after."""

    name = "joint_diagnosis"
    title = "What several tests miss"
    order = 26
    shows = JointDiagnosis

    def reads(self, folder: Path) -> Any | None:
        return read(folder, "joint_diagnosis")

    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        out: list[Block] = []
        for d in of_kind(results, JointDiagnosis):
            out += [*points([sentence(d)]), _sets(d), _tests(d), _residuals(d)]
        return out

    def answer(self, results: Sequence[Any]) -> Sequence[str]:
        return [sentence(d) for d in of_kind(results, JointDiagnosis)]

    def glances(self, results: Sequence[Any]) -> Sequence[Glance]:
        return [
            Glance(
                "joint diagnosis",
                listed(d.labels),
                f"{d.verdict}: {listed([effect_title(n) for n in d.effects]) or 'no effect'}",
            )
            for d in of_kind(results, JointDiagnosis)
        ]

    def subject(self, results: Sequence[Any]) -> Subject | None:
        every = of_kind(results, JointDiagnosis)
        if not every:
            return None
        tests = dict.fromkeys(label for d in every for label in d.labels)
        return Subject(tuple(tests), f"One material in the tests {listed(tests)}.", "curves")


def _named(d: JointDiagnosis) -> str:
    return listed([effect_title(n) for n in d.effects]) or "no effect"


def _sets(d: JointDiagnosis) -> Table:
    """The most probable sets of effects, each with its most probable energy."""
    columns = (
        Column("effects", "effects"),
        Column("probability", "probability", ".3f"),
        Column("energy", "energy"),
        Column("gain", "ln Bayes factor", ".1f"),
        Column("left", "reduced chi-square", ".2f"),
    )
    best: dict[str, JointMember] = {}
    for m in d.ranking:
        best.setdefault(m.name, m)
    rows = [
        (set_title(name), p, material_title(best[name].material), best[name].gain, best[name].reduced_chi2)
        for name, p in d.probabilities.effects.items()
        if name in best and p > WORDS.nearly
    ]
    caption = "Sets of effects, summed over the energies; the factor is over the energy alone, of the best energy."
    return Table("sets of effects of all tests", caption, columns, tuple(rows[:SHOWN]))


def _tests(d: JointDiagnosis) -> Table:
    columns = (
        Column("test", "test"),
        Column("rig", "rig"),
        Column("points", "points", "d"),
        Column("before", "rms residual before"),
        Column("after", "after"),
        Column("chi2_before", "reduced chi-square before", ".3g"),
        Column("chi2_after", "after", ".3g"),
    )
    rows = []
    for t in d.tests:
        how, m = seen(t.measurement), t.measurement
        errors = how.error(t.before.rmse_N), how.error(t.after.rmse_N)
        rows.append((t.label, m.rig.name, len(m), *errors, t.before.reduced_chi2, t.after.reduced_chi2))
    caption = "Every test under the one energy of all, before and after what is probable is added."
    return Table("tests before and after", caption, columns, tuple(rows))


def _residuals(d: JointDiagnosis) -> Figure:
    return Figure(
        residuals_picture(d),
        alt=f"Residuals of {listed(d.labels)}, before and after",
        caption="What the one energy of all tests leaves of each (grey), and the most probable explanation.",
    )


def residuals_picture(d: JointDiagnosis) -> Picture:
    """A small picture for every test: its residuals along the test, before and after."""
    rows = -(-len(d.tests) // ACROSS)
    with style():
        figure = new_figure(3.1 * rows)
        grid = figure.subplots(rows, ACROSS, squeeze=False)
        for ax in grid.ravel()[len(d.tests) :]:
            ax.set_visible(False)
        for ax, t in zip(grid.ravel(), d.tests, strict=False):
            how = seen(t.measurement)
            x = how.along(t.measurement.deflection)
            ax.plot(x, how.left(t.residual_before), ".", color="0.6", markersize=3, label="before")
            ax.plot(x, how.left(t.residual_after), ".", color=colour(d.null), markersize=3, label="after")
            ax.axhline(0.0, color=FAINT, linewidth=0.8)
            ax.set_title(t.label)
            ax.set_xlabel(how.travel_label)
            ax.set_ylabel(f"measured less fitted ({how.small[1]})")
            ax.margins(y=0.1)
            ax.grid(color=FAINT, linewidth=0.6)
            if np.any(t.residual_before != t.residual_after):
                ax.legend(fontsize="small")
        return encoded(figure, "svg")
