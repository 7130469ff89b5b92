"""Every picture of a report, as a function of arrays. The only file that imports matplotlib and corner.

Arrays come in SI units; axes are in mm and N. A picture is drawn 900 px wide, so that nothing in it is too small on a
page; curves are SVG, clouds and maps PNG.
"""

from __future__ import annotations

import base64
import io
import logging
import re
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any

import corner
import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap, SymLogNorm, TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter
from numpy.typing import NDArray

from bayesmembrane.ground.parameters import Array
from bayesmembrane.report.style import ALARM, FAINT, INK, MUTED, SHADE, colour, linestyle, marker, symbol, title

WIDTH = 9.0  # inches: 900 px at 100 dpi
DPI = 120
MOST_POINTS = 300  # of a line that is drawn
_ENSEMBLES = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
_RC: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 11,
    "axes.labelsize": 11,
    "axes.titlesize": 11.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 10,
    "ytick.labelsize": 10,
    "legend.fontsize": 10,
    "legend.frameon": False,
    "lines.linewidth": 1.8,
    "hatch.linewidth": 0.6,
    "svg.fonttype": "path",
    "svg.hashsalt": "bayesmembrane",
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
}


def _style(changes: dict[str, Any] | None = None) -> AbstractContextManager[None]:
    settings: Any = {**_RC, **(changes or {})}
    return mpl.rc_context(settings)


@dataclass(frozen=True)
class Picture:
    """An encoded picture; ``kind`` is "svg" or "png"."""

    data: bytes
    kind: str

    @property
    def uri(self) -> str:
        """The picture as a data address for an HTML page."""
        mime = {"svg": "image/svg+xml", "png": "image/png"}[self.kind]
        return f"data:{mime};base64,{base64.b64encode(self.data).decode('ascii')}"


def _encoded(figure: Figure, kind: str) -> Picture:
    """The same figure always gives the same bytes: no date, no random names."""
    out = io.BytesIO()
    metadata = {"Date": None} if kind == "svg" else {"Software": None}
    with _style():
        figure.savefig(out, format=kind, dpi=DPI, metadata=metadata)
    data = out.getvalue()
    return Picture(_PATH.sub(_rounded, data) if kind == "svg" else data, kind)


_PATH = re.compile(rb' d="[^"]*"')
_LONG = re.compile(rb"(\.\d\d)\d+")


def _rounded(path: re.Match[bytes]) -> bytes:
    """Coordinates with two decimals: a hundredth of a point is not seen, and halves the file."""
    return _LONG.sub(rb"\1", path[0])


def _figure(height: float, width: float = WIDTH) -> Figure:
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


# ---- measured curve, bands, residuals --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Points:
    """Measured points: deflection (N,) m, force (N,) N, own standard deviation (N,) N or None."""

    deflection: Array
    force: Array
    sd: Array | None = None


@dataclass(frozen=True)
class Curve:
    """What one material says: 5, 50 and 95 % of the force (3, G) N at ``deflection`` (G,) m, and the residuals.

    ``beyond`` (G,) is True where the deflection lies outside the fitted range; ``residual`` (3, N) N is measured minus
    computed force at the measured points.
    """

    material: str
    deflection: Array
    force: Array
    beyond: NDArray[np.bool_]
    residual: Array
    label: str = ""

    @property
    def name(self) -> str:
        """What the legend says."""
        return self.label or title(self.material)


@dataclass(frozen=True)
class Look:
    """One set of points with the curves fitted to it; ``rest`` are points that were not used."""

    points: Points
    curves: tuple[Curve, ...]
    rest: Points | None = None
    heading: str = ""


