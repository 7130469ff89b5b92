"""Pictures of one run's draws: corner, traces, prior beside posterior, and new readings beside the old."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.quiet import arviz
from bayesmembrane.report.blocks import Picture
from bayesmembrane.report.canvas import WIDTH, encoded, new_figure, style
from bayesmembrane.report.runs import Replicas
from bayesmembrane.report.style import ALARM, FAINT, INK, MUTED, RANGE_COLOURS, colour, with_unit

ENSEMBLES = (*RANGE_COLOURS, "#E69F00")
MOST_MEANS = 150  # of a line of means
NARROW = 0.85  # inches: under narrower panels no name lies level
LETTER = 0.08  # inches, of a name
NO_LETTERS = str.maketrans("", "", "${}_^\\")  # signs that set a name in type


def corner_plot(
    draws: Array,
    names: Sequence[str],
    units: Sequence[str],
    look: str,
    optimum: Sequence[float | None] | None = None,
    published: Sequence[float | None] | None = None,
) -> Picture:
    """Draws (S, m) of the natural parameters, each pair of them, with the optimum and the paper's point."""
    import corner  # on demand: it imports all of arviz, and a page without draws needs neither

    m, c = draws.shape[1], colour(look)
    logarithmic = [_wide(draws[:, i]) for i in range(m)]
    ranges = [_span(draws[:, i], log) for i, log in enumerate(logarithmic)]
    labels = [with_unit(n, u) for n, u in zip(names, units, strict=True)]
    size = WIDTH if m > 2 else 6.0
    with style({"font.size": 10, "axes.labelsize": 10.5, "xtick.labelsize": 8.5, "ytick.labelsize": 8.5}):
        figure = new_figure(size, width=size, layout=None)
        level = logging.getLogger().level
        logging.getLogger().setLevel(logging.ERROR)  # corner writes to the root logger when a cell is empty
        corner.corner(
            draws,
            fig=figure,
            labels=labels,
            range=ranges,
            axes_scale=["log" if log else "linear" for log in logarithmic],
            color=c,
            bins=30,
            smooth=1.0,
            levels=(0.5, 0.9),
            quantiles=(0.05, 0.5, 0.95),
            plot_datapoints=m <= 3,
            fill_contours=True,
            no_fill_contours=False,
            hist_kwargs={"linewidth": 1.3},
        )
        logging.getLogger().setLevel(level)
        _corner_margins(figure, labels, size, logarithmic)
        handles = [Line2D([], [], color=c, label="posterior: 50 % and 90 % regions")]
        for values, shade, mark, label in ((optimum, INK, "x", "our optimum"), (published, ALARM, "+", "paper")):
            if values is not None and _mark(figure, m, values, ranges, shade, mark):
                handles.append(
                    Line2D([], [], color=shade, marker=mark, linestyle="none", markersize=8, mew=2, label=label)
                )
        figure.legend(handles=handles, loc="upper right", bbox_to_anchor=(0.985, 0.985))
        return encoded(figure, "png")


def _collide(labels: Sequence[str], panel: float) -> bool:
    """Whether names (m,) would run into one another under panels of this width in inches."""
    wide = [LETTER * len(label.translate(NO_LETTERS)) for label in labels]
    return panel < NARROW or any(0.5 * (a + b) > panel for a, b in pairwise(wide))


def _corner_margins(figure: Figure, labels: Sequence[str], size: float, logarithmic: Sequence[bool]) -> None:
    """Room for ticks and labels in inches, however many panels there are."""
    m, right, gap = len(labels), 0.1, 0.07
    narrow = _collide(labels, (size - 0.95 - right) / m)
    left, away, ticks = (2.1, 0.6, 2) if narrow else (0.95, 0.72, 3)
    figure.subplots_adjust(
        left=left / size, bottom=left / size, right=1 - right / size, top=1 - right / size, wspace=gap, hspace=gap
    )
    panel = (size - left - right) / m
    for i, ax in enumerate(np.array(figure.axes).reshape(m, m).flat):
        row, column = divmod(i, m)
        if row < column:
            continue
        # Of decades side by side only the whole ones have room for their numbers.
        if logarithmic[column]:
            ax.xaxis.set_minor_formatter(NullFormatter())
        else:
            ax.xaxis.set_major_locator(MaxNLocator(ticks, prune="both"))
        ax.xaxis.set_label_coords(0.5, -away / panel)
        if row > column:
            if logarithmic[row]:
                ax.yaxis.set_minor_formatter(NullFormatter())
            else:
                ax.yaxis.set_major_locator(MaxNLocator(ticks, prune="both"))
            ax.yaxis.set_label_coords(-away / panel, 0.5)
        if narrow:
            ax.tick_params(labelsize=7)
            ax.xaxis.label.set(rotation=45, rotation_mode="anchor", ha="right", va="top")
            ax.yaxis.label.set(rotation=0, ha="right", va="center")
            for axis, log in ((ax.xaxis, logarithmic[column]), (ax.yaxis, logarithmic[row] and row > column)):
                if log:
                    axis.set_major_locator(LogLocator(numticks=3))


