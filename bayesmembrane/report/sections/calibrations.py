"""The calibrations side by side: how well each fits, losses beside the paper's, parameters across ranges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from bayesmembrane.calibration.beside_paper import Compared
from bayesmembrane.diagnosis.loop import Loop
from bayesmembrane.ground.stored import read
from bayesmembrane.report.blocks import PLAIN, Block, Column, Figure, Picture, Table, Text, points
from bayesmembrane.report.canvas import Interval, draw_interval, encoded, new_figure, style
from bayesmembrane.report.runs import Shown, cases, end_column, ends, in_order
from bayesmembrane.report.sections.base import Section, Subject, of_kind
from bayesmembrane.report.style import FAINT, with_unit
from bayesmembrane.words.beside_paper import LossPair, losses
from bayesmembrane.words.calibration import answer, details, overview, verdict
from bayesmembrane.words.hypothesis import material_title
from bayesmembrane.words.language import listed, millimetres, spoken_parameter
from bayesmembrane.words.seen import in_one_unit


class CalibrationsSection(Section):
    """What describes which range, how stiff the film is, and whether one set of parameters serves several ranges."""

    name = "comparison"
    title = "Comparison"
    order = 40
    shows = Compared

    def reads(self, folder: Path) -> Any | None:
        return read(folder, "beside_paper")

    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        shown = in_order(of_kind(results, Shown))
        beside = sorted(of_kind(results, Compared), key=lambda c: (c.material, c.end))
        out: list[Block] = []
        if shown:
            out += [*points(details(cases(shown))), *map(fits_table, in_one_unit(shown, lambda s: s.how))]
        if beside:
            told = losses(
                [LossPair(material_title(c.material), f"the range {_up_to(c)}", c.ours, c.evaluated) for c in beside]
            )
            out += [*([Text(told)] if told else []), losses_table(beside)]
        for _, group in groupby(sorted(shown, key=lambda s: s.hypothesis.label()), lambda s: s.hypothesis.label()):
            every = in_one_unit(sorted(group, key=lambda s: s.digest.end), lambda s: s.how)
            out += [_forest(runs) for runs in every if len(runs) > 1]
        return out

    def answer(self, results: Sequence[Any]) -> Sequence[str]:
        shown = in_order(of_kind(results, Shown))
        return [*answer(cases(shown)), *refuted(shown, of_kind(results, Loop))] if shown else ()

    def subject(self, results: Sequence[Any]) -> Subject | None:
        shown = in_order(of_kind(results, Shown))
        if not shown:
            return None
        films = tuple(dict.fromkeys(s.film.name for s in shown))
        curves = list(dict.fromkeys(s.how.curve for s in shown))
        return Subject(films, overview(cases(shown)), curves[0] if len(curves) == 1 else "force curve")


def refuted(shown: Sequence[Shown], loops: Sequence[Loop]) -> list[str]:
    """Of runs that no stated noise judges: which of them miss something by the diagnosis of their loop."""
    missing = {
        (r.before.run.measurement.data_hash, r.before.run.hypothesis.label())
        for found in loops
        for r in found.rounds
        if r.diagnosis.verdict != "adequate" and not r.diagnosis.detection.adequate
    }
    told = [s for s in shown if s.case.verdict == "unknown" and (s.data_hash, s.hypothesis.label()) in missing]
    return [
        f"{s.name} misses something by its diagnosis (above): this modulus, and what {s.name} predicts, are those of a "
        "film in which nothing else is at work."
        for s in told
    ]


# ---- tables ----------------------------------------------------------------------------------------------------------


def fits_table(shown: Sequence[Shown]) -> Table:
    """How well each run's curve fits, judged by the measurement's own noise; all are read in the same units."""
    unit, whole = shown[0].how.small[1], shown[0].how.load_scale[1]
    columns = (
        Column("run", "material"),
        end_column(shown),
        Column("points", "points", "d"),
        Column("parameters", "parameters", "d"),
        Column(f"rmse_{unit}", f"rms residual ({unit})", PLAIN),
        Column(f"max_{unit}", f"largest residual ({unit})", PLAIN),
        Column(f"loss_{whole}", f"loss ({whole})"),
        Column(f"own_noise_{unit}", f"stated noise ({unit})", PLAIN),
        Column(f"extra_noise_{unit}", f"inferred extra noise ({unit})", PLAIN),
        Column("reduced_chi2", "reduced chi-square", ".3g"),
        Column("p_value", "p-value", "p"),
        Column("verdict", "verdict"),
    )
    rows = []
    for s, end in zip(shown, ends(shown), strict=True):
        fit, case, small, large = s.goodness, s.case, s.how.small[0], s.how.load_scale[0]
        rows.append(
            (
                s.name,
                end,
                int(s.digest.at.size),
                s.hypothesis.curve_size,
                small * (fit["rmse_N"] or 0.0),
                small * (fit["max_N"] or 0.0),
                _times(large, fit["loss_N"]),
                _times(small, fit["own_noise_N"]),
                _times(small, case.extra_noise),
                fit["reduced_chi2"],
                fit["p_value"],
                verdict(case),
            )
        )
    return Table(
        "fits",
        "Residuals of the most probable draw of each run. Chi-square and "
        "p-value use the noise that the measurement states, never the inferred one.",
        columns,
        tuple(rows),
    )


def _times(factor: float, value: float | None) -> float | None:
    return None if value is None else factor * value


def _up_to(c: Compared) -> str:
    return f"up to {millimetres(c.end)}"


def losses_table(compared: Sequence[Compared]) -> Table:
    """Our losses beside the paper's."""
    columns = (
        Column("material", "material"),
        Column("range", "range"),
        Column("ours_N", "ours", ".5g"),
        Column("ours_convex_N", "ours, convex on reached states", ".5g"),
        Column("paper_printed_N", "paper, printed", ".5g"),
        Column("paper_evaluated_N", "paper's parameters, re-evaluated", ".5g"),
        Column("ratio", "ours / re-evaluated (-)", ".3f"),
        Column("at_bound", "at a bound"),
    )
    rows = tuple(
        (
            material_title(c.material),
            _up_to(c),
            c.ours,
            c.constrained,
            c.printed,
            c.evaluated,
            c.ours / c.evaluated if c.evaluated else None,
            ", ".join(spoken_parameter(n) for n in c.at_bound) or None,
        )
        for c in compared
    )
    caption = (
        "Losses in N: Euclidean norm of measured minus computed force over the points of a range. Re-evaluated: the "
        "paper's optimum of that range, with our solver, on the reconstructed curve."
    )
    return Table("losses", caption, columns, rows).without_empty()