def first_look(looks: Sequence[Look], kind: str = "svg") -> Picture:
    """(a) The measured curve, the materials' medians and 90 % bands, extrapolation dashed; the residuals beneath."""
    with _style():
        figure = _figure(6.4)
        grid = figure.subplots(2, len(looks), sharex="col", squeeze=False, height_ratios=(2.3, 1))
        for i, look in enumerate(looks):
            _look(grid[0, i], look, first=i == 0)
            _look_residuals(grid[1, i], look, first=i == 0)
        if len(looks) > 1:
            _same_limits([grid[0, i] for i in range(len(looks))])
        figure.legend(
            handles=_look_legend(looks), loc="outside upper center", ncols=4, columnspacing=1.4, handlelength=2.4
        )
        return _encoded(figure, kind)


def _look(ax: Axes, look: Look, first: bool) -> None:
    points = [look.points] + ([look.rest] if look.rest is not None else [])
    top = 1.12 * max(float(np.max(p.force)) for p in points)
    lowest = min(0.0, 1.12 * min(float(np.min(p.force)) for p in points))
    end = 1e3 * float(np.max(look.points.deflection))
    for curve in look.curves:
        _curve(ax, curve)
    last = max([end, *(1e3 * float(c.deflection[-1]) for c in look.curves)])
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
    _errorbars(ax, look.points, filled=True)
    if look.rest is not None and look.rest.deflection.size:
        _errorbars(ax, look.rest, filled=False)
    ax.set_ylim(lowest - 0.02 * top, top)
    ax.set_xlim(0, last)
    ax.set_title(look.heading)
    ax.grid(color=FAINT, linewidth=0.6)
    if first:
        ax.set_ylabel("force (N)")


def _curve(ax: Axes, curve: Curve) -> None:
    x, c = 1e3 * curve.deflection, colour(curve.material)
    inside = ~curve.beyond
    _band(ax, x, curve.force, inside, c, alpha=0.25)
    ax.plot(x[inside], curve.force[1][inside], color=c, zorder=3)
    if np.any(curve.beyond):
        outside = curve.beyond.copy()
        outside[max(0, int(np.argmax(curve.beyond)) - 1)] = True  # joined to the inside
        _band(ax, x, curve.force, outside, c, alpha=0.12, hatch="////")
        ax.plot(x[outside], curve.force[1][outside], color=c, linestyle=(0, (4, 2)), linewidth=1.5, zorder=3)


def _band(
    ax: Axes, x: Array, force: Array, where: NDArray[np.bool_], c: str, alpha: float, hatch: str | None = None
) -> None:
    edge = (*mpl.colors.to_rgb(c), 0.45) if hatch else "none"
    ax.fill_between(
        x, force[0], force[2], where=where, facecolor=(*mpl.colors.to_rgb(c), alpha), edgecolor=edge, hatch=hatch, lw=0
    )


def _errorbars(ax: Axes, points: Points, filled: bool) -> None:
    ax.errorbar(
        1e3 * points.deflection,
        points.force,
        None if points.sd is None else 2 * points.sd,
        fmt="o",
        color=INK,
        markersize=_marker_size(points),
        markerfacecolor=INK if filled else "white",
        markeredgewidth=0.9,
        elinewidth=0.9,
        capsize=2,
        zorder=5,
    )


def _marker_size(points: Points) -> float:
    return 4.5 if points.deflection.size <= 60 else 2.0


def _look_residuals(ax: Axes, look: Look, first: bool) -> None:
    x, n = 1e3 * look.points.deflection, look.points.deflection.size
    if look.points.sd is not None:
        order = np.argsort(x)
        sd = 2 * look.points.sd[order]
        ax.fill_between(x[order], -sd, sd, color=FAINT, lw=0, zorder=1)
    ax.axhline(0, color=INK, linewidth=0.8)
    for curve in look.curves:
        c = colour(curve.material)
        mark = marker(curve.material) if n <= 60 else "none"
        line = linestyle(curve.material)
        ax.plot(x, curve.residual[1], color=c, linewidth=1.1, linestyle=line, marker=mark, markersize=3.5)
    _residual_scale(ax, [c.residual[1] for c in look.curves], look.points.sd)
    ax.set_xlabel("deflection (mm)")
    ax.grid(color=FAINT, linewidth=0.6)
    if first:
        ax.set_ylabel("residual (N)")


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