def _wide(values: Array) -> bool:
    """Whether a parameter is positive and spans more than a decade: then its axis is logarithmic."""
    low, high = np.quantile(values, [0.01, 0.99])
    return bool(np.min(values) > 0 and high > 10 * low)


def _span(values: Array, logarithmic: bool = False) -> tuple[float, float]:
    """The middle 99 % of the draws and a margin; never of zero width."""
    if logarithmic:
        low, high = _span(np.log(values))
        return float(np.exp(low)), float(np.exp(high))
    low, high = np.quantile(values, [0.005, 0.995]).tolist()
    margin = 0.12 * (high - low) or 1e-3 * (abs(high) or 1.0)
    return float(low - margin), float(high + margin)


def _mark(
    figure: Figure, m: int, values: Sequence[float | None], ranges: Sequence[tuple[float, float]], shade: str, mark: str
) -> bool:
    """Draw a point into every cell whose range holds it; whether any cell did."""
    axes = np.array(figure.axes).reshape(m, m)
    inside = [v is not None and lo <= v <= hi for v, (lo, hi) in zip(values, ranges, strict=True)]
    for i in range(m):
        if inside[i]:
            axes[i, i].axvline(float(values[i] or 0.0), color=shade, linewidth=1.2, linestyle=(0, (3, 2)))
        for j in range(i):
            if inside[i] and inside[j]:
                axes[i, j].plot([values[j]], [values[i]], mark, color=shade, markersize=8, markeredgewidth=2, zorder=10)
    return any(inside)


@dataclass(frozen=True, eq=False)
class Walk:
    """Of ``names`` (k) with ``units``: draws (E, D, k) of the ensembles at the steps ``at`` (D,), and means over the
    walkers (E, T, k) at ``steps`` (T,), of which those before ``burn`` were discarded.
    """

    names: Sequence[str]
    units: Sequence[str]
    draws: Array
    at: Array
    means: Array
    steps: Array
    burn: float


def traces(walk: Walk, kind: str = "png") -> Picture:
    """Density and trace of the draws of each ensemble, by arviz, with the means over the walkers on top."""
    count, k = walk.means.shape[0], len(walk.names)
    colours = [ENSEMBLES[e % len(ENSEMBLES)] for e in range(count)]
    keep = np.unique(np.linspace(0, len(walk.steps) - 1, min(len(walk.steps), MOST_MEANS)).astype(int))
    with style():
        figure = new_figure(0.8 + 1.3 * k)
        axes = figure.subplots(k, 2, squeeze=False, width_ratios=(1, 2.3))
        _arviz_trace(walk, axes, colours)
        for i, (left, right) in enumerate(axes):
            for e, c in enumerate(colours):
                right.plot(walk.steps[keep], walk.means[e, keep, i], color=c, linewidth=1.3, zorder=5)
            if walk.burn > walk.steps[0]:
                right.axvspan(float(walk.steps[0]), walk.burn, color=FAINT, zorder=0)
            for ax in (left, right):
                ax.set_title("")
                ax.tick_params(labelsize=9)
            left.set_xlabel(with_unit(walk.names[i], walk.units[i]), fontsize=10)
            left.xaxis.set_major_locator(MaxNLocator(3))
            left.spines["left"].set_visible(False)
            right.set_ylabel(with_unit(walk.names[i], walk.units[i]), fontsize=10)
            right.yaxis.set_major_locator(MaxNLocator(4))
            right.set_xlim(float(walk.steps[0]), float(max(walk.steps[-1], walk.at[-1])))
        axes[-1, 1].set_xlabel("step of the ensemble (-)")
        handles: list[Line2D | Patch] = [
            Line2D([], [], color=c, label=f"ensemble {e + 1}") for e, c in enumerate(colours)
        ]
        if walk.burn > walk.steps[0]:
            handles.append(Patch(color=FAINT, label="discarded"))
        figure.legend(handles=handles, loc="outside upper center", ncols=6)
        return encoded(figure, kind)


