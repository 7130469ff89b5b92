"""Least squares: the optimum of every fit, with its parameters and its curve."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.calibration.fit import Fit
from bayesmembrane.ground.stored import read
from bayesmembrane.report.blocks import Block, Column, Figure, Picture, Table, points
from bayesmembrane.report.canvas import encoded, new_figure, style
from bayesmembrane.report.sections.base import Glance, Section, Subject, of_kind
from bayesmembrane.report.style import FAINT, colour, linestyle, marker
from bayesmembrane.words.calibration import fit_sentence
from bayesmembrane.words.hypothesis import spoken, spoken_apart
from bayesmembrane.words.language import listed, newtons, spoken_parameter


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
        figure = Figure(
            curves_picture(fits),
            alt=f"Fitted force against deflection by {listed(_names(fits))}",
            caption="Fitted force (N) against deflection (mm) at the measured points; the legend tells the root mean "
            "square of measured minus fitted force.",
        )
        tables = [parameters_table(f, number if len(fits) > 1 else 0) for number, f in enumerate(fits, 1)]
        return [*points([fit_sentence(f) for f in fits]), optima_table(fits), figure, *tables]

    def answer(self, results: Sequence[Any]) -> Sequence[str]:
        return [fit_sentence(f) for f in of_kind(results, Fit)]

    def glances(self, results: Sequence[Any]) -> Sequence[Glance]:
        return [
            Glance("fit", f"{spoken(f.hypothesis)}, up to {_end(f)}", f"rms residual {newtons(f.rmse_N)}; {f.status}")
            for f in of_kind(results, Fit)
        ]

    def subject(self, results: Sequence[Any]) -> Subject | None:
        fits = of_kind(results, Fit)
        return Subject((), f"Least squares by {listed(_names(fits))}.") if fits else None


def _names(fits: Sequence[Fit]) -> list[str]:
    return list(dict.fromkeys(spoken_apart([f.hypothesis for f in fits])))


def _end(f: Fit) -> str:
    return f"{1e3 * float(np.max(f.deflection)):.4g} mm"


def optima_table(fits: Sequence[Fit]) -> Table:
    """One row for each fit."""
    columns = (
        Column("model", "model"),
        Column("end_mm", "fitted up to (mm)"),
        Column("loss", "loss"),
        Column("loss_N", "loss (N)"),
        Column("rmse_mN", "rms residual (mN)", ".3g"),
        Column("max_mN", "largest residual (mN)", ".3g"),
        Column("convex_loss_N", "loss under the convexity prior (N)"),
        Column("convex", "convex"),
        Column("at_bound", "at a bound"),
        Column("status", "status"),
    )
    rows = tuple(
        (
            spoken(f.hypothesis),
            1e3 * float(np.max(f.deflection)),
            f.loss,
            f.loss_N,
            1e3 * f.rmse_N,
            1e3 * f.max_N,
            f.constrained.loss_N if f.constrained is not None else None,
            f.convex,
            ", ".join(spoken_parameter(n) for n in f.at_bound) or None,
            f.status,
        )
        for f in fits
    )
    caption = (
        "Optima of each model: losses are Euclidean norms of measured minus computed force (N). Convex: whether the "
        "energy meets the convexity prior where the film goes."
    )
    return Table("optima", caption, columns, rows).without_empty()


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
    """The fitted curves."""
    with style():
        figure = new_figure(4.2)
        ax = figure.subplots()
        for name, f in zip(spoken_apart([f.hypothesis for f in fits]), fits, strict=True):
            material = f.hypothesis.material.name
            ax.plot(
                1e3 * f.deflection,
                f.force,
                color=colour(material),
                linestyle=linestyle(material),
                marker=marker(material) if f.deflection.size <= 60 else "",
                markersize=4,
                label=f"{name} (rms {newtons(f.rmse_N)})",
            )
        ax.set_xlabel("deflection (mm)")
        ax.set_ylabel("force (N)")
        ax.set_xlim(left=0)
        ax.grid(color=FAINT, linewidth=0.6)
        ax.legend(loc="upper left")
        return encoded(figure, kind)
