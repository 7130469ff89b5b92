"""Pictures of valleys: loss, floor, posterior and published points over the parameters, several ranges in one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.convexity import REACHED, ConvexityMode
from bayesmembrane.report.blocks import Picture
from bayesmembrane.report.canvas import encoded, new_figure, style
from bayesmembrane.report.sections.valleys.pairs import pairs, percent
from bayesmembrane.report.style import FAINT, INK, MUTED, RANGE_COLOURS, with_unit
from bayesmembrane.valleys.posterior import Grid
from bayesmembrane.valleys.result import Valley, Valleys
from bayesmembrane.words.hypothesis import spoken
from bayesmembrane.words.valleys import limit_title, loss_of, up_to

HELD = 0.9
DECADES = 1000.0  # how far an open end on a logarithmic axis is drawn past the closed one
MOST_DOTS = 400


def valley_picture(found: Valleys, kind: str = "png") -> Picture:
    """One picture of all ranges: maps for two parameters, pairwise maps for more, an interval for one."""
    k = found.ranges[0].chart.size
    if k == 1:
        return _one(found, kind)
    return _plane(found, kind) if k == 2 else pairs(found, kind)


def _mode(v: Valley) -> ConvexityMode:
    return v.hypothesis.convexity if v.hypothesis.convexity.restricts else REACHED


# ---- one parameter ---------------------------------------------------------------------------------------------------


def _one(found: Valleys, kind: str) -> Picture:
    with style():
        figure = new_figure(3.6)
        ax = figure.subplots()
        drawn = [(v, v.profiles[0], v.chart.natural(v.profiles[0].points)[:, 0]) for v in found.ranges]
        for (v, p, x), c in zip(drawn, RANGE_COLOURS, strict=False):
            ax.plot(
                x,
                100 * (p.loss / v.best_loss - 1),
                color=c,
                label=f"{up_to(v)}: least loss {loss_of(v, v.best_loss, 3)}",
            )
            ax.plot(v.best[0], 0, "*", color=c, markersize=13, markeredgecolor="white")
        share = 100 * found.ranges[0].rise / found.ranges[0].best_loss
        ax.axhline(share, color=MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
        ax.text(
            0.99, share, f"valley: within {share:.3g} %", transform=ax.get_yaxis_transform(), ha="right", va="bottom"
        )
        ax.set_ylim(-0.2 * share, 6 * share)
        shown = [x[p.loss <= (1 + 0.06 * share) * v.best_loss] for v, p, x in drawn]
        ax.set_xlim(min(x.min() for x in shown), max(x.max() for x in shown))
        ax.set_xlabel(with_unit(found.ranges[0].chart.names[0], found.ranges[0].chart.units[0]))
        ax.set_ylabel("loss above the least (%)")
        ax.legend()
        return encoded(figure, kind)


# ---- two parameters --------------------------------------------------------------------------------------------------


def _plane(found: Valleys, kind: str) -> Picture:
    ranges = found.ranges
    axes_of = _axes_order(ranges[0])
    with style():
        figure = new_figure(4.4 + 3.9)
        grid = figure.add_gridspec(2, len(ranges), height_ratios=(1.12, 1.0))
        top = figure.add_subplot(grid[0, :])
        _overview(top, found, axes_of)
        for i, v in enumerate(ranges):
            _zoom(figure.add_subplot(grid[1, i]), v, axes_of, RANGE_COLOURS[i % len(RANGE_COLOURS)])
        figure.legend(handles=_handles(ranges), loc="outside lower center", ncols=3, handlelength=2.2)
        return encoded(figure, kind)


def _axes_order(v: Valley) -> tuple[int, int]:
    """Which parameter is x and which is y: a logarithmic one runs along."""
    return (1, 0) if v.chart.log[1] and not v.chart.log[0] else (0, 1)


def _overview(ax: Axes, found: Valleys, order: tuple[int, int]) -> None:
    x, y = order
    for v, c in zip(found.ranges, RANGE_COLOURS, strict=False):
        _levels(ax, v, order, c)
        ax.plot(v.floor[:, x], v.floor[:, y], color=c, linewidth=2.6, zorder=4)
        _points(ax, v, order, c, labels=v is found.ranges[0])
    _limits(ax, [s for v in found.ranges for s in _corners(v, order)], found.ranges[0], order, 0.14)
    for v, c in zip(found.ranges, RANGE_COLOURS, strict=False):
        middle = v.floor[len(v.floor) // 2] if not v.open_end else v.floor[len(v.floor) // 6]
        ax.annotate(
            f"{up_to(v)}: least loss {loss_of(v, v.best_loss, 3)}",
            (middle[x], middle[y]),
            xytext=(12, 14) if _across(ax, middle[[x, y]]) < 0.6 else (40, 52),
            textcoords="offset points",
            ha="left" if _across(ax, middle[[x, y]]) < 0.6 else "center",
            color=c,
            fontweight="bold",
            zorder=8,
            bbox={"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1.5},
        )
        _open_arrow(ax, v, order, c)
    for b in found.between:
        one, two = np.array(b.closest[0]), np.array(b.closest[1])
        ax.plot([one[x], two[x]], [one[y], two[y]], color=INK, linewidth=1.2, linestyle=(0, (2, 2)), zorder=5)
        text = "cross here" if b.crossing is not None else f"closest: {b.approach.distance:.2g} posterior sd apart"
        ax.annotate(
            text,
            tuple(_halfway(ax, one[[x, y]], two[[x, y]])),
            xytext=(-10, -36),
            textcoords="offset points",
            ha="center",
            arrowprops={"arrowstyle": "-", "color": MUTED, "linewidth": 0.8},
            zorder=8,
            bbox={"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1.5},
        )
    rise = percent(found.ranges[0])
    ax.set_title(f"{spoken(found.hypothesis)}: all films that fit within {rise} of the best loss")
    _axis_labels(ax, found.ranges[0], order)


def _halfway(ax: Axes, one: Array, two: Array) -> Array:
    """The middle of two points as it is seen on the axes."""
    shown = ax.transData.transform(np.array([one, two]))
    return np.asarray(ax.transData.inverted().transform(np.mean(shown, axis=0)))


def _across(ax: Axes, point: Array) -> float:
    """Where a point lies on the width of the axes, from 0 to 1."""
    return float(ax.transAxes.inverted().transform(ax.transData.transform(point))[0])


def _zoom(ax: Axes, v: Valley, order: tuple[int, int], c: str) -> None:
    x, y = order
    assert v.band is not None
    _levels(ax, v, order, c)
    _hatch(ax, v, v.band, order)
    if v.spread.source == "draws":
        dots = v.chart.natural(v.spread.draws[:: max(1, len(v.spread.draws) // MOST_DOTS)])
        ax.plot(dots[:, x], dots[:, y], ".", color=INK, markersize=1.5, alpha=0.5, zorder=3)
    else:
        _posterior(ax, v, order)
    ax.plot(v.floor[:, x], v.floor[:, y], color=c, linewidth=2.2, zorder=4)
    _points(ax, v, order, c, labels=False)
    inner = [v.floor[:, [x, y]]]
    if v.spread.source != "normal" and len(v.spread.draws):
        inner.append(np.quantile(v.chart.natural(v.spread.draws), (0.03, 0.97), axis=0)[:, [x, y]])
    _limits(ax, inner, v, order, 0.25)
    _open_arrow(ax, v, order, c)
    number = v.spectra[0].condition_number
    size = int(np.floor(np.log10(number))) if 0 < number < np.inf else 99
    shown = f"{number:,.0f}" if size < 4 else rf"${number / 10.0**size:.1f}\times10^{{{size}}}$"
    ratio = f", condition number {shown}" if size < 9 else ""
    ax.set_title(f"{up_to(v)}{ratio}", color=c)
    _axis_labels(ax, v, order)


def _levels(ax: Axes, v: Valley, order: tuple[int, int], c: str) -> None:
    """What lies within the stated rise, three times it, and twice the least loss."""
    assert v.band is not None
    p = v.band.natural
    share = np.where(np.isfinite(v.band.loss), v.band.loss / v.best_loss - 1, 10.0)
    rise = v.rise / v.best_loss
    levels = sorted({-1.0, rise, 3 * rise, max(1.0, 4 * rise)})
    shades = [to_rgba(c, a) for a in (0.55, 0.26, 0.1)]
    ax.contourf(p[:, :, order[0]], p[:, :, order[1]], share, levels=levels, colors=shades, zorder=2)


def _hatch(ax: Axes, v: Valley, g: Grid, order: tuple[int, int]) -> None:
    bad = (~g.convex(_mode(v))).astype(float)
    if np.any(bad > 0):
        ax.contourf(
            g.natural[:, :, order[0]], g.natural[:, :, order[1]], bad, levels=[0.5, 1.5], colors="none",
            hatches=["////"], zorder=3,
        )  # fmt: skip


def _posterior(ax: Axes, v: Valley, order: tuple[int, int]) -> None:
    """The region of highest density that holds `HELD` of the posterior, over the band."""
    assert v.band is not None
    p = v.band.natural
    density = np.exp(v.band.log_posterior - np.max(v.band.log_posterior))
    cells = np.abs(np.gradient(p[:, 0, v.along])[:, None] * np.gradient(p[:, :, 1 - v.along], axis=1))
    weight = (density * cells).ravel()
    by_density = np.argsort(-density.ravel())
    inside = np.cumsum(weight[by_density]) / np.sum(weight)
    level = density.ravel()[by_density[int(np.searchsorted(inside, HELD))]]
    if 0 < level < 1:
        ax.contour(
            p[:, :, order[0]], p[:, :, order[1]], density, levels=[level], colors=[INK], linewidths=1.3,
            linestyles=[(0, (5, 2))], zorder=5,
        )  # fmt: skip


def _points(ax: Axes, v: Valley, order: tuple[int, int], c: str, labels: bool) -> None:
    x, y = order
    if not v.at_bound:
        ax.plot(v.best[x], v.best[y], "*", color=c, markersize=15, markeredgecolor="white", zorder=7)
    for p in v.published:
        ax.plot(
            p.natural[x], p.natural[y], "D", markersize=6, markerfacecolor="white", markeredgecolor=INK, zorder=6,
            clip_on=True,
        )  # fmt: skip
        if labels:
            ax.annotate(
                f"paper {p.label}", (p.natural[x], p.natural[y]), xytext=(6, -13), textcoords="offset points",
                fontsize=9, color=INK, zorder=8, annotation_clip=True,
            )  # fmt: skip


def _open_arrow(ax: Axes, v: Valley, order: tuple[int, int], c: str) -> None:
    """An arrow where the valley leaves the picture without an end."""
    _, high = v.profiles[v.along].ends
    if not v.open_end or v.along != order[0]:
        return
    side = 1.0 if high.open else 0.0
    line = v.floor[np.argsort(v.floor[:, order[0]])]
    at = float(np.interp(ax.get_xlim()[int(side)], line[:, order[0]], line[:, order[1]]))
    goal = f"open: on to the {limit_title(v)} film" if v.limit else "open: no end"
    ax.annotate(
        goal,
        (side, at),
        xycoords=("axes fraction", "data"),
        xytext=(-12 if side else 12, -48),
        textcoords="offset points",
        ha="right" if side else "left",
        color=c,
        fontweight="bold",
        arrowprops={"arrowstyle": "->", "color": c, "linewidth": 2},
        zorder=9,
        bbox={"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1.5},
    )


def _corners(v: Valley, order: tuple[int, int]) -> list[Array]:
    return [v.floor[:, list(order)], *(np.array([p.natural])[:, list(order)] for p in v.published)]


def _limits(ax: Axes, points: Sequence[Array], v: Valley, order: tuple[int, int], margin: float) -> None:
    low, high = (f(np.concatenate(points), axis=0) for f in (np.min, np.max))
    if v.chart.log[order[0]]:
        high[0] = min(high[0], DECADES * float(np.median([np.min(p[:, 0]) for p in points])))
    for axis, a, b in ((0, low[0], high[0]), (1, low[1], high[1])):
        # Over less than an octave a logarithmic axis is as good as a linear one, and hard to label.
        log = bool(v.chart.log[order[axis]]) and b > 2 * a
        (ax.set_xscale, ax.set_yscale)[axis]("log" if log else "linear")
        edges = np.log([a, b]) if log else np.array([a, b])
        pad = margin * (edges[1] - edges[0]) or 0.1 * abs(edges[0]) or 0.1
        edges = edges + np.array([-pad, pad])
        (ax.set_xlim, ax.set_ylim)[axis](*(np.exp(edges) if log else edges))


def _axis_labels(ax: Axes, v: Valley, order: tuple[int, int]) -> None:
    for axis, i in ((ax.set_xlabel, order[0]), (ax.set_ylabel, order[1])):
        axis(with_unit(v.chart.names[i], v.chart.units[i]))
    ax.grid(color=FAINT, linewidth=0.6)


def _handles(ranges: Sequence[Valley]) -> list[Any]:
    v = ranges[0]
    rise = v.rise / v.best_loss
    handles: list[Any] = [
        Line2D([], [], color=MUTED, linewidth=2.6, label="floor of the valley"),
        Line2D([], [], color=MUTED, marker="*", linestyle="none", markersize=12, label="least loss (ours)"),
        Line2D(
            [], [], color=INK, marker="D", markerfacecolor="white", linestyle="none", markersize=6, label="published"
        ),
        Patch(facecolor=to_rgba(MUTED, 0.6), label=f"loss within {100 * rise:.3g} %"),
        Patch(
            facecolor=to_rgba(MUTED, 0.25), label=f"within {300 * rise:.3g} % (paler: {100 * max(1, 4 * rise):.3g} %)"
        ),
        Line2D([], [], color=INK, linewidth=1.3, linestyle=(0, (5, 2)), label=f"{100 * HELD:.0f} % of the posterior"),
        Patch(facecolor="none", edgecolor=INK, hatch="////", linewidth=0, label=f"not convex ({_mode(v)})"),
    ]
    handles = (
        handles if any(w.band is not None and not np.all(w.band.convex(_mode(w))) for w in ranges) else handles[:-1]
    )
    return handles if v.published else [h for h in handles if h.get_label() != "published"]
