"""The curves: measured points, medians and 90 % bands of every material, extrapolation, and the residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullFormatter
from numpy.typing import NDArray

from bayesmembrane.ground.parameters import Array
from bayesmembrane.report.blocks import Block, Figure, Picture, points
from bayesmembrane.report.canvas import Measured, Shade, band, encoded, errorbars, legend_columns, new_figure, style
from bayesmembrane.report.runs import Shown, by_points, reach
from bayesmembrane.report.sections.base import Section, of_kind
from bayesmembrane.report.style import FAINT, INK, MUTED, SHADE, colour, linestyle, marker
from bayesmembrane.words.calibration import held_out
from bayesmembrane.words.language import listed
from bayesmembrane.words.seen import Seen


class CurvesSection(Section):
    """A picture for each set of fitted points, and what the curves say of points that were not used."""

    name = "curves"
    title = "Curves and residuals"
    order = 30

    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        shown = of_kind(results, Shown)
        return [b for group in by_points(shown) for b in _blocks(group, reach(group[0], shown))]


def _blocks(group: Sequence[Shown], end: str) -> list[Block]:
    names, how, path = listed(s.name for s in group), group[0].how, group[0].film.rig.has_path
    drawn = (
        f"median curves and 90 % bands of {names}. Beyond the fitted range curves are dashed and bands hatched: there "
        "only the form of the energy and the priors speak"
        if path
        else f"medians of {names} at each state"
    )
    sd = "; the grey band is two standard deviations of the stated noise" if group[0].digest.has_noise else ""
    figure = Figure(
        first_look([look_of(group, end)]),
        alt=f"{how.origin.capitalize()} {how.load} against {how.travel} up to {end} with the curves of {names}, and "
        "their residuals",
        caption=f"{how.load.capitalize()} ({how.load_scale[1]}) against {how.travel_label}, fitted up to {end}: "
        f"{drawn}. Below: {how.origin} minus median {how.load} ({how.load_scale[1]}){sd}. "
        "The vertical axis of the residuals is logarithmic away from zero where it has to be.",
    )
    return [figure, *points([held_out(s.name, s.digest.rest_residual, s.how) for s in group if s.digest.rest_at.size])]


def look_of(group: Sequence[Shown], end: str) -> Panel:
    """The picture of runs that were fitted to the same points."""
    d = group[0].digest
    rest = None
    if d.rest_at.size:
        rest = Measured(d.rest_at, d.rest_force, d.rest_sd if np.all(np.isfinite(d.rest_sd)) else None, group[0].how)
    curves = tuple(
        Fitted(
            s.look, s.digest.deflection, s.digest.curve, s.digest.beyond, s.digest.residual, s.name, s.film.rig.has_path
        )
        for s in group
    )
    return Panel(group[0].points, curves, rest, f"Fitted up to {end}")


# ---- the picture -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Fitted:
    """What one model says: 5, 50 and 95 % of the force (3, G) N at ``deflection`` (G,) m, and the residuals.

    ``beyond`` (G,) is True where the deflection lies outside the fitted range; ``residual`` (3, N) N is measured minus
    computed force at the measured points. Without a ``path`` each point is a state by itself.
    """

    look: str
    deflection: Array
    force: Array
    beyond: NDArray[np.bool_]
    residual: Array
    label: str
    path: bool = True


@dataclass(frozen=True)
class Panel:
    """One set of points with the curves fitted to it; ``rest`` are points that were not used."""

    points: Measured
    curves: tuple[Fitted, ...]
    rest: Measured | None = None
    heading: str = ""


def first_look(looks: Sequence[Panel], kind: str = "svg") -> Picture:
    """The measured curve, the materials' medians and 90 % bands, extrapolation dashed; the residuals beneath."""
    with style():
        figure = new_figure(6.4)
        grid = figure.subplots(2, len(looks), sharex="col", squeeze=False, height_ratios=(2.3, 1))
        for i, look in enumerate(looks):
            _look(grid[0, i], look, first=i == 0)
            _look_residuals(grid[1, i], look, first=i == 0)
        if len(looks) > 1:
            _same_limits([grid[0, i] for i in range(len(looks))])
        handles = _look_legend(looks)
        columns = legend_columns([str(h.get_label()) for h in handles], 4)
        figure.legend(handles=handles, loc="outside upper center", ncols=columns, columnspacing=1.4, handlelength=2.4)
        return encoded(figure, kind)


def _look(ax: Axes, look: Panel, first: bool) -> None:
    how = look.points.how
    end = _at(how, float(np.max(look.points.deflection)))
    for curve in look.curves:
        _curve(ax, curve, look.points)
    last = max([end, *(_at(how, float(c.deflection[-1])) for c in look.curves if c.path)])
    lowest, top = _reach(look, last)
    if last > end * (1 + 1e-6):
        ax.axvspan(end, last, color=SHADE, zorder=0)
        narrow = last - end < 0.3 * last
        ax.text(
            last * 0.995 if narrow else end + 0.015 * last,
            top - 0.015 * (top - lowest),
            "extrapolation",
            color=MUTED,
            ha="right" if narrow else "left",
            va="top",
            rotation=90 if narrow else 0,
            fontsize=9.5,
            style="italic",
        )
    errorbars(ax, look.points, filled=True)
    if look.rest is not None and look.rest.deflection.size:
        errorbars(ax, look.rest, filled=False)
    ax.set_ylim(lowest - 0.02 * top, top)
    ax.set_xlim(min(how.rest, float(np.min(how.along(look.points.deflection)))), last if last > end else None)
    ax.set_title(look.heading)
    ax.grid(color=FAINT, linewidth=0.6)
    if first:
        ax.set_ylabel(how.load_label)


