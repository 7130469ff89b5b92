"""What pictures share: their look, their size, how they are encoded, and what several sections draw.

Arrays come in SI units; axes are in mm and N, or in stretch and MPa. A picture is drawn 900 px wide, so that nothing in
it is too small on a page; curves are SVG, clouds and maps PNG. The pictures of a section are in that section.
"""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from bayesmembrane.ground.parameters import Array
from bayesmembrane.report.blocks import Picture
from bayesmembrane.report.style import INK, MUTED, colour, marker
from bayesmembrane.words.seen import DISC, Seen

WIDTH = 9.0  # inches: 900 px at 100 dpi
DPI = 120
COLOURS = 256  # of a PNG: those nearest to what was drawn look the same, in a third of the bytes
MOST_SVG = 60_000  # bytes: a drawing of so many marks is a cloud, and smaller as one
LINE = 112  # letters of a legend that fit into the width
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


def style(changes: dict[str, Any] | None = None) -> AbstractContextManager[None]:
    """Everything that is drawn within looks alike."""
    settings: Any = {**_RC, **(changes or {})}
    return mpl.rc_context(settings)


def new_figure(height: float, width: float = WIDTH, layout: Literal["constrained"] | None = "constrained") -> Figure:
    """An empty figure, in inches, that belongs to no window."""
    figure = Figure(figsize=(width, height), layout=layout)
    FigureCanvasAgg(figure)
    return figure


def encoded(figure: Figure, kind: str) -> Picture:
    """The same figure always gives the same bytes: no date, no random names. A large SVG becomes a PNG."""
    if kind == "svg":
        drawn = _clips_numbered(_PLACE.sub(_rounded, _saved(figure, "svg", {"Date": None})))
        if len(drawn) <= MOST_SVG:
            return Picture(drawn, "svg")
    return Picture(_in_few_colours(_saved(figure, "png", {"Software": None})), "png")


def _saved(figure: Figure, kind: str, metadata: dict[str, None]) -> bytes:
    out = io.BytesIO()
    with style():
        figure.savefig(out, format=kind, dpi=DPI, metadata=metadata)
    return out.getvalue()


def _in_few_colours(data: bytes) -> bytes:
    """A PNG with a palette."""
    out = io.BytesIO()
    with Image.open(io.BytesIO(data)) as whole:
        few = whole.convert("RGB").quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    few.save(out, format="png", optimize=True)
    return out.getvalue()


def legend_columns(names: Sequence[str], most: int) -> int:
    """How many columns of a legend fit side by side, ``most`` at most."""
    widest = max((len(name) for name in names), default=1)
    return max(1, min(most, LINE // (widest + 8)))


_PLACE = re.compile(rb' (?:d|x|y|width|height)="[^"]*"')
_LONG = re.compile(rb"-?\d+\.\d{3,}")
_ZERO = re.compile(rb"-(0(?:\.0+)?)(?=[\s\"])")  # the sign of nothing is round-off
_CLIP = re.compile(rb'(?<=[#"])p[0-9a-f]{10}(?=[)"])')


def _clips_numbered(data: bytes) -> bytes:
    """matplotlib names a clip path by where it lies in memory: its number in the picture is the same every time."""
    names: dict[bytes, bytes] = {}
    return _CLIP.sub(lambda name: names.setdefault(name[0], b"p%d" % len(names)), data)


def _rounded(place: re.Match[bytes]) -> bytes:
    """Coordinates with two decimals: a hundredth of a point is not seen, and halves the file."""
    return _ZERO.sub(rb"\1", _LONG.sub(lambda number: b"%.2f" % float(number[0]), place[0]))


# ---- measured points and bands ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Measured:
    """Measured points: deflection (N,) m, force (N,) N, own standard deviation (N,) N or None; how it is seen."""

    deflection: Array
    force: Array
    sd: Array | None = None
    how: Seen = DISC

    @property
    def marker_size(self) -> float:
        """Few points are drawn large."""
        return 4.5 if self.deflection.size <= 60 else 2.0


def errorbars(ax: Axes, points: Measured, filled: bool = True) -> None:
    """Points with two standard deviations to either side; hollow if they were not used."""
    ax.errorbar(
        points.how.along(points.deflection),
        points.how.carried(points.force),
        None if points.sd is None else points.how.carried(2 * points.sd),
        fmt="o",
        color=INK,
        markersize=points.marker_size,
        markerfacecolor=INK if filled else "white",
        markeredgewidth=0.9,
        elinewidth=0.9,
        capsize=2,
        zorder=5,
    )


@dataclass(frozen=True)
class Shade:
    """How a band is filled: colour, opacity, and hatching if it is no more than an extrapolation."""

    colour: str
    alpha: float
    hatch: str | None = None


def band(ax: Axes, x: Array, quantiles: Array, where: NDArray[np.bool_], shade: Shade) -> None:
    """The area between the first and the last of ``quantiles`` (Q, G) over x (G,), where ``where`` (G,) is True."""
    face = mpl.colors.to_rgb(shade.colour)
    ax.fill_between(
        x,
        quantiles[0],
        quantiles[-1],
        where=where,
        facecolor=(*face, shade.alpha),
        edgecolor=(*face, 0.45) if shade.hatch else "none",
        hatch=shade.hatch,
        lw=0,
    )


# ---- intervals -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Interval:
    """One row of an interval plot: label, look, and 5, 50, 95 % (3,); ``note`` stands there if they are nan."""

    label: str
    look: str
    quantiles: Array
    note: str = ""


def draw_interval(ax: Axes, interval: Interval, y: float, size: float = 6.0) -> None:
    """A bar for the 90 % and a marker for the median, in its colour."""
    c, q = colour(interval.look), interval.quantiles
    ax.plot([q[0], q[2]], [y, y], color=c, linewidth=2.4, solid_capstyle="butt", zorder=3)
    ax.plot([q[1]], [y], marker=marker(interval.look), color=c, markersize=size, zorder=3.5)
