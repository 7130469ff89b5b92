"""Pictures of one run's film: residuals, the map of its convexity, and its deformed shapes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.colors import LinearSegmentedColormap, SymLogNorm, TwoSlopeNorm
from matplotlib.ticker import FuncFormatter

from bayesmembrane.ground.parameters import Array
from bayesmembrane.report.blocks import Picture
from bayesmembrane.report.canvas import Measured, encoded, new_figure, style
from bayesmembrane.report.style import ALARM, FAINT, INK, SHADE, colour, marker
from bayesmembrane.words.hypothesis import material_title
from bayesmembrane.words.seen import DISC, Seen


def residual_picture(points: Measured, quantiles: Array, look: str, kind: str = "svg") -> Picture:
    """Residuals (3, N) N with their 90 % band, in units of the measurement's own noise; in N if it states none."""
    with style():
        figure = new_figure(3.4)
        ax = figure.subplots()
        how = points.how
        z = quantiles / points.sd if points.sd is not None else how.carried(quantiles)
        x, c = how.along(points.deflection), colour(look)
        if points.sd is not None:
            ax.axhspan(-2, 2, color=SHADE, zorder=0)
            ax.axhspan(-1, 1, color=FAINT, zorder=0)
        ax.axhline(0, color=INK, linewidth=0.8)
        ax.vlines(x, z[0], z[2], color=c, linewidth=3, alpha=0.4)
        ax.plot(x, z[1], color=c, linewidth=0.8, marker=marker(look), markersize=points.marker_size + 0.5)
        largest = float(np.nanmax(np.abs(z))) if np.any(np.isfinite(z)) else 0.0
        reach = 1.1 * (max(largest, 3.0) if points.sd is not None else largest or 1.0)
        ax.set_ylim(-reach, reach)
        ax.set_xlim(left=how.rest)
        ax.set_xlabel(how.travel_label)
        unit = "noise sd" if points.sd is not None else how.load_scale[1]
        ax.set_ylabel(f"{how.origin} - computed\n({unit})")
        ax.grid(axis="x", color=FAINT, linewidth=0.6)
        return encoded(figure, kind)


# Red to blue with the dark ends cut off, so that lines stay visible on it.
_PALE = LinearSegmentedColormap.from_list("pale", mpl.colormaps["RdBu"](np.linspace(0.14, 0.86, 64)))


@dataclass(frozen=True, eq=False)
class Plane:
    """Least ``eigenvalue`` (A, B) of the Hessian over G d at stretches l1 (A,), l2 (B,), and the states (D, M) that the
    film passes at the deflections ``at`` (D,) m.
    """

    l1: Array
    l2: Array
    eigenvalue: Array
    at: Array
    state_1: Array
    state_2: Array
    how: Seen = DISC


def convexity_map(plane: Plane, material: str) -> Picture:
    """Where the energy is convex, and where the film goes."""
    l1, l2, deflections, state_1, state_2 = plane.l1, plane.l2, plane.at, plane.state_1, plane.state_2
    with style():
        figure = new_figure(4.3)
        ax = figure.subplots()
        shown = np.ma.masked_invalid(plane.eigenvalue.T)
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
            value = plane.how.rest + plane.how.travel_scale[0] * float(deflections[k])
            name = f"{value:.3g}" if plane.how.bare else f"{value:.3g} {plane.how.travel_scale[1]}"
            ax.plot(state_1[k], state_2[k], marker=spot, color=shades[k], linewidth=2.2, label=name)
        ax.set_xlim(float(l1[0]), float(l1[-1]))
        ax.set_ylim(float(l2[0]), float(l2[-1]))
        ax.set_xlabel(f"{'stretch along the pull' if alike else 'meridional stretch'} $\\lambda_1$ (-)")
        ax.set_ylabel(f"{'stretch across it' if alike else 'hoop stretch'} $\\lambda_2$ (-)")
        bar = figure.colorbar(mesh, ax=ax, pad=0.015)
        bar.set_label("least eigenvalue / $Gd$ (-)")
        bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:.4g}"))
        ax.legend(
            title=f"reached at a {plane.how.travel} of" if plane.how.bare else "reached at",
            loc="upper right",
            frameon=True,
            framealpha=0.9,
            edgecolor="none",
        )
        ax.set_title(f"{material_title(material)}: blue is convex, red is not")
        return encoded(figure, "png")


@dataclass(frozen=True, eq=False)
class LiftedFilms:
    """Deformed film: radius f and height h, (D, P, M) m, of P draws at the deflections ``at`` (D,) m, between the radii
    of disc and ring, m.
    """

    at: Array
    radius: Array
    height: Array
    inner: float
    outer: float


def profiles(shapes: LiftedFilms, look: str, kind: str = "png") -> Picture:
    """The deformed film; disc and ring as bars."""
    x, y, deflections = 1e3 * shapes.radius, 1e3 * shapes.height, shapes.at
    inner, outer, c = shapes.inner, shapes.outer, colour(look)
    with style():
        top = float(np.nanmax(y)) if np.any(np.isfinite(y)) else 1.0
        figure = new_figure(float(np.clip(0.9 + 5.3 * 1.14 * top / (2.35e3 * outer), 2.2, 8.0)), width=6.2)
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
        return encoded(figure, kind)
