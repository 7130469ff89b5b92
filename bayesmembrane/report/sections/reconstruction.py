"""The reconstruction: the measured curve behind published losses, and printed entries that contradict the rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from bayesmembrane.ground.stored import read
from bayesmembrane.reconstruction.result import Reconstruction
from bayesmembrane.report.blocks import Block, Figure, Heading, Picture, Points, Text, facts_table
from bayesmembrane.report.canvas import Measured, encoded, new_figure, style
from bayesmembrane.report.sections.base import Glance, Section, Subject, of_kind
from bayesmembrane.report.style import ALARM, FAINT, INK, MUTED, RANGE_COLOURS
from bayesmembrane.words.hypothesis import material_title
from bayesmembrane.words.language import listed, millimetres
from bayesmembrane.words.origin import origin, suspect


class ReconstructionSection(Section):
    """The recovered curve, how many points it has, and what it leaves of the printed losses."""

    name = "reconstruction"
    title = "Where the curve comes from"
    order = 80
    shows = Reconstruction
    aside = True

    def reads(self, folder: Path) -> Any | None:
        return read(folder, "reconstruction")

    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        return [b for found in of_kind(results, Reconstruction) for b in _blocks(found)]

    def answer(self, results: Sequence[Any]) -> Sequence[str]:
        return [origin(found) for found in of_kind(results, Reconstruction)]

    def glances(self, results: Sequence[Any]) -> Sequence[Glance]:
        return [
            Glance(
                "reconstruction",
                f"the curve up to {listed(millimetres(r.deflection.max()) for r in found.ranges)}",
                f"{found.force.size} points; printed rows that contradict the rest: {len(found.suspects)}",
            )
            for found in of_kind(results, Reconstruction)
        ]

    def subject(self, results: Sequence[Any]) -> Subject | None:
        found = of_kind(results, Reconstruction)
        names = listed(r.name for f in found for r in f.ranges)
        return Subject((), f"The curve behind published losses, over {names}.") if found else None


def _blocks(found: Reconstruction) -> list[Block]:
    suspects = {(s.material, s.column) for s in found.suspects}
    recovered = [Recovered(r.name, Measured(r.deflection, r.force, r.force_sd), r.n_points) for r in found.ranges]
    bars = [
        LossBar(
            f"{material_title(c.material)} {c.column}",
            c.range,
            c.reconstructed - c.printed,
            (c.material, c.column) in suspects,
        )
        for c in found.losses
    ]
    names = listed(r.name for r in found.ranges)
    blocks: list[Block] = [
        Text(origin(found)),
        Figure(
            reconstruction_picture(recovered, bars),
            alt=f"Reconstructed force curve over {names}, probabilities of the number of points, and loss residuals",
            caption="The measured curve behind the published losses: reconstructed forces (N) and their standard "
            "deviations (mN) against deflection (mm), probability of the number of points, and distance of the "
            "reconstructed curve to each printed loss (mN). Suspect rows are red and hatched.",
        ),
    ]
    if found.suspects:
        blocks += [Heading("Printed entries that contradict the rest"), Points(tuple(map(suspect, found.suspects)))]
    if found.families:
        caption = "What the curve may be, and how probable each is; forces and errors are those of all together."
        kinds = {f.title: f"{f.probability:.3f}" for f in found.families}
        blocks.append(facts_table("reconstruction families", caption, kinds))
    influence = {i.changed: f"{1e3 * float(np.max(np.abs(i.force - found.force))):.3g} mN" for i in found.influence}
    if influence:
        caption = "Largest change of any reconstructed force (mN) when one assumption of the reconstruction is changed."
        blocks.append(facts_table("reconstruction influence", caption, influence))
    return blocks


# ---- the picture -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Recovered:
    """One range of a reconstruction: points with sd, and the probability of each number of points."""

    name: str
    points: Measured
    n_points: Mapping[int, float]


@dataclass(frozen=True)
class LossBar:
    """One printed loss: its label, how far the reconstructed curve is from it (N), and whether the row is suspect."""

    label: str
    range: str
    difference: float
    suspect: bool


def reconstruction_picture(ranges: Sequence[Recovered], losses: Sequence[LossBar], kind: str = "svg") -> Picture:
    """The recovered curve, the number of its points, and what it leaves of the printed losses."""
    names = [r.name for r in ranges]
    labels = list(dict.fromkeys(b.label for b in losses))
    with style():
        lower = max(1.6, 0.5 + 0.23 * len(labels))
        figure = new_figure(4.2 + lower)
        parts: Any = figure.subfigures(2, 1, height_ratios=(4.2, lower))
        top, bottom = parts
        left, right = top.subfigures(1, 2, width_ratios=(1.7, 1))
        _recovered(left.subplots(2, 1, sharex=True, height_ratios=(3, 1)), ranges)
        _counts(right.subplots(), ranges)
        grid = bottom.subplots(1, len(names), sharey=True, squeeze=False)
        for i, name in enumerate(names):
            _loss_bars(grid[0, i], [b for b in losses if b.range == name], labels, name)
        return encoded(figure, kind)


def _recovered(axes: Sequence[Axes], ranges: Sequence[Recovered]) -> None:
    for i, r in enumerate(ranges):
        x, c, mark = 1e3 * r.points.deflection, RANGE_COLOURS[i % 4], "os^D"[i % 4]
        axes[0].plot(x, r.points.force, mark, color=c, markersize=4.5, label=r.name)
        if r.points.sd is not None:
            axes[1].plot(x, 1e3 * r.points.sd, mark, color=c, markersize=4.5)
    axes[0].set_ylabel("force (N)")
    axes[0].set_title("Reconstructed curve")
    axes[0].legend(loc="upper left")
    axes[1].set_ylabel("sd (mN)")
    axes[1].set_xlabel("deflection (mm)")
    axes[1].set_xlim(left=0)
    for ax in axes:
        ax.set_ylim(bottom=0)
        ax.grid(color=FAINT, linewidth=0.6)


def _counts(ax: Axes, ranges: Sequence[Recovered]) -> None:
    likely = sorted({n for r in ranges for n, p in r.n_points.items() if p > 1e-3})
    wide = 0.8 / len(ranges)
    for i, r in enumerate(ranges):
        x = np.arange(len(likely)) + (i - (len(ranges) - 1) / 2) * wide
        ax.bar(x, [r.n_points.get(n, 0.0) for n in likely], wide * 0.92, color=RANGE_COLOURS[i % 4], label=r.name)
    ax.set_xticks(range(len(likely)), [str(n) for n in likely])
    ax.set_ylim(0, 1.08)
    ax.set_xlabel("number of points (-)")
    ax.set_ylabel("probability (-)")
    ax.set_title("How many points")
    ax.legend(loc="best")


def _loss_bars(ax: Axes, bars: Sequence[LossBar], labels: Sequence[str], name: str) -> None:
    at = {label: i for i, label in enumerate(labels)}
    y = [at[b.label] for b in bars]
    value = np.array([1e3 * b.difference for b in bars])
    shades = [ALARM if b.suspect else MUTED for b in bars]
    ax.barh(y, value, 0.7, color=shades, hatch=["////" if b.suspect else "" for b in bars], edgecolor="white", lw=0.5)
    sound = [abs(v) for v, b in zip(value, bars, strict=True) if not b.suspect and np.isfinite(v)]
    reach = 1.35 * max([*sound, 0.5])
    for v, b, k in zip(value, bars, y, strict=True):
        outside = np.isfinite(v) and abs(v) > reach
        if outside or b.suspect:
            side = np.sign(v) or 1.0
            ax.text(
                0.98 * reach * side if outside else v + 0.03 * reach * side, k, f"{v:.3g} mN", va="center",
                fontsize=8.5, ha=("right" if side > 0 else "left") if outside else ("left" if side > 0 else "right"),
                color="white" if outside else ALARM, fontweight="bold",
                bbox={"facecolor": ALARM if outside else "white", "edgecolor": "none", "pad": 1.5},
            )  # fmt: skip
    ax.set_xlim(-reach, reach)
    ax.axvline(0, color=INK, linewidth=0.8)
    ax.set_yticks(range(len(labels)), labels, fontsize=9.5)
    ax.set_ylim(len(labels) - 0.5, -0.5)
    ax.set_xlabel("reconstructed - printed loss (mN)")
    ax.set_title(f"Losses over {name}" + (" (red: suspect)" if any(b.suspect for b in bars) else ""))
    ax.grid(axis="x", color=FAINT, linewidth=0.6)
