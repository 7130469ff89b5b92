"""Least squares: the optimum of every fit, with its parameters and its curve."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from bayesmembrane.calibration.fit import Fit
from bayesmembrane.ground.stored import read
from bayesmembrane.report.blocks import Block, Column, Figure, Picture, Table, Value, points
from bayesmembrane.report.canvas import encoded, new_figure, style
from bayesmembrane.report.sections.base import Glance, Section, Subject, of_kind
from bayesmembrane.report.style import FAINT, colour, linestyle, marker
from bayesmembrane.words.calibration import fit_sentence
from bayesmembrane.words.hypothesis import spoken, spoken_apart
from bayesmembrane.words.language import listed, spoken_parameter
from bayesmembrane.words.seen import in_one_unit, seen_by_fit


class FitsSection(Section):
    """All fits side by side, and the parameters of each."""

    name = "fits"
    title = "Least squares"
    order = 35
    shows = Fit
    aside = True

    def reads(self, folder: Path) -> Any | None:
        return read(folder, "fit")

    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        fits = of_kind(results, Fit)
        if not fits:
            return ()
        curves = [b for group in in_one_unit(fits, seen_by_fit) for b in (optima_table(group), _figure(group))]
        tables = [parameters_table(f, number if len(fits) > 1 else 0) for number, f in enumerate(fits, 1)]
        return [*points([fit_sentence(f) for f in fits]), *curves, *tables]

    def answer(self, results: Sequence[Any]) -> Sequence[str]:
        return [fit_sentence(f) for f in of_kind(results, Fit)]

    def glances(self, results: Sequence[Any]) -> Sequence[Glance]:
        return [
            Glance(
                "fit",
                f"{spoken(f.hypothesis)}, up to {_end(f)}",
                f"rms residual {seen_by_fit(f).force(f.rmse_N)}; {f.status}",
            )
            for f in of_kind(results, Fit)
        ]

    def subject(self, results: Sequence[Any]) -> Subject | None:
        fits = of_kind(results, Fit)
        return Subject((), f"Least squares by {listed(_names(fits))}.") if fits else None


def _names(fits: Sequence[Fit]) -> list[str]:
    return list(dict.fromkeys(spoken_apart([f.hypothesis for f in fits])))


def _end(f: Fit) -> str:
    return seen_by_fit(f).place(float(np.max(f.deflection)))


def _figure(fits: Sequence[Fit]) -> Figure:
    """The fitted curves of fits that are read in the same units."""
    how = seen_by_fit(fits[0])
    return Figure(
        curves_picture(fits),
        alt=f"Fitted {how.load} against {how.travel} by {listed(_names(fits))}",
        caption=f"Fitted {how.load_label} against {how.travel_label} at the points of the test, one panel for each "
        f"range; the legend tells the root mean square of {how.origin} minus fitted {how.load}.",
    )


def optima_table(fits: Sequence[Fit]) -> Table:
    """One row for each fit; all are read in the same units."""
    how = seen_by_fit(fits[0])
    load, small = how.load_scale[1], how.small[1]
    columns = (
        Column("model", "model"),
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


def _optimum(f: Fit) -> tuple[Value, ...]:
    how = seen_by_fit(f)
    load, small = how.load_scale[0], how.small[0]
    return (
        spoken(f.hypothesis),
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


def parameters_table(f: Fit, number: int) -> Table:
    """The natural parameters of one fit, and under the convexity prior where that changes them."""
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
    caption = f"{spoken(f.hypothesis)}, fitted up to {_end(f)}: parameters with their standard deviations."
    return Table(f"optimum{f' {number}' if number else ''}", caption, columns, rows).without_empty()


def curves_picture(fits: Sequence[Fit], kind: str = "svg") -> Picture:
    """The fitted curves, one panel for each range: curves over different points do not belong into one.

    All are read in the same units.
    """
    how = seen_by_fit(fits[0])
    ends = list(dict.fromkeys(_end(f) for f in fits))
    with style():
        figure = new_figure(4.2 * len(ends))
        panels = figure.subplots(len(ends), 1, squeeze=False)[:, 0]
        for ax, end in zip(panels, ends, strict=True):
            own = [f for f in fits if _end(f) == end]
            _curves(ax, own)
            if len(ends) > 1:
                ax.set_title(f"Fitted up to {end}")
            ax.set_ylabel(how.load_label)
            ax.set_xlim(left=min([how.rest, *(float(np.min(seen_by_fit(f).along(f.deflection))) for f in own)]))
            ax.grid(color=FAINT, linewidth=0.6)
            ax.legend(loc="upper left")
        panels[-1].set_xlabel(how.travel_label)
        return encoded(figure, kind)


def _curves(ax: Axes, fits: Sequence[Fit]) -> None:
    for name, f in zip(spoken_apart([f.hypothesis for f in fits]), fits, strict=True):
        material, how = f.hypothesis.material.name, seen_by_fit(f)
        path = f.rig is None or f.rig.has_path
        ax.plot(
            how.along(f.deflection),
            how.carried(f.force),
            color=colour(material),
            linestyle=linestyle(material) if path else "none",
            marker=marker(material) if f.deflection.size <= 60 or not path else "",
            markersize=4,
            label=f"{name} (rms {how.force(f.rmse_N)})",
        )