def _look_legend(looks: Sequence[Look]) -> list[Any]:
    curves = {c.name: c for look in looks for c in look.curves}
    handles: list[Any] = [
        Line2D([], [], color=INK, marker="o", linestyle="none", markersize=4.5, label="measured (bars: 2 sd)")
    ]
    if any(look.rest is not None and look.rest.deflection.size for look in looks):
        handles.append(
            Line2D(
                [], [], color=INK, marker="o", markerfacecolor="white", linestyle="none", markersize=4.5,
                label="measured, not used",
            )
        )  # fmt: skip
    for name, c in curves.items():
        line, mark = linestyle(c.material), marker(c.material)
        handles.append(Line2D([], [], color=colour(c.material), linestyle=line, marker=mark, markersize=4, label=name))
    return handles


def residuals(points: Points, quantiles: Array, material: str, kind: str = "svg") -> Picture:
    """(b) Residuals (3, N) N with their 90 % band, in units of the measurement's own noise; in N if it states none."""
    with _style():
        figure = _figure(3.4)
        ax = figure.subplots()
        scale = points.sd if points.sd is not None else np.ones(points.deflection.size)
        x, z, c = 1e3 * points.deflection, quantiles / scale, colour(material)
        if points.sd is not None:
            ax.axhspan(-2, 2, color=SHADE, zorder=0)
            ax.axhspan(-1, 1, color=FAINT, zorder=0)
        ax.axhline(0, color=INK, linewidth=0.8)
        ax.vlines(x, z[0], z[2], color=c, linewidth=3, alpha=0.4)
        ax.plot(x, z[1], color=c, linewidth=0.8, marker=marker(material), markersize=_marker_size(points) + 0.5)
        largest = float(np.nanmax(np.abs(z))) if np.any(np.isfinite(z)) else 0.0
        reach = 1.1 * (max(largest, 3.0) if points.sd is not None else largest or 1.0)
        ax.set_ylim(-reach, reach)
        ax.set_xlim(left=0)
        ax.set_xlabel("deflection (mm)")
        ax.set_ylabel("measured - computed\n" + ("(noise sd)" if points.sd is not None else "(N)"))
        ax.grid(axis="x", color=FAINT, linewidth=0.6)
        return _encoded(figure, kind)


# ---- draws -----------------------------------------------------------------------------------------------------------


