"""Break points: forces at which other specimens broke, predicted by thickness alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from bayesmembrane.ground.parameters import Array
from bayesmembrane.report.blocks import Block, Column, Figure, Picture, Points, Table, Value
from bayesmembrane.report.canvas import Interval, draw_interval, encoded, legend_columns, new_figure, style
from bayesmembrane.report.runs import Shown, by_points
from bayesmembrane.report.sections.base import Section, of_kind
from bayesmembrane.report.style import FAINT, INK, SHADE, colour, marker
from bayesmembrane.words.calibration import break_points
from bayesmembrane.words.language import percent, without_exponent


class BreakPointsSection(Section):
    """A picture and a table for each set of fitted points whose runs predict break points."""

    name = "break-points"
    title = "Break points: a prediction for other specimens"
    order = 60

    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        broken = [s for s in of_kind(results, Shown) if s.digest.specimens]
        return [b for group in by_points(broken) for b in _blocks(group)]


def _blocks(group: Sequence[Shown]) -> list[Block]:
    d, end = group[0].digest, group[0].end
    names = [
        f"{n}: {1e6 * t:.0f} um, {1e3 * x:.0f} mm"
        for n, t, x in zip(d.specimens, d.break_thickness, d.break_at, strict=True)
    ]
    rows = [
        [Interval(s.name, s.look, s.digest.break_predicted[:, i], "no force") for s in group] for i in range(len(names))
    ]
    figure = Figure(
        break_picture(names, d.break_force, rows),
        alt=f"Forces at the break points of {len(names)} specimens, observed and predicted from fits up to {end}",
        caption=f"Force (N) at the deflections at which {len(names)} specimens broke: observed, and predicted by films "
        f"fitted up to {end}, scaled with the thickness (median, 90 % interval). The specimens had been cycled before "
        "they broke, and the fitted curve is a first loading.",
    )
    told = [
        break_points(s.name, d.end, d.break_force.tolist(), *(s.digest.break_predicted[i].tolist() for i in (0, 2)))
        for s in group
    ]
    return [figure, Points(tuple(told)), break_table(group)]


def break_table(shown: Sequence[Shown]) -> Table:
    """Forces at which specimens broke, and the predictions."""
    first = shown[0].digest
    columns = (
        Column("specimen", "specimen"),
        Column("thickness_um", "thickness (um)", ".0f"),
        Column("deflection_mm", "deflection (mm)", ".0f"),
        Column("observed_N", "observed (N)", ".3g"),
        *(Column(f"{s.key}_N", f"{s.name}, {1e3 * s.digest.end:.3g} mm (N)") for s in shown),
    )
    rows: tuple[tuple[Value, ...], ...] = tuple(
        (
            name,
            1e6 * float(first.break_thickness[i]),
            1e3 * float(first.break_at[i]),
            float(first.break_force[i]),
            *(_interval(s.digest.break_predicted[:, i], float(s.digest.break_lost[i])) for s in shown),
        )
        for i, name in enumerate(first.specimens)
    )
    caption = (
        "Break points, forces in N: observed, and predicted from the fitted film by thickness alone (median, 90 % "
        "interval, and the share of the draws that have no force there)."
    )
    return Table(f"break_points {1e3 * first.end:.4g}mm", caption, columns, rows)


def _interval(q: Array, lost: float) -> str:
    gone = f"; {percent(lost)} none" if lost >= 0.005 else ""
    if not np.all(np.isfinite(q)):
        return f"no force ({percent(lost)} of the draws)"
    low, middle, high = (without_exponent(f"{v:.3g}") for v in q)
    return f"{middle} ({low} to {high}){gone}"


# ---- the picture -----------------------------------------------------------------------------------------------------


def break_picture(
    specimens: Sequence[str], observed: Array, predicted: Sequence[Sequence[Interval]], kind: str = "svg"
) -> Picture:
    """Forces (S,) N at which specimens broke, and the predictions of each material for each of them."""
    n = max((len(p) for p in predicted), default=1)
    with style():
        figure = new_figure(1.4 + 0.19 * (n + 1.5) * len(specimens))
        ax = figure.subplots()
        _log_force_axis(ax, observed, predicted)
        low, high = ax.get_xlim()
        for s in range(len(specimens)):
            if s % 2:
                ax.axhspan(s - 0.5, s + 0.5, color=SHADE, zorder=0, lw=0)
            ax.plot([observed[s]] * 2, [s - 0.42, s + 0.42], color=INK, linewidth=2.2, zorder=4)
            for k, interval in enumerate(predicted[s]):
                y = s - 0.34 + 0.68 * (k + 0.5) / n
                _predicted(ax, interval, y, (low, high))
        ax.set_yticks(range(len(specimens)), specimens)
        ax.set_ylim(len(specimens) - 0.5, -0.5)
        ax.set_xlabel("force (N), logarithmic")
        ax.grid(axis="x", which="both", color=FAINT, linewidth=0.5)
        named = {i.label: i.look for row in predicted for i in row}
        handles = [Line2D([], [], color=INK, linewidth=2.2, label="observed")]
        handles += [
            Line2D([], [], color=colour(look), marker=marker(look), markersize=5, label=name)
            for name, look in named.items()
        ]
        columns = legend_columns(list(named), 6)
        figure.legend(handles=handles, loc="outside upper center", ncols=columns, columnspacing=1.2, handlelength=1.6)
        return encoded(figure, kind)


def _log_force_axis(ax: Axes, observed: Array, predicted: Sequence[Sequence[Interval]]) -> None:
    """A logarithmic axis from a third to four times what was observed, and to the predictions within that decade."""
    values = np.concatenate([observed, *(i.quantiles for row in predicted for i in row)])
    values = values[np.isfinite(values) & (values > 0)]
    low = max(float(values.min()), float(observed.min()) / 8)
    high = min(float(values.max()), float(observed.max()) * 8)
    ax.set_xscale("log")
    ax.set_xlim(low / 1.15, high * 1.3)
    ax.xaxis.set_major_locator(LogLocator(10, subs=(1.0, 2.0, 5.0)))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())


def _predicted(ax: Axes, interval: Interval, y: float, limits: tuple[float, float]) -> None:
    low, high = limits
    c, q = colour(interval.look), interval.quantiles
    if not np.any(np.isfinite(q)):
        ax.text(high / 1.03, y, interval.note or "no force", color=c, fontsize=9, va="center", ha="right")
        return
    if q[1] > high or q[1] < low:
        out = f"{q[1]:,.0f} N \u2192" if q[1] > high else f"\u2190 {q[1]:.2g} N"
        edge = high / 1.03 if q[1] > high else low * 1.03
        ax.text(edge, y, out, color=c, fontsize=9, va="center", ha="right" if q[1] > high else "left")
        return
    draw_interval(ax, interval, y, 5.5)
