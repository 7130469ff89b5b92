"""Pictures of valleys over more than two parameters: a triangle of pairwise profile maps."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

from bayesmembrane.ground.parameters import Array
from bayesmembrane.report.blocks import Picture
from bayesmembrane.report.canvas import encoded, new_figure, style
from bayesmembrane.report.style import INK, MUTED, RANGE_COLOURS, with_unit
from bayesmembrane.valleys.profile import PairMap
from bayesmembrane.valleys.result import Valley, Valleys
from bayesmembrane.words.hypothesis import spoken
from bayesmembrane.words.valleys import loss_of, up_to


def percent(v: Valley) -> str:
    """The stated rise relative to the least loss."""
    return f"{100 * v.rise / v.best_loss:.3g} %"


def pairs(found: Valleys, kind: str) -> Picture:
    """A triangle of pairwise maps, with the profile of each parameter on its diagonal."""
    k = found.ranges[0].chart.size
    with style({"font.size": 9 if k > 3 else 11, "axes.labelsize": 9 if k > 3 else 11}):
        figure = new_figure(max(1.55 * k, 6.4))
        axes = figure.subplots(k, k, squeeze=False, sharex="col")
        for i in range(k):
            for j in range(k):
                ax = axes[i][j]
                if j > i:
                    ax.set_axis_off()
                elif i == j:
                    _profile(ax, found, i)
                else:
                    _pair(ax, found, (j, i))
                _trim(ax, found.ranges[0], i, j, k)
        figure.legend(handles=_pair_handles(found), loc="upper right", bbox_to_anchor=(0.99, 0.93), fontsize=11)
        rise, name = percent(found.ranges[0]), spoken(found.hypothesis)
        told = f"{name}: films within {rise} of the best loss, the other parameters adjusted"
        figure.suptitle(told, fontweight="bold", fontsize=12)
        return encoded(figure, kind)


def _axis_values(v: Valley, i: int, z: Array) -> Array:
    """Natural values of parameter i; magnitudes where it is logarithmic."""
    wide = np.tile(v.best_z, (z.size, 1))
    wide[:, i] = z
    p = v.chart.natural(wide)[:, i]
    return np.abs(p) if v.chart.log[i] else p


def _profile(ax: Axes, found: Valleys, i: int) -> None:
    for v, c in zip(found.ranges, RANGE_COLOURS, strict=False):
        p = v.profiles[i]
        ax.plot(_axis_values(v, i, p.points[:, i]), 100 * (p.loss / v.best_loss - 1), color=c, linewidth=1.6)
        ax.axhline(100 * v.rise / v.best_loss, color=MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
    ax.set_ylim(0, 300 * found.ranges[0].rise / found.ranges[0].best_loss)
    if found.ranges[0].chart.log[i]:
        ax.set_xscale("log")


def _pair(ax: Axes, found: Valleys, pair: tuple[int, int]) -> None:
    for v, c in zip(found.ranges, RANGE_COLOURS, strict=False):
        m = next(m for m in v.maps if m.pair == pair)
        _map_levels(ax, v, m, c)
        x, y = (np.abs(v.floor[:, c_]) if v.chart.log[c_] else v.floor[:, c_] for c_ in pair)
        ax.plot(x, y, color=c, linewidth=1.6, zorder=4)
        at_edge = bool(v.at_bound)  # the least loss is then a limit, and no optimum
        ax.plot(
            *(abs(v.best[c_]) if v.chart.log[c_] else v.best[c_] for c_ in pair),
            "*",
            color=c,
            markersize=10,
            markerfacecolor="white" if at_edge else c,
            markeredgecolor=c if at_edge else "white",
            zorder=6,
        )
    v = found.ranges[0]
    for p in v.published:
        at = [abs(p.natural[c_]) if v.chart.log[c_] else p.natural[c_] for c_ in pair]
        ax.plot(*at, "D", markersize=4, markerfacecolor="white", markeredgecolor=INK, zorder=5)
    if v.chart.log[pair[0]]:
        ax.set_xscale("log")
    if v.chart.log[pair[1]]:
        ax.set_yscale("log")


def _map_levels(ax: Axes, v: Valley, m: PairMap, c: str) -> None:
    x, y = _axis_values(v, m.pair[0], m.first), _axis_values(v, m.pair[1], m.second)
    share = np.where(np.isfinite(m.loss), m.loss / v.best_loss - 1, 10.0).T
    rise = v.rise / v.best_loss
    if np.min(share) < 3 * rise:
        ax.contourf(x, y, share, levels=[-1.0, rise, 3 * rise], colors=[to_rgba(c, 0.5), to_rgba(c, 0.2)], zorder=2)


def _trim(ax: Axes, v: Valley, i: int, j: int, k: int) -> None:
    """Labels at the edges of the triangle only."""
    names = [
        with_unit(n, u) if not (v.chart.log[c] and v.chart.sign[c] < 0) else "-" + with_unit(n, u)
        for c, (n, u) in enumerate(zip(v.chart.names, v.chart.units, strict=True))
    ]
    if i == k - 1:
        ax.set_xlabel(names[j])
    if j == 0 and i > 0:
        ax.set_ylabel(names[i])
    elif i == j:
        ax.set_ylabel("loss + %")
    else:
        ax.tick_params(labelleft=False)
    for axis, log in ((ax.xaxis, v.chart.log[j]), (ax.yaxis, i != j and v.chart.log[i])):
        axis.set_minor_formatter(NullFormatter())
        if not log:
            axis.set_major_locator(MaxNLocator(3))
        elif i != j or axis is ax.xaxis:
            axis.set_major_locator(LogLocator(numticks=3))


def _pair_handles(found: Valleys) -> list[Any]:
    rise = found.ranges[0].rise / found.ranges[0].best_loss
    handles: list[Any] = [
        Line2D([], [], color=c, linewidth=2.4, marker="*", markersize=11, markeredgecolor="white",
               label=f"{up_to(v)}: least loss {loss_of(v, v.best_loss, 3)} (star), floor")
        for v, c in zip(found.ranges, RANGE_COLOURS, strict=False)
    ]  # fmt: skip
    handles.append(Patch(facecolor=to_rgba(MUTED, 0.55), label=f"loss within {100 * rise:.3g} %"))
    handles.append(Patch(facecolor=to_rgba(MUTED, 0.22), label=f"loss within {300 * rise:.3g} %"))
    if found.ranges[0].published:
        handles.append(
            Line2D([], [], color=INK, marker="D", markerfacecolor="white", linestyle="none", markersize=5,
                   label="published")
        )  # fmt: skip
    return handles
