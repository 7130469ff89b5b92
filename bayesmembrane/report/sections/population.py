"""A population of specimens: each alone and drawn towards the others, their scatter, and the next one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.calibration.hierarchy.next_curve import NextCurve
from bayesmembrane.calibration.hierarchy.population import Population
from bayesmembrane.ground.stored import read
from bayesmembrane.report.blocks import Block, Column, Figure, Picture, Table, points
from bayesmembrane.report.canvas import Shade, band, encoded, new_figure, style
from bayesmembrane.report.sections.base import Glance, Section, Subject, of_kind
from bayesmembrane.report.style import FAINT, INK, MUTED, RANGE_COLOURS
from bayesmembrane.words.language import listed
from bayesmembrane.words.population import rows, sentences
from bayesmembrane.words.seen import seen_on


class PopulationSection(Section):
    """Mean, scatter, specimens and the next one."""

    name = "population"
    title = "The population of specimens"
    order = 27
    shows = Population

    def reads(self, folder: Path) -> Any | None:
        return read(folder, "population")

    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        out: list[Block] = []
        for found in of_kind(results, Population):
            names = listed(found.specimens.names)
            figure = Figure(
                specimens_picture(found),
                alt=f"Each specimen alone and within the population, and the next one: {names}",
                caption=f"{names}: 90 % intervals of every specimen alone (grey) and within the population (blue), and "
                "of the next specimen (orange).",
            )
            out += [*points(list(sentences(found))), _table(found), figure]
            out += [] if found.next_curve is None else [_next_curve(found.next_curve)]
        return out

    def answer(self, results: Sequence[Any]) -> Sequence[str]:
        return [s for found in of_kind(results, Population) for s in sentences(found)[:1]]

    def glances(self, results: Sequence[Any]) -> Sequence[Glance]:
        return [
            Glance("population", listed(p.specimens.labels), f"{len(p.specimens.names)} coordinates pooled")
            for p in of_kind(results, Population)
        ]

    def subject(self, results: Sequence[Any]) -> Subject | None:
        found = of_kind(results, Population)
        labels = [label for p in found for label in p.specimens.labels]
        return Subject(tuple(dict.fromkeys(labels)), "A population of specimens.", "curves") if found else None


def _table(found: Population) -> Table:
    columns = (
        Column("what", "what"),
        Column("mean", "mean"),
        Column("sd", "sd", ".2g"),
        Column("interval", "94 % interval"),
    )
    caption = "The population: its mean, the standard deviation between specimens, and a specimen not yet tested."
    return Table("population", caption, columns, tuple(rows(found)))


def _next_curve(curve: NextCurve) -> Figure:
    return Figure(
        next_picture(curve),
        alt="The force curve of the next specimen as a band, with the curves of those that were tested",
        caption=f"The next specimen, {1e6 * curve.thickness:.4g} um thick, on the rig {curve.rig.name}: 90 % bands of "
        "its curve (orange) and of a measurement of it (light), and of a middling specimen, known as well as the mean "
        "of the population is (blue). Points: the specimens that were tested, as if all were as thick.",
    )


def next_picture(curve: NextCurve) -> Picture:
    """The bands of the next curve over the tested ones."""
    how, here = seen_on(curve.rig, curve.thickness), np.isfinite(curve.curve[1])
    x = how.along(curve.deflection)
    with style():
        figure = new_figure(4.6)
        ax = figure.subplots()
        band(ax, x, how.carried(curve.reading), here, Shade(RANGE_COLOURS[1], 0.15))
        band(ax, x, how.carried(curve.curve), here, Shade(RANGE_COLOURS[1], 0.35))
        band(ax, x, how.carried(curve.middle), here, Shade(RANGE_COLOURS[0], 0.5))
        ax.plot(x[here], how.carried(curve.curve[1])[here], color=RANGE_COLOURS[1], label="next specimen")
        for label, at, force in curve.tested:
            ax.plot(how.along(at), how.carried(force), ".", markersize=3.5, label=label)
        ax.set_xlabel(how.travel_label)
        ax.set_ylabel(how.load_label)
        ax.set_ylim(bottom=0.0)
        ax.grid(color=FAINT, linewidth=0.6)
        ax.legend(loc="upper left", ncols=2)
        return encoded(figure, "svg")


def specimens_picture(found: Population) -> Picture:
    """One picture for each coordinate, one row for each specimen."""
    s, q = found.specimens, (0.05, 0.5, 0.95)
    height = 1.2 + 0.38 * (len(s.labels) + 1)
    with style():
        figure = new_figure(height * len(s.names))
        for i, ax in enumerate(np.atleast_1d(figure.subplots(len(s.names), 1))):
            for j in range(len(s.labels)):
                alone = s.values[j, i] + 1.645 * np.sqrt(s.covariances[j, i, i]) * np.array([-1.0, 0.0, 1.0])
                for y, values, c in (
                    (j - 0.12, alone, MUTED),
                    (j + 0.12, np.quantile(found.own[:, j, i], q), RANGE_COLOURS[0]),
                ):
                    ax.plot([values[0], values[2]], [y, y], color=c, linewidth=2.2)
                    ax.plot([values[1]], [y], marker="o", color=c, markersize=4.5)
            following = np.quantile(found.following[:, i], q)
            ax.plot([following[0], following[2]], [len(s.labels)] * 2, color=RANGE_COLOURS[1], linewidth=2.2)
            ax.plot([following[1]], [len(s.labels)], marker="D", color=RANGE_COLOURS[1], markersize=5)
            ax.axvline(float(np.median(found.mean[:, i])), color=INK, linewidth=0.8)
            ax.set_yticks(range(len(s.labels) + 1), [*s.labels, "next"])
            ax.invert_yaxis()
            ax.set_xlabel(s.names[i])
            ax.grid(color=FAINT, linewidth=0.6, axis="x")
        return encoded(figure, "svg")
