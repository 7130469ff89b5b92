"""The first screen of a diagnosis or a loop: its sentences, one small table, one picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.left.heldout import Misfit
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.ground.parameters import Array
from bayesmembrane.report.blocks import PLAIN, Column, Figure, Lead, Picture, Table
from bayesmembrane.report.canvas import encoded, new_figure, style
from bayesmembrane.report.style import FAINT, INK, MUTED, RANGE_COLOURS
from bayesmembrane.words.brief import Brief
from bayesmembrane.words.diagnosis import set_aside
from bayesmembrane.words.hypothesis import spoken
from bayesmembrane.words.seen import Seen, seen

WIDTH = 5.6  # inches: half of a page
PARTS = 24  # means that make a line of one leg, at most
EACH, FEWEST = 4, 3  # points of such a mean, and means of a leg, at least
FEW = 100  # readings that are drawn one by one
NOISE = "#c9ced4"


@dataclass(frozen=True, eq=False)
class Step:
    """A model before or after, its ``title`` in table and legend; (N,) N residual of the readings of a diagnosis."""

    title: str
    of: Diagnosis
    residual: Array
    error: Misfit
    held_out: Misfit | None

    @property
    def measurement(self) -> Measurement:
        return self.of.measurement


def lead(brief: Brief, steps: Sequence[Step], last: Diagnosis) -> Lead:
    """The first screen; one step where nothing was found, else the first and the last. Noise is as ``last`` has it."""
    return Lead(brief, errors(steps, last), _figure(steps, last))


def errors(steps: Sequence[Step], last: Diagnosis) -> Table:
    """Root mean squares before and after, in sample and held out, and of noise alone."""
    factor, unit = seen(last.measurement).small
    v = steps[0].of.validation
    held = "held out (too few points)" if v is None else f"held out: {set_aside(v)}"
    columns = (
        Column("model", f"root mean square ({unit})"),
        Column("in_sample", "in sample", PLAIN),
        Column("held_out", held, PLAIN),
    )
    rows = [
        (s.title, factor * s.error.rmse_N, None if s.held_out is None else factor * s.held_out.rmse_N) for s in steps
    ]
    noise = ("noise", factor * last.noise.sd, None)
    return Table("first screen", "", columns, (*rows, noise))


def _figure(steps: Sequence[Step], last: Diagnosis) -> Figure:
    how = seen(last.measurement)
    below = f"below: {how.origin} less fitted ({how.small[1]})"
    caption = f"{how.load.capitalize()} ({how.load_scale[1]}) over {how.travel} ({how.travel_scale[1]}); {below}."
    shown = " and ".join(spoken(c.hypothesis) for c in dict.fromkeys((steps[0].of.null, steps[-1].of.best)))
    alt = f"The {how.curve} with the curves of {shown}, and what they leave, against {how.travel}"
    return Figure(lead_picture(steps, last), alt, caption)


def lead_picture(steps: Sequence[Step], last: Diagnosis, kind: str = "png") -> Picture:
    """The curve above, what the models leave of it below; loops are drawn as loops, before and after in two colours."""
    how = seen(last.measurement)
    with style():
        figure = new_figure(5.4, WIDTH)
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1.5, 1.0))
        m = steps[0].measurement
        above.plot(
            how.along(m.deflection), how.carried(m.force), "o", color=INK, markersize=3.0 if len(m) <= 120 else 1.8,
            alpha=0.7, zorder=2,
        )  # fmt: skip
        _noise(below, last, how)
        for step, colour in zip(steps, RANGE_COLOURS, strict=False):
            fitted = how.carried(step.measurement.force - step.residual)
            x = how.along(step.measurement.deflection)
            _path(above, (x, fitted), step.measurement, colour)
            _path(below, _averaged(x, how.left(step.residual), step.measurement), step.measurement, colour)
        below.axhline(0, color=MUTED, linewidth=0.8, zorder=1)
        above.set_ylabel(how.load_label)
        below.set_ylabel(how.left_label)
        below.set_xlabel(how.travel_label)
        for ax in (above, below):
            ax.grid(color=FAINT, linewidth=0.5)
        figure.legend(
            handles=handles(steps, how), loc="outside upper center", ncols=4, handletextpad=0.5, columnspacing=1.2
        )
        return encoded(figure, kind)


def _path(ax: Axes, line: tuple[Array, Array], m: Measurement, colour: str) -> None:
    """In the order of the test; states that are no stations of one path stay points."""
    if m.rig.has_path:
        ax.plot(*line, color=colour, linewidth=1.5, alpha=0.9, zorder=3)
    else:
        ax.plot(*line, "o", color=colour, markersize=3.0, alpha=0.8, zorder=3)


def _averaged(x: Array, y: Array, m: Measurement) -> tuple[Array, Array]:
    """Means of neighbours along each leg, in the order of the test: a loop that is seen through the noise."""
    if not m.rig.has_path or x.size <= FEW:
        return x, y
    parts: list[NDArray[np.intp]] = []
    for leg in np.split(np.arange(x.size), np.flatnonzero(np.diff(m.leg.astype(int))) + 1):
        parts += np.array_split(leg, min(max(FEWEST, min(PARTS, leg.size // EACH)), leg.size))
    return np.array([x[p].mean() for p in parts]), np.array([y[p].mean() for p in parts])


def _noise(ax: Axes, last: Diagnosis, how: Seen) -> None:
    m, sd = last.measurement, 2 * how.left(last.noise.each)
    order = np.argsort(m.deflection, kind="stable")
    x = how.along(m.deflection)[order]
    ax.fill_between(x, -sd[order], sd[order], color=NOISE, alpha=0.6, linewidth=0, zorder=0)


def handles(steps: Sequence[Step], how: Seen) -> list[Line2D | Patch]:
    """The legend: how the points came about, the models, noise."""
    points = Line2D([], [], color=INK, marker="o", linestyle="none", markersize=4, label=how.origin)
    lines = [Line2D([], [], color=c, label=s.title) for s, c in zip(steps, RANGE_COLOURS, strict=False)]
    return [points, *lines, Patch(color=NOISE, label="noise, 2 sd")]


def steps_of(d: Diagnosis) -> list[Step]:
    """The model as given and, where something was found, the most probable one."""
    v = d.validation
    first = Step("before", d, d.null.residual, d.before, v.before if v else None)
    if d.best is d.null:
        return [replace(first, title="as given")]
    title = "after" if d.explains else "if the first"
    return [first, Step(title, d, d.best.residual, d.after, v.after if v else None)]
