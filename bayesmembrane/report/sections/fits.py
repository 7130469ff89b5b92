"""Least squares: the optimum of every fit, with its parameters and its curve."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from bayesmembrane.calibration.fit import Fit
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.stored import read
from bayesmembrane.report.blocks import Block, Column, Figure, Picture, Table, Value, points
from bayesmembrane.report.canvas import encoded, legend_columns, new_figure, style
from bayesmembrane.report.sections.base import Glance, Section, Subject, of_kind
from bayesmembrane.report.style import FAINT, MUTED, PALETTE, LineStyle, Look, look
from bayesmembrane.words.calibration import fit_sentence
from bayesmembrane.words.hypothesis import spoken
from bayesmembrane.words.language import listed, spoken_parameter
from bayesmembrane.words.seen import Seen, in_one_unit, seen_by_fit

LEGEND = 10  # curves of a panel that have a look and a line in the legend
INSIDE, WIDE = 4, 50  # lines of a legend, and letters of each, that cover no curve
LONGEST, OWN = 90, 48  # letters of a line in the legend, and of a folder's name
LINE_HEIGHT = 0.24  # inches


@dataclass(frozen=True, eq=False, repr=False)
class KeptFit(Fit):
    """A fit as it was read from a folder, whose name tells it from others of the same hypothesis."""

    folder: str = ""


@dataclass(frozen=True)
class OnPage:
    """A fit with its number on the page; ``own`` tells it from those of the same hypothesis and range, or is ""."""

    fit: Fit
    number: int
    own: str

    @property
    def name(self) -> str:
        """``Gent``; ``Gent, film-a_gent_35mm_fit_2971`` where there is another."""
        return f"{spoken(self.fit.hypothesis)}, {self.own}" if self.own else spoken(self.fit.hypothesis)

    @property
    def sentence(self) -> str:
        """How far it misses the data."""
        return f"{self.own}: {fit_sentence(self.fit)}" if self.own else fit_sentence(self.fit)

    @property
    def how(self) -> Seen:
        """How its curve is seen."""
        return seen_by_fit(self.fit)

    @property
    def end(self) -> str:
        """How far it was fitted."""
        return self.how.place(float(np.max(self.fit.deflection)))


class FitsSection(Section):
    """All fits side by side, and the parameters of each."""

    name = "fits"
    title = "Least squares"
    order = 35
    shows = Fit
    aside = True

    def reads(self, folder: Path) -> Any | None:
        found = read(folder, "fit")
        if found is None:
            return None
        return KeptFit(**{f.name: getattr(found, f.name) for f in fields(Fit)}, folder=folder.resolve().name)

    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        fits = on_page(results)
        curves = [b for group in in_one_unit(fits, lambda f: f.how) for b in (optima_table(group), _figure(group))]
        tables = [parameters_table(f, alone=len(fits) == 1) for f in fits]
        return [*points([f.sentence for f in fits]), *curves, *tables]

    def answer(self, results: Sequence[Any]) -> Sequence[str]:
        return [f.sentence for f in on_page(results)]

    def glances(self, results: Sequence[Any]) -> Sequence[Glance]:
        return [
            Glance("fit", f"{f.name}, up to {f.end}", f"rms residual {f.how.force(f.fit.rmse_N)}; {f.fit.status}")
            for f in on_page(results)
        ]

    def subject(self, results: Sequence[Any]) -> Subject | None:
        fits = on_page(results)
        return Subject((), f"Least squares by {_names(fits)}.") if fits else None


def on_page(results: Sequence[Any]) -> list[OnPage]:
    """All fits, those apart that would be called alike: by noise and prior, else by their folders or numbers."""
    fits = [OnPage(f, number, "") for number, f in enumerate(of_kind(results, Fit), 1)]
    called = Counter((f.fit.hypothesis.label(), f.end) for f in fits)
    asked = Counter((f.fit.hypothesis.label(), f.end, _asked(f.fit)) for f in fits)
    out = []
    for f in fits:
        name = f.fit.hypothesis.label(), f.end
        own = _asked(f.fit) if asked[*name, _asked(f.fit)] == 1 else _place(f)
        out.append(replace(f, own=own if called[name] > 1 else ""))
    return out


def _asked(f: Fit) -> str:
    return f"{f.hypothesis.noise.name}, {f.hypothesis.convexity.name}"


def _place(shown: OnPage) -> str:
    folder = shown.fit.folder if isinstance(shown.fit, KeptFit) else ""
    if len(folder) > OWN:
        folder = f"{folder[: OWN // 2]}...{folder[-OWN // 2 :]}"
    return folder or f"fit {shown.number}"


def _names(fits: Sequence[OnPage]) -> str:
    return listed(dict.fromkeys(spoken(f.fit.hypothesis) for f in fits))


def _figure(fits: Sequence[OnPage]) -> Figure:
    """The fitted curves of fits that are read in the same units."""
    how = fits[0].how
    return Figure(
        curves_picture(fits),
        alt=f"Fitted {how.load} against {how.travel} by {_names(fits)}",
        caption=f"Fitted {how.load_label} against {how.travel_label} at the points of the test, one panel for each "
        f"range; the legend tells the root mean square of {how.origin} minus fitted {how.load}.",
    )


def optima_table(fits: Sequence[OnPage]) -> Table:
    """One row for each fit; all are read in the same units."""
    how = fits[0].how
    load, small = how.load_scale[1], how.small[1]
    columns = (
        Column("model", "model"),
        Column("which", "which"),
        Column("end_mm" if not how.bare else "end", f"fitted up to, {how.travel_label}"),
        Column("loss", "loss"),
        Column(f"loss_{load}", f"loss ({load})"),
        Column(f"rmse_{small}", f"rms residual ({small})", ".3g"),
        Column(f"max_{small}", f"largest residual ({small})", ".3g"),
        Column(f"convex_loss_{load}", f"loss under the convexity prior ({load})"),
        Column("convex", "convex"),
        Column("at_bound", "at a bound"),
        Column("status", "status"),
    )
    rows = tuple(map(_optimum, fits))
    caption = (
        f"Optima of each model: losses are Euclidean norms of {how.origin} minus computed {how.load_label}."
        " Convex: whether the energy meets the convexity prior where the film goes."
    )
    return Table("optima", caption, columns, rows).without_empty()


def _optimum(shown: OnPage) -> tuple[Value, ...]:
    f, how = shown.fit, shown.how
    load, small = how.load_scale[0], how.small[0]
    return (
        spoken(f.hypothesis),
        shown.own or None,
        float(np.max(how.along(f.deflection))),
        f.loss,
        load * f.loss_N,
        small * f.rmse_N,
        small * f.max_N,
        load * f.constrained.loss_N if f.constrained is not None else None,
        f.convex,
        ", ".join(spoken_parameter(n) for n in f.at_bound) or None,
        f.status,
    )


def parameters_table(shown: OnPage, alone: bool) -> Table:
    """The natural parameters of one fit, and under the convexity prior where that changes them."""
    f = shown.fit
    held = None if f.convex else f.constrained
    columns = (
        Column("parameter", "parameter"),
        Column("unit", "unit"),
        Column("value", "least squares", ".5g"),
        Column("sd", "sd", ".2g"),
        Column("convex", "least squares, convex", ".5g"),
        Column("convex_sd", "sd", ".2g"),
    )
    rows = tuple(
        (
            spoken_parameter(name),
            e.unit,
            e.value,
            e.sd,
            held.parameters[name].value if held else None,
            held.parameters[name].sd if held else None,
        )
        for name, e in f.parameters.items()
    )
    caption = f"{shown.name}, fitted up to {shown.end}: parameters with their standard deviations."
    return Table("optimum" if alone else f"optimum {shown.number}", caption, columns, rows).without_empty()


# ---- the picture -----------------------------------------------------------------------------------------------------


def curves_picture(fits: Sequence[OnPage], kind: str = "svg") -> Picture:
    """The fitted curves, one panel for each range: curves over different points do not belong into one.

    All are read in the same units. A legend of many lines stands below its panel.
    """
    how = fits[0].how
    panels = [curves_of([f for f in fits if f.end == end]) for end in dict.fromkeys(f.end for f in fits)]
    below = max(_lines_below(curves) for curves in panels)
    with style():
        figure = new_figure((4.2 + LINE_HEIGHT * below) * len(panels))
        axes = figure.subplots(len(panels), 1, squeeze=False)[:, 0]
        axes[-1].set_xlabel(how.travel_label)
        for ax, curves in zip(axes, panels, strict=True):
            for curve in curves:
                _draw(ax, curve)
            if len(panels) > 1:
                ax.set_title(f"Fitted up to {curves[0].of.end}")
            ax.set_ylabel(how.load_label)
            ax.set_xlim(left=min([how.rest, *(float(np.min(c.along)) for c in curves)]))
            ax.grid(color=FAINT, linewidth=0.6)
            _legend(ax, curves)
        return encoded(figure, kind)


@dataclass(frozen=True)
class FitCurve:
    """A fit in a panel: how it looks, None for thin and grey; ``label`` is its line in the legend, or ""."""

    of: OnPage
    look: Look | None
    label: str

    @property
    def along(self) -> Array:
        return self.of.how.along(self.of.fit.deflection)


def curves_of(fits: Sequence[OnPage]) -> list[FitCurve]:
    """The curves of a panel: `LEGEND` at most have a look, of which no two are alike, the first of each name first."""
    met = Counter[str]()
    turns = []
    for f in fits:
        turns.append(met[f.fit.hypothesis.label()])
        met[f.fit.hypothesis.label()] += 1
    told = sorted(sorted(range(len(fits)), key=lambda i: (turns[i], i))[:LEGEND])
    looks = [look(fits[i].fit.hypothesis.material.name) for i in told]
    if len(set(looks)) < len(looks):
        looks = list(PALETTE[: len(looks)])
    labels = [f"{fits[i].name} (rms {fits[i].how.force(fits[i].fit.rmse_N)})" for i in told]
    curves = [FitCurve(fits[i], own, textwrap.fill(s, LONGEST)) for i, own, s in zip(told, looks, labels, strict=True)]
    more = [f for i, f in enumerate(fits) if i not in told]
    words = f"{len(more)} more, which the table lists"
    return curves + [FitCurve(f, None, "" if i else words) for i, f in enumerate(more)]


def _draw(ax: Axes, curve: FitCurve) -> None:
    f, own = curve.of.fit, curve.look
    path = f.rig is None or f.rig.has_path
    dashes: LineStyle = (0.0, own.dashes) if own is not None and own.dashes else "-"
    ax.plot(
        curve.along,
        curve.of.how.carried(f.force),
        color=MUTED if own is None else own.colour,
        linestyle=dashes if path else "none",
        linewidth=0.6 if own is None else 1.8,
        marker=(own.marker if own is not None else "" if path else ".") if f.deflection.size <= 60 or not path else "",
        markersize=4,
        zorder=1.9 if own is None else 2.0,
        label=curve.label or None,
    )


def _legend(ax: Axes, curves: Sequence[FitCurve]) -> None:
    if not _lines_below(curves):
        ax.legend(loc="upper left")
        return
    place = (0.0, -0.17 if ax.get_xlabel() else -0.1)
    ax.legend(loc="upper left", bbox_to_anchor=place, borderaxespad=0.0, ncols=_columns(curves))


def _lines_below(curves: Sequence[FitCurve]) -> int:
    """How many lines a legend has, if it would cover the curves; 0 if it has room among them."""
    labels = [c.label for c in curves if c.label]
    rows = -(-len(labels) // _columns(curves)) + sum(label.count("\n") for label in labels)
    return rows if len(labels) > INSIDE or max(map(len, labels)) > WIDE else 0


def _columns(curves: Sequence[FitCurve]) -> int:
    return legend_columns([c.label for c in curves], 3)