def corner_plot(
    draws: Array,
    names: Sequence[str],
    units: Sequence[str],
    material: str,
    optimum: Sequence[float | None] | None = None,
    published: Sequence[float | None] | None = None,
) -> Picture:
    """(c) Draws (S, m) of the natural parameters, each pair of them, with the optimum and the paper's point."""
    m, c = draws.shape[1], colour(material)
    logarithmic = [_wide(draws[:, i]) for i in range(m)]
    ranges = [_span(draws[:, i], log) for i, log in enumerate(logarithmic)]
    size = WIDTH if m > 2 else 6.0
    with _style({"font.size": 10, "axes.labelsize": 10.5, "xtick.labelsize": 8.5, "ytick.labelsize": 8.5}):
        figure = Figure(figsize=(size, size))
        FigureCanvasAgg(figure)
        level = logging.getLogger().level
        logging.getLogger().setLevel(logging.ERROR)  # corner writes to the root logger when a cell is empty
        corner.corner(
            draws,
            fig=figure,
            labels=[f"{symbol(n)} ({u or '-'})" for n, u in zip(names, units, strict=True)],
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
        _corner_margins(figure, m, size, logarithmic)
        handles = [Line2D([], [], color=c, label="posterior: 50 % and 90 % regions")]
        for values, shade, mark, label in ((optimum, INK, "x", "our optimum"), (published, ALARM, "+", "paper")):
            if values is not None and _mark(figure, m, values, ranges, shade, mark):
                handles.append(
                    Line2D([], [], color=shade, marker=mark, linestyle="none", markersize=8, mew=2, label=label)
                )
        figure.legend(handles=handles, loc="upper right", bbox_to_anchor=(0.985, 0.985))
        return _encoded(figure, "png")


def _corner_margins(figure: Figure, m: int, size: float, logarithmic: Sequence[bool]) -> None:
    """Room for ticks and labels in inches, however many panels there are."""
    left, right, gap = 0.95, 0.1, 0.07
    figure.subplots_adjust(
        left=left / size, bottom=left / size, right=1 - right / size, top=1 - right / size, wspace=gap, hspace=gap
    )
    panel = (size - left - right) / m
    for i, ax in enumerate(np.array(figure.axes).reshape(m, m).flat):
        row, column = divmod(i, m)
        if row < column:
            continue
        if not logarithmic[column]:
            ax.xaxis.set_major_locator(MaxNLocator(3, prune="both"))
        ax.xaxis.set_label_coords(0.5, -0.72 / panel)
        if row > column:
            if not logarithmic[row]:
                ax.yaxis.set_major_locator(MaxNLocator(3, prune="both"))
            ax.yaxis.set_label_coords(-0.72 / panel, 0.5)


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


def traces(
    means: Array, steps: Array, burn_in: float, names: Sequence[str], units: Sequence[str], kind: str = "svg"
) -> Picture:
    """(d) Means over the walkers of each ensemble, (E, T, m), against the step (T,); what is discarded is shaded."""
    m = means.shape[2]
    columns = 1 if m <= 2 else 2
    rows = -(-m // columns)
    keep = np.unique(np.linspace(0, len(steps) - 1, min(len(steps), MOST_POINTS)).astype(int))
    with _style({"lines.linewidth": 0.8}):
        figure = _figure(0.9 + 1.35 * rows)
        grid = figure.subplots(rows, columns, sharex=True, squeeze=False)
        panels = list(grid.T.flat)
        if m < len(panels):  # the free cell is above others, so that every column ends in an axis
            panels.remove(grid[0, -1])
            grid[0, -1].set_visible(False)
        for k, ax in enumerate(panels):
            for e in range(means.shape[0]):
                ax.plot(steps[keep], means[e, keep, k], color=_ENSEMBLES[e % 6], label=f"ensemble {e + 1}")
            if burn_in > steps[0]:
                ax.axvspan(float(steps[0]), burn_in, color=FAINT, zorder=0)
            ax.set_ylabel(f"{symbol(names[k])} ({units[k] or '-'})", fontsize=10)
            ax.yaxis.set_major_locator(MaxNLocator(4))
            ax.margins(x=0)
        for ax in grid[-1]:
            ax.set_xlabel("step of the ensemble (-)")
        handles = panels[0].get_legend_handles_labels()[0]
        if burn_in > steps[0]:
            handles = [*handles, Patch(color=FAINT, label="discarded")]
        figure.legend(handles=handles, loc="outside upper center", ncols=5)
        return _encoded(figure, kind)


@dataclass(frozen=True)
class Marginal:
    """One coordinate: its name and unit, draws of the prior and of the posterior."""

    name: str
    unit: str
    prior: Array
    posterior: Array


def prior_posterior(marginals: Sequence[Marginal], material: str, kind: str = "svg") -> Picture:
    """(h) Prior and posterior of every coordinate, each scaled to its own maximum."""
    columns = min(4, len(marginals))
    rows = -(-len(marginals) // columns)
    with _style():
        figure = _figure(0.7 + 1.9 * rows)
        grid = figure.subplots(rows, columns, squeeze=False)
        for k, ax in enumerate(grid.flat):
            if k >= len(marginals):
                ax.set_visible(False)
                continue
            _marginal(ax, marginals[k], colour(material))
        handles = [Patch(color=FAINT, label="prior"), Patch(color=colour(material), label="posterior")]
        figure.legend(handles=handles, loc="outside upper center", ncols=2)
        return _encoded(figure, kind)


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
    ax.set_xlabel(f"{symbol(marginal.name)} ({marginal.unit or '-'})")
    ax.xaxis.set_major_locator(MaxNLocator(4))
    ax.set_yticks([])
    ax.set_ylim(0, 1.08)
    ax.spines["left"].set_visible(False)


# ---- the film --------------------------------------------------------------------------------------------------------


# Red to blue with the dark ends cut off, so that lines stay visible on it.
_PALE = LinearSegmentedColormap.from_list("pale", mpl.colormaps["RdBu"](np.linspace(0.14, 0.86, 64)))


def convexity_map(
    l1: Array, l2: Array, eigenvalue: Array, deflections: Array, state_1: Array, state_2: Array, material: str
) -> Picture:
    """(e) Least eigenvalue (A, B) of the Hessian over G d at l1 (A,), l2 (B,), and states (D, M) per deflection."""
    with _style():
        figure = _figure(4.3)
        ax = figure.subplots()
        shown = np.ma.masked_invalid(eigenvalue.T)
        size = max(float(np.quantile(np.abs(shown.compressed()), 0.98)) if shown.count() else 1.0, 2.0)
        norm: Any = SymLogNorm(1.0, vmin=-size, vmax=size, base=10) if size > 20 else TwoSlopeNorm(0.0, -size, size)
        ax.set_facecolor("#b9c0c7")
        extent = (float(l1[0]), float(l1[-1]), float(l2[0]), float(l2[-1]))
        mesh = ax.imshow(shown, cmap=_PALE, norm=norm, origin="lower", extent=extent, aspect="auto")
        if shown.count() and shown.min() < 0 < shown.max():
            ax.contour(l1, l2, shown, levels=[0.0], colors=[ALARM], linewidths=1.6)
        shades = mpl.colormaps["cividis"](np.linspace(0.0, 0.92, max(1, deflections.size)))
        alike = bool(np.all(state_1 == state_1[:, :1]))  # a strip has one state at a time
        spot = "o" if alike else ""
        for k in range(deflections.size):
            ax.plot(state_1[k], state_2[k], marker=spot, color="white", linewidth=4)
            name = f"{1e3 * deflections[k]:.3g} mm"
            ax.plot(state_1[k], state_2[k], marker=spot, color=shades[k], linewidth=2.2, label=name)
        ax.set_xlim(float(l1[0]), float(l1[-1]))
        ax.set_ylim(float(l2[0]), float(l2[-1]))
        ax.set_xlabel(f"{'stretch along the pull' if alike else 'meridional stretch'} $\\lambda_1$ (-)")
        ax.set_ylabel(f"{'stretch across it' if alike else 'hoop stretch'} $\\lambda_2$ (-)")
        bar = figure.colorbar(mesh, ax=ax, pad=0.015)
        bar.set_label("least eigenvalue / $Gd$ (-)")
        bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:.4g}"))
        ax.legend(title="reached at", loc="upper right", frameon=True, framealpha=0.9, edgecolor="none")
        ax.set_title(f"{title(material)}: blue is convex, red is not")
        return _encoded(figure, "png")


def profiles(
    deflections: Array, radius: Array, height: Array, inner: float, outer: float, material: str, kind: str = "png"
) -> Picture:
    """(f) Deformed film: radius f and height h, (D, P, M) m, of P draws at D deflections; disc and ring as bars."""
    x, y = 1e3 * radius, 1e3 * height
    c = colour(material)
    with _style():
        top = float(np.nanmax(y)) if np.any(np.isfinite(y)) else 1.0
        figure = _figure(float(np.clip(0.9 + 5.3 * 1.14 * top / (2.35e3 * outer), 2.2, 8.0)), width=6.2)
        ax = figure.subplots()
        width = float(np.clip(15 / y.shape[1], 0.3, 1.0))
        for k in range(deflections.size):
            for side in (-1, 1):
                ax.plot(side * x[k].T, y[k].T, color=c, linewidth=width, alpha=0.35)
            ax.plot(
                [-1e3 * inner, 1e3 * inner], [1e3 * deflections[k]] * 2, color=INK, linewidth=2.5, solid_capstyle="butt"
            )
            ax.text(
                0,
                1e3 * deflections[k] + 0.012 * top,
                f"{1e3 * deflections[k]:.3g} mm",
                ha="center",
                va="bottom",
                fontsize=10,
            )
        for side in (-1, 1):
            ax.plot([side * 1e3 * outer, side * 1.12e3 * outer], [0, 0], color=INK, linewidth=4, solid_capstyle="butt")
        ax.set_aspect("equal")
        ax.set_xlabel("radius (mm)")
        ax.set_ylabel("height (mm)")
        ax.set_xlim(-1.17e3 * outer, 1.17e3 * outer)
        ax.set_ylim(-0.04 * top, 1.1 * top)
        ax.grid(color=FAINT, linewidth=0.6)
        return _encoded(figure, kind)


# ---- several runs ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Interval:
    """One row of an interval plot: label, material, and 5, 50, 95 % (3,); ``note`` stands there if they are nan."""

    label: str
    material: str
    quantiles: Array
    note: str = ""


def break_points(
    specimens: Sequence[str], observed: Array, predicted: Sequence[Sequence[Interval]], kind: str = "svg"
) -> Picture:
    """(g) Forces (S,) N at which specimens broke, and the predictions of each material for each of them."""
    n = max((len(p) for p in predicted), default=1)
    with _style():
        figure = _figure(1.4 + 0.19 * (n + 1.5) * len(specimens))
        ax = figure.subplots()
        _log_force_axis(ax, observed, predicted)
        low, high = ax.get_xlim()
        for s in range(len(specimens)):
            if s % 2:
                ax.axhspan(s - 0.5, s + 0.5, color=SHADE, zorder=0, lw=0)
            ax.plot([observed[s]] * 2, [s - 0.42, s + 0.42], color=INK, linewidth=2.2, zorder=4)
            for k, interval in enumerate(predicted[s]):
                y = s - 0.34 + 0.68 * (k + 0.5) / n
                _interval(ax, interval, y, low, high)
        ax.set_yticks(range(len(specimens)), specimens)
        ax.set_ylim(len(specimens) - 0.5, -0.5)
        ax.set_xlabel("force (N), logarithmic")
        ax.grid(axis="x", which="both", color=FAINT, linewidth=0.5)
        names = {i.material: i for row in predicted for i in row}
        handles = [Line2D([], [], color=INK, linewidth=2.2, label="observed")]
        handles += [Line2D([], [], color=colour(m), marker=marker(m), markersize=5, label=title(m)) for m in names]
        figure.legend(handles=handles, loc="outside upper center", ncols=6, columnspacing=1.2, handlelength=1.6)
        return _encoded(figure, kind)


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


def _interval(ax: Axes, interval: Interval, y: float, low: float, high: float) -> None:
    c, q = colour(interval.material), interval.quantiles
    if not np.any(np.isfinite(q)):
        ax.text(high / 1.03, y, interval.note or "no force", color=c, fontsize=9, va="center", ha="right")
        return
    if q[1] > high or q[1] < low:
        out = f"{q[1]:,.0f} N \u2192" if q[1] > high else f"\u2190 {q[1]:.2g} N"
        edge = high / 1.03 if q[1] > high else low * 1.03
        ax.text(edge, y, out, color=c, fontsize=9, va="center", ha="right" if q[1] > high else "left")
        return
    ax.plot([q[0], q[2]], [y, y], color=c, linewidth=2.4, solid_capstyle="butt", zorder=3)
    ax.plot([q[1]], [y], marker=marker(interval.material), color=c, markersize=5.5, zorder=3.5)


def forest(parameters: Mapping[str, Sequence[Interval]], units: Mapping[str, str], kind: str = "svg") -> Picture:
    """(j) Parameters across runs: one panel per parameter, one row per run; 90 % intervals and medians."""
    names = list(parameters)
    columns = min(3, len(names))
    rows = -(-len(names) // columns)
    tallest = max(len(v) for v in parameters.values())
    with _style():
        figure = _figure(0.5 + rows * (0.75 + 0.27 * tallest))
        grid = figure.subplots(rows, columns, squeeze=False)
        for k, ax in enumerate(grid.flat):
            if k >= len(names):
                ax.set_visible(False)
                continue
            _forest_panel(ax, parameters[names[k]], f"{symbol(names[k])} ({units.get(names[k]) or '-'})")
            if k % columns and _same_labels(parameters[names[k]], parameters[names[k - 1]]):
                ax.tick_params(labelleft=False)
        return _encoded(figure, kind)


def _same_labels(a: Sequence[Interval], b: Sequence[Interval]) -> bool:
    return [i.label for i in a] == [i.label for i in b]


def _forest_panel(ax: Axes, intervals: Sequence[Interval], label: str) -> None:
    for y, interval in enumerate(intervals):
        c, q = colour(interval.material), interval.quantiles
        ax.plot([q[0], q[2]], [y, y], color=c, linewidth=2.4, solid_capstyle="butt")
        ax.plot([q[1]], [y], marker=marker(interval.material), color=c, markersize=6)
    ax.set_yticks(range(len(intervals)), [i.label for i in intervals], fontsize=9.5)
    ax.set_ylim(len(intervals) - 0.5, -0.5)
    ax.xaxis.set_major_locator(MaxNLocator(4))
    ax.set_xlabel(label)
    ax.margins(x=0.08)
    ax.grid(axis="x", color=FAINT, linewidth=0.6)


# ---- the reconstruction ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Recovered:
    """One range of a reconstruction: points with sd, and the probability of each number of points."""

    name: str
    points: Points
    n_points: Mapping[int, float]


@dataclass(frozen=True)
class LossBar:
    """One printed loss: its label, how far the reconstructed curve is from it (N), and whether the row is suspect."""

    label: str
    range: str
    difference: float
    suspect: bool


def reconstruction(ranges: Sequence[Recovered], losses: Sequence[LossBar], kind: str = "svg") -> Picture:
    """(i) The recovered curve, the number of its points, and what it leaves of the printed losses."""
    names = [r.name for r in ranges]
    labels = list(dict.fromkeys(b.label for b in losses))
    with _style():
        figure = _figure(4.2 + 0.5 + 0.23 * len(labels))
        parts: Any = figure.subfigures(2, 1, height_ratios=(4.2, 0.5 + 0.23 * len(labels)))
        top, bottom = parts
        left, right = top.subfigures(1, 2, width_ratios=(1.7, 1))
        _recovered(left.subplots(2, 1, sharex=True, height_ratios=(3, 1)), ranges)
        _counts(right.subplots(), ranges)
        grid = bottom.subplots(1, len(names), sharey=True, squeeze=False)
        for i, name in enumerate(names):
            _loss_bars(grid[0, i], [b for b in losses if b.range == name], labels, name)
        return _encoded(figure, kind)


_RANGE_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")


def _recovered(axes: Sequence[Axes], ranges: Sequence[Recovered]) -> None:
    for i, r in enumerate(ranges):
        x, c, mark = 1e3 * r.points.deflection, _RANGE_COLOURS[i % 4], "os^D"[i % 4]
        axes[0].plot(x, r.points.force, mark, color=c, markersize=4.5, label=r.name)
        if r.points.sd is not None:
            axes[1].plot(x, 1e3 * r.points.sd, mark, color=c, markersize=4.5)
    axes[0].set_ylabel("force (N)")
    axes[0].set_title("Recovered curve")
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
        ax.bar(x, [r.n_points.get(n, 0.0) for n in likely], wide * 0.92, color=_RANGE_COLOURS[i % 4], label=r.name)
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