def _reach(look: Panel, last: float) -> tuple[float, float]:
    """The vertical axis: all points up to ``last`` on the other axis, with a margin."""
    parts = [look.points] + ([look.rest] if look.rest is not None else [])
    how = look.points.how
    seen = np.concatenate([how.carried(p.force[how.along(p.deflection) <= last * (1 + 1e-9)]) for p in parts])
    return min(0.0, 1.12 * float(np.min(seen))), 1.12 * float(np.max(seen))


def _at(how: Seen, deflection: float) -> float:
    return how.rest + how.travel_scale[0] * deflection


def _curve(ax: Axes, curve: Fitted, points: Measured) -> None:
    """The median: where the film was unloaded, too, in the order of the test, for a loop is seen as one."""
    how = points.how
    x, force, c = how.along(curve.deflection), how.carried(curve.force), colour(curve.look)
    inside = ~curve.beyond
    if not curve.path:
        ax.plot(
            how.along(points.deflection), how.carried(points.force - curve.residual[1]), color=c, linestyle="none",
            marker=marker(curve.look), markersize=3.5, alpha=0.7, zorder=3,
        )  # fmt: skip
        return
    band(ax, x, force, inside, Shade(c, 0.25))
    if np.any(np.diff(points.deflection) < 0) and np.all(np.isfinite(curve.residual[1])):
        ax.plot(how.along(points.deflection), how.carried(points.force - curve.residual[1]), color=c, zorder=3)
    else:
        ax.plot(x[inside], force[1][inside], color=c, zorder=3)
    if np.any(curve.beyond):
        outside = curve.beyond.copy()
        outside[max(0, int(np.argmax(curve.beyond)) - 1)] = True  # joined to the inside
        band(ax, x, force, outside, Shade(c, 0.12, "////"))
        ax.plot(x[outside], force[1][outside], color=c, linestyle=(0, (4, 2)), linewidth=1.5, zorder=3)


def _look_residuals(ax: Axes, look: Panel, first: bool) -> None:
    how = look.points.how
    x, n = how.along(look.points.deflection), look.points.deflection.size
    left = [how.carried(c.residual[1]) for c in look.curves]
    own = None if look.points.sd is None else how.carried(look.points.sd)
    if own is not None:
        order = np.argsort(x)
        sd = 2 * own[order]
        ax.fill_between(x[order], -sd, sd, color=FAINT, lw=0, zorder=1)
    ax.axhline(0, color=INK, linewidth=0.8)
    for curve, residual in zip(look.curves, left, strict=True):
        c = colour(curve.look)
        mark = marker(curve.look) if n <= 60 or not curve.path else "none"
        line = linestyle(curve.look) if curve.path else "none"
        ax.plot(x, residual, color=c, linewidth=1.1, linestyle=line, marker=mark, markersize=3.5)
    _residual_scale(ax, left, own)
    ax.set_xlabel(how.travel_label)
    ax.grid(color=FAINT, linewidth=0.6)
    if first:
        ax.set_ylabel(f"residual ({how.load_scale[1]})")


def _residual_scale(ax: Axes, residuals: Sequence[Array], sd: Array | None) -> None:
    """Linear, unless the worst material would flatten the best: then linear near zero and logarithmic beyond."""
    sizes = [float(np.nanmax(np.abs(r))) for r in residuals if np.any(np.isfinite(r))]
    if not sizes:
        return
    reach = 1.15 * max(sizes + ([2 * float(np.max(sd))] if sd is not None else []))
    if max(sizes) > 12 * min(sizes):
        linear = 10 ** np.floor(np.log10(2 * min(sizes)))
        ax.set_yscale("symlog", linthresh=linear, linscale=0.8)
        ax.yaxis.set_minor_formatter(NullFormatter())
        ax.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    ax.set_ylim(-reach, reach)


def _same_limits(axes: Sequence[Axes]) -> None:
    low, high = min(ax.get_ylim()[0] for ax in axes), max(ax.get_ylim()[1] for ax in axes)
    for ax in axes:
        ax.set_ylim(low, high)


def _look_legend(looks: Sequence[Panel]) -> list[Any]:
    curves = {c.label: c for look in looks for c in look.curves}
    origin = looks[0].points.how.origin
    handles: list[Any] = [
        Line2D([], [], color=INK, marker="o", linestyle="none", markersize=4.5, label=f"{origin} (bars: 2 sd)")
    ]
    if any(look.rest is not None and look.rest.deflection.size for look in looks):
        handles.append(
            Line2D(
                [], [], color=INK, marker="o", markerfacecolor="white", linestyle="none", markersize=4.5,
                label=f"{origin}, not used",
            )
        )  # fmt: skip
    for name, c in curves.items():
        line, mark = linestyle(c.look) if c.path else "none", marker(c.look)
        handles.append(Line2D([], [], color=colour(c.look), linestyle=line, marker=mark, markersize=4, label=name))
    return handles
