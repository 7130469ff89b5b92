"""The picture of a comparison: evidence and prediction of every hypothesis, relative to the best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter

from bayesmembrane.comparison.evidence.estimate import BRIDGE, NESTED
from bayesmembrane.comparison.result import Comparison, Row
from bayesmembrane.report.blocks import Picture
from bayesmembrane.report.canvas import encoded, new_figure, style
from bayesmembrane.report.style import FAINT, INK, MUTED, SHADE, colour
from bayesmembrane.words.comparison import called

_FILLED = {NESTED: False, BRIDGE: True}
LINEAR = 3.0  # differences up to here are drawn to scale, larger ones by their logarithm


def comparison_picture(found: Mapping[str, Comparison], kind: str = "svg") -> Picture:
    """A row of panels for each range: ln Z and elpd of each hypothesis minus those of the best.

    To the left lies what the data support less. Whiskers are two standard errors; those of the elpd are of the
    difference, from its terms point by point.
    """
    names = list(found)
    most = max(len(c.rows) for c in found.values())
    with style():
        figure = new_figure(0.9 + len(names) * (0.75 + 0.3 * most))
        axes = figure.subplots(len(names), 2, squeeze=False, sharey="row")
        for i, name in enumerate(names):
            rows = found[name].rows
            _evidence(axes[i, 0], rows, found[name].agreed)
            _prediction(axes[i, 1], rows)
            axes[i, 0].set_title(f"Fitted {name}" if name.startswith("up to") else name)
            axes[i, 0].set_yticks(range(len(rows)), [called(r) for r in rows])
            axes[i, 0].set_ylim(len(rows) - 0.5, -0.5)
        axes[-1, 0].set_xlabel("ln Z minus that of the best (-)")
        axes[-1, 1].set_xlabel("elpd minus that of the best (-)")
        handles = [
            Line2D([], [], color=INK, marker="o", linewidth=1.2, markerfacecolor="white", label="nested sampling"),
            Line2D([], [], color=INK, marker="o", linewidth=1.2, label="bridge sampling"),
            Line2D([], [], color=INK, marker="s", linewidth=1.2, label="leave one out"),
        ]
        figure.legend(handles=handles, loc="outside upper center", ncols=3)
        return encoded(figure, kind)


def _evidence(ax: Axes, rows: Sequence[Row], agreed: bool) -> None:
    best = max((r.evidence.best[0] for r in rows if r.evidence is not None), default=0.0)
    least = 0.0
    for y, row in enumerate(rows):
        if row.evidence is None:
            _missing(ax, y)
            continue
        for name, shift in ((NESTED, -0.14), (BRIDGE, 0.14)):
            value, sd = row.evidence.log_evidence[name] - best, row.evidence.log_evidence_sd[name]
            least = min(least, value)
            _point(ax, value, sd, y + shift, (colour(row.hypothesis.label()), "o", _FILLED[name]))
    _finished(ax, len(rows), least)
    if not agreed:
        ax.text(0.02, 0.04, "no ranking: the estimators disagree", transform=ax.transAxes, color=MUTED, fontsize=9)


def _prediction(ax: Axes, rows: Sequence[Row]) -> None:
    best = max((r.loo for r in rows if r.loo is not None), key=lambda loo: loo.elpd, default=None)
    least = 0.0
    for y, row in enumerate(rows):
        if row.loo is None or best is None:
            _missing(ax, y)
            continue
        d = row.loo.pointwise - best.pointwise
        value, se = float(np.sum(d)), float(np.sqrt(d.size * np.var(d)))
        least = min(least, value)
        _point(ax, value, se, y, (colour(row.hypothesis.label()), "s", True))
    _finished(ax, len(rows), least)


def _point(ax: Axes, value: float, sd: float, y: float, kind: tuple[str, str, bool]) -> None:
    """A value with two standard errors; ``kind`` : colour, marker, whether it is filled."""
    c, symbol, filled = kind
    ax.plot([value - 2 * sd, value + 2 * sd], [y, y], color=c, linewidth=1.8, solid_capstyle="butt", zorder=3)
    ax.plot([value], [y], symbol, color=c, markersize=6, markerfacecolor=c if filled else "white", zorder=4)


def _missing(ax: Axes, y: float) -> None:
    ax.text(0.98, y, "not fitted", color=MUTED, fontsize=9, va="center", ha="right", transform=ax.get_yaxis_transform())


def _finished(ax: Axes, count: int, least: float) -> None:
    for y in range(0, count, 2):
        ax.axhspan(y - 0.5, y + 0.5, color=SHADE, zorder=0, lw=0)
    ax.axvline(0.0, color=MUTED, linewidth=0.8, zorder=1)
    ax.set_xscale("symlog", linthresh=LINEAR, linscale=1.0)
    ticks = [-t for t in (1000, 300, 100, 30, 10, 3, 1) if t <= 1.5 * abs(least) or t <= LINEAR]
    ax.set_xticks([*ticks, 0, 1])
    ax.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}".replace("-", "\u2212")))
    ax.minorticks_off()
    ax.grid(axis="x", color=FAINT, linewidth=0.5)
    ax.set_xlim(min(1.6 * least, -1.5), 1.5)
    ax.tick_params(axis="y", length=0)
