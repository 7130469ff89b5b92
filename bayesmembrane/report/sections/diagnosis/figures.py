"""Pictures of residuals: before and after, and what is left without a name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from bayesmembrane.ground.parameters import Array
from bayesmembrane.report.blocks import Picture
from bayesmembrane.report.canvas import encoded, new_figure, style
from bayesmembrane.report.style import FAINT, INK, MUTED, RANGE_COLOURS
from bayesmembrane.words.seen import Seen

LEGS = ((1, "loading", RANGE_COLOURS[0], "o"), (-1, "unloading", RANGE_COLOURS[1], "v"))
PARTS = 24  # means that make a line against deflection or time
ENLARGED = 6.0  # how much smaller what is left must be before it gets an axis of its own
BAND = "#c9ced4"
LONGEST = 92  # letters of a title that fit into a line


@dataclass(frozen=True, eq=False)
class Residual:
    """One row of the picture: what a model leaves, (N,) N measured less fitted, under its ``title``."""

    title: str
    residual: Array


@dataclass(frozen=True, eq=False)
class Place:
    """Where the N points lie, and how much noise they have.

    deflection : (N,) m
    time : (N,) s or None
    leg, cycle : (N,) +1 loading, -1 unloading; number of the cycle
    held_out : (N,) True where a point was set aside
    sd : (N,) N, the measurement's own noise
    how : in which quantities and units people read it
    path : False where each point is a state by itself: there are no legs and no cycles
    """

    deflection: Array
    time: Array | None
    leg: NDArray[np.int8]
    cycle: NDArray[np.int64]
    held_out: NDArray[np.bool_]
    sd: Array
    how: Seen
    path: bool = True

    @property
    def along(self) -> tuple[Array, str]:
        """Time, or the number of the point where there are no times, with the label of its axis."""
        if self.time is None:
            return np.arange(1.0, self.sd.size + 1), "number of the point (-)"
        return self.time, "time (s)"


def residual_picture(place: Place, rows: Sequence[Residual], kind: str = "png") -> Picture:
    """A row for each model, the first one above: against deflection or stretch, along the test, and by cycle.

    All rows have one scale, unless the last one would vanish in it; then its title says how much it is enlarged.
    """
    tops = [1.06 * max(float(np.max(np.abs(r.residual))), 2.5 * float(np.median(place.sd))) for r in rows]
    enlarged = len(rows) > 1 and tops[0] > ENLARGED * tops[-1]
    with style():
        figure = new_figure(0.7 + 2.9 * len(rows))
        # A figure for each row: a title as long as the row is wide must not push its panels apart.
        parts = figure.subfigures(len(rows), 1, squeeze=False)[:, 0]
        panels = []
        for i, (part, row) in enumerate(zip(parts, rows, strict=True)):
            panels.append(_row(part, place, row.residual, place.how.small[0] * (tops[i] if enlarged else max(tops))))
            more = f" (axis enlarged {tops[0] / tops[i]:.2g} times)" if enlarged and i else ""
            part.suptitle(fill(row.title + more, LONGEST), x=0.01, ha="left", fontsize=11.5, fontweight="bold")
        cycles = [p["cycle (-)"] for p in panels if "cycle (-)" in p]
        for ax in cycles if not enlarged else ():
            ax.set_ylim(0, max(c.get_ylim()[1] for c in cycles))
        for name, ax in panels[-1].items():
            ax.set_xlabel(name)
        figure.legend(
            handles=_handles(place), loc="outside upper center", ncols=6, handletextpad=0.4, columnspacing=1.3
        )
        return encoded(figure, kind)


def _row(part: Any, place: Place, residual: Array, top: float) -> dict[str, Axes]:
    """The panels of one model by the name of their horizontal axis, up to ``top`` in the units shown."""
    names = [place.how.travel_label, place.along[1]]
    if np.unique(place.cycle).size > 1:
        names.append("cycle (-)")
    ratios = [2.2 if name == "cycle (-)" else 4.0 for name in names]
    panels = dict(zip(names, part.subplots(1, len(names), width_ratios=ratios, squeeze=False)[0], strict=True))
    for i, (name, ax) in enumerate(panels.items()):
        if name == "cycle (-)":
            _by_cycle(ax, place, residual)
            continue
        if name == place.how.travel_label:
            _against_deflection(ax, place, residual)
        else:
            _along(ax, place, residual)
        ax.set_ylim(-top, top)
        ax.tick_params(labelleft=i == 0)
        if i == 0:
            ax.set_ylabel(place.how.left_label)
    return panels


def discrepancy_picture(place: Place, residual: Array, mean: Array, sd: Array, kind: str = "png") -> Picture:
    """What is left (N,) N with the mean and two standard deviations of the process kept for it, both (N,) N."""
    with style():
        figure = new_figure(3.6)
        axes = figure.subplots(1, 2, sharey=True)
        at, label = place.along
        shade = 0.25 if len(_legs(place.leg)) <= 3 else 0.12
        for ax, x, name in ((axes[0], place.how.along(place.deflection), place.how.travel_label), (axes[1], at, label)):
            _noise(ax, x, place)
            for sign, _, colour, symbol in LEGS:
                own = place.leg == sign
                ax.plot(
                    x[own], place.how.left(residual)[own], symbol, color=colour, markersize=2.2, alpha=0.35, zorder=2
                )
            for part in _legs(place.leg):
                colour = LEGS[0 if place.leg[part[0]] > 0 else 1][2]
                low, high = (place.how.left(mean + s * sd)[part] for s in (-2, 2))
                ax.fill_between(x[part], low, high, color=colour, alpha=shade, linewidth=0, zorder=3)
                ax.plot(x[part], place.how.left(mean)[part], color=colour, linewidth=1.6, zorder=4)
            ax.axhline(0, color=MUTED, linewidth=0.8, zorder=1)
            ax.set_xlabel(name)
        axes[0].set_ylabel(place.how.left_label)
        legs = [s for s in LEGS if np.any(place.leg == s[0])]
        handles: list[Line2D | Patch] = [
            Line2D([], [], color=c, label=f"kept without a name, {name}") for _, name, c, _ in legs
        ]
        handles.append(Patch(color=BAND, label="noise, 2 sd"))
        figure.legend(handles=handles, loc="outside upper center", ncols=3)
        return encoded(figure, kind)


# ---- panels ----------------------------------------------------------------------------------------------------------


def _against_deflection(ax: Axes, place: Place, residual: Array) -> None:
    x = place.how.along(place.deflection)
    _noise(ax, x, place)
    _points(ax, x, place, residual)
    for sign, _, colour, _ in LEGS:
        own = place.leg == sign
        if np.count_nonzero(own) >= PARTS:
            _mean_line(ax, x[own], place.how.left(residual)[own], colour)


def _along(ax: Axes, place: Place, residual: Array) -> None:
    x = place.along[0]
    _noise(ax, x, place)
    _points(ax, x, place, residual)
    if x.size >= PARTS:
        _mean_line(ax, x, place.how.left(residual), INK)


def _by_cycle(ax: Axes, place: Place, residual: Array) -> None:
    """Root mean square of each cycle, loading and unloading apart, beside that of the noise."""
    cycles = np.unique(place.cycle)
    for sign, _, colour, symbol in LEGS:
        for c in cycles:
            own = (place.cycle == c) & (place.leg == sign)
            if not np.any(own):
                continue
            size = place.how.small[0] * float(np.sqrt(np.mean(residual[own] ** 2)))
            face = "white" if np.all(place.held_out[own]) else colour
            x = c - 0.14 * sign
            ax.plot([x, x], [0, size], color=colour, linewidth=1.2, zorder=2)
            ax.plot([x], [size], symbol, color=colour, markerfacecolor=face, markersize=6, zorder=3)
    noise = place.how.small[0] * float(np.sqrt(np.mean(place.sd**2)))
    ax.axhspan(0, noise, color=BAND, alpha=0.6, linewidth=0, zorder=0)
    ax.set_ylabel(f"root mean square ({place.how.small[1]})")
    ax.set_xticks(cycles[:: max(1, cycles.size // 6)])
    ax.set_xlim(cycles[0] - 0.6, cycles[-1] + 0.6)
    ax.set_ylim(0, 1.1 * max(ax.get_ylim()[1], 1.1 * noise))


def _points(ax: Axes, x: Array, place: Place, residual: Array) -> None:
    size = 4.0 if residual.size < 120 else 2.6
    for sign, _, colour, symbol in LEGS:
        for held in (False, True):
            own = (place.leg == sign) & (place.held_out == held)
            face = "white" if held else colour
            ax.plot(
                *(x[own], place.how.left(residual)[own], symbol),
                color=colour,
                markerfacecolor=face,
                markeredgewidth=0.7,
                markersize=size + held,
                alpha=0.9 if held else 0.55,
                zorder=2,
            )
    ax.axhline(0, color=MUTED, linewidth=0.8, zorder=1)
    ax.grid(axis="y", color=FAINT, linewidth=0.5)


def _mean_line(ax: Axes, x: Array, residual: Array, colour: str) -> None:
    """Means of neighbours along x: what the eye should follow through the noise."""
    order = np.argsort(x, kind="stable")
    parts = np.array_split(order, min(PARTS, x.size // 2))
    at, value = zip(*((x[p].mean(), residual[p].mean()) for p in parts), strict=True)
    ax.plot(at, value, color="white", linewidth=4.0, zorder=4)
    ax.plot(at, value, color=colour, linewidth=2.0, zorder=5)


def _noise(ax: Axes, x: Array, place: Place) -> None:
    sd = place.how.left(place.sd)
    order = np.argsort(x, kind="stable")
    ax.fill_between(x[order], -2 * sd[order], 2 * sd[order], color=BAND, alpha=0.6, linewidth=0, zorder=0)


def _legs(leg: NDArray[np.int8]) -> list[NDArray[np.intp]]:
    """Indices of each leg of the path."""
    return np.split(np.arange(leg.size), np.flatnonzero(np.diff(leg.astype(int))) + 1)


def _handles(place: Place) -> list[Line2D | Patch]:
    handles: list[Line2D | Patch] = []
    for sign, name, colour, symbol in LEGS:
        if np.any(place.leg == sign):
            label = name if place.path else place.how.origin
            handles.append(Line2D([], [], color=colour, marker=symbol, linewidth=0, markersize=5, label=label))
    if np.any(place.held_out):
        hollow = Line2D([], [], color=MUTED, marker="o", linewidth=0, markersize=6, markerfacecolor="white")
        hollow.set_label("held out")
        handles.append(hollow)
    if place.leg.size >= PARTS:
        handles.append(Line2D([], [], color=INK, linewidth=2.0, label="mean of neighbours"))
    cyclic = " (by cycle: 1 sd)" if np.unique(place.cycle).size > 1 else ""
    return [*handles, Patch(color=BAND, label=f"noise, 2 sd{cyclic}")]