def _arviz_trace(walk: Walk, axes: Any, colours: Sequence[str]) -> None:
    data = arviz.from_dict({n: walk.draws[:, :, i] for i, n in enumerate(walk.names)}, coords={"draw": walk.at})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of draws that never moved there is no density
        arviz.plot_trace(
            data,
            axes=axes,
            compact=False,
            divergences=None,
            chain_prop={"color": list(colours)},
            trace_kwargs={"linewidth": 0.6, "alpha": 0.3, "antialiased": False},  # a third of the bytes
            plot_kwargs={"linewidth": 1.4},
            show=False,
        )


def calibration_picture(replicas: Replicas, look: str, kind: str = "svg") -> Picture:
    """Where each point lies among readings predicted without it: LOO-PIT, by arviz, minus what chance would make."""
    with style():
        figure = new_figure(3.2)
        ax = figure.subplots()
        arviz.plot_loo_pit(  # type: ignore[no-untyped-call]
            y=replicas.force,
            y_hat=replicas.readings,
            log_weights=replicas.log_weights,
            ecdf=True,
            hdi_prob=0.9,
            color=colour(look),
            ax=ax,
            legend=False,
            plot_kwargs={"linewidth": 1.8},
            fill_kwargs={"color": FAINT, "alpha": 1.0},
            show=False,
        )
        ax.axhline(0, color=MUTED, linewidth=0.8)
        ax.set_xlim(0, 1)
        ax.set_xlabel("place among predicted readings (-)")
        ax.set_ylabel("place minus\nits rank (-)")
        ax.tick_params(labelsize=10)
        handles = [
            Line2D([], [], color=colour(look), linewidth=1.8, label="points of the test"),
            Patch(color=FAINT, label="what chance does (90 %)"),
        ]
        figure.legend(handles=handles, loc="outside upper center", ncols=2)
        return encoded(figure, kind)


@dataclass(frozen=True)
class Marginal:
    """One coordinate: its name and unit, draws of the prior and of the posterior."""

    name: str
    unit: str
    prior: Array
    posterior: Array


def prior_posterior(marginals: Sequence[Marginal], look: str, kind: str = "svg") -> Picture:
    """Prior and posterior of every coordinate, each scaled to its own maximum."""
    columns = min(4, len(marginals))
    rows = -(-len(marginals) // columns)
    with style():
        figure = new_figure(0.7 + 1.9 * rows)
        grid = figure.subplots(rows, columns, squeeze=False)
        for k, ax in enumerate(grid.flat):
            if k >= len(marginals):
                ax.set_visible(False)
                continue
            _marginal(ax, marginals[k], colour(look))
        handles = [Patch(color=FAINT, label="prior"), Patch(color=colour(look), label="posterior")]
        figure.legend(handles=handles, loc="outside upper center", ncols=2)
        return encoded(figure, kind)


def _marginal(ax: Axes, marginal: Marginal, c: str) -> None:
    both = np.concatenate([np.quantile(marginal.prior, [0.01, 0.99]), np.quantile(marginal.posterior, [0.001, 0.999])])
    low, high = float(np.min(both)), float(np.max(both))
    edges, coarse = np.linspace(low, high, 61), np.linspace(low, high, 31 if marginal.prior.size < 2000 else 61)
    own = np.quantile(marginal.posterior, [0.001, 0.999])
    narrow = own[1] - own[0] < 0.15 * (high - low)
    fine = np.linspace(own[0], own[1], 25) if narrow and own[1] > own[0] else edges
    for values, bins, shade, alpha in ((marginal.prior, coarse, FAINT, 1.0), (marginal.posterior, fine, c, 0.75)):
        counts, _ = np.histogram(values, bins)
        ax.stairs(counts / max(1, counts.max()), bins, fill=True, color=shade, alpha=alpha)
    if narrow:  # a spike of a few pixels must be seen
        ax.axvline(float(np.median(marginal.posterior)), color=c, linewidth=1.5)
    ax.set_xlabel(with_unit(marginal.name, marginal.unit))
    ax.xaxis.set_major_locator(MaxNLocator(4))
    ax.set_yticks([])
    ax.set_ylim(0, 1.08)
    ax.spines["left"].set_visible(False)