# ---- parameters across ranges ----------------------------------------------------------------------------------------


def _forest(runs: Sequence[Shown]) -> Figure:
    h = runs[0].hypothesis
    parameters = {name: [_interval(s, i) for s in runs] for i, name in enumerate(h.natural_names)}
    units = {n: runs[0].read_as(n, u)[1] for n, u in zip(h.natural_names, h.natural_units, strict=True)}
    reach = listed(s.end for s in runs)
    names = listed(f"{spoken_parameter(n)} ({units[n]})" for n in parameters)
    return Figure(
        forest_picture(parameters, units),
        alt=f"Intervals of the parameters of {runs[0].name} fitted up to {reach}",
        caption=f"{runs[0].name}: medians and 90 % intervals of {names}, fitted up to {reach}. Intervals that do not "
        "overlap say that one set of parameters cannot serve both ranges.",
    )


def _interval(s: Shown, i: int) -> Interval:
    """The 90 % interval of one natural parameter, as people read it."""
    factor, _ = s.read_as(s.hypothesis.natural_names[i], s.hypothesis.natural_units[i])
    return Interval(s.end, s.look, factor * np.quantile(s.natural[:, i], (0.05, 0.5, 0.95)))


def forest_picture(
    parameters: Mapping[str, Sequence[Interval]], units: Mapping[str, str], kind: str = "svg"
) -> Picture:
    """Parameters across runs: one panel per parameter, one row per run; 90 % intervals and medians."""
    names = list(parameters)
    columns = min(3, len(names))
    rows = -(-len(names) // columns)
    tallest = max(len(v) for v in parameters.values())
    with style():
        figure = new_figure(0.5 + rows * (0.75 + 0.27 * tallest))
        grid = figure.subplots(rows, columns, squeeze=False)
        for k, ax in enumerate(grid.flat):
            if k >= len(names):
                ax.set_visible(False)
                continue
            _forest_panel(ax, parameters[names[k]], with_unit(names[k], units.get(names[k]) or "-"))
            if k % columns and _same_labels(parameters[names[k]], parameters[names[k - 1]]):
                ax.tick_params(labelleft=False)
        return encoded(figure, kind)


def _same_labels(a: Sequence[Interval], b: Sequence[Interval]) -> bool:
    return [i.label for i in a] == [i.label for i in b]


def _forest_panel(ax: Axes, intervals: Sequence[Interval], label: str) -> None:
    for y, interval in enumerate(intervals):
        draw_interval(ax, interval, y)
    ax.set_yticks(range(len(intervals)), [i.label for i in intervals], fontsize=9.5)
    ax.set_ylim(len(intervals) - 0.5, -0.5)
    ax.xaxis.set_major_locator(MaxNLocator(4))
    ax.set_xlabel(label)
    ax.margins(x=0.08)
    ax.grid(axis="x", color=FAINT, linewidth=0.6)
