"""Several tests of one material: what they say together, and how one energy fits each of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.calibration.joint.claim import JointTest
from bayesmembrane.calibration.joint.fit import JointFit
from bayesmembrane.calibration.joint.run import KIND, JointRun
from bayesmembrane.calibration.run import Run, has_predictions
from bayesmembrane.ground.parameters import Natural
from bayesmembrane.ground.registry import components
from bayesmembrane.ground.stored import read
from bayesmembrane.report.blocks import PLAIN, Block, Column, Figure, Picture, Table, points
from bayesmembrane.report.canvas import Shade, band, encoded, errorbars, new_figure, style
from bayesmembrane.report.runs import Shown
from bayesmembrane.report.runs import read as shown_run
from bayesmembrane.report.sections.base import Glance, Section, Subject, of_kind
from bayesmembrane.report.style import FAINT, colour
from bayesmembrane.words.hypothesis import effect_title, material_title
from bayesmembrane.words.joint import answer, fit_sentence, sentences
from bayesmembrane.words.language import listed, spoken_parameter
from bayesmembrane.words.seen import in_one_unit, seen

ACROSS = 2  # pictures side by side


class JointSection(Section):
    """Joint posteriors and joint least squares: parameters, and every test with its band."""

    name = "joint"
    title = "Several tests together"
    order = 25
    shows = JointRun
    takes = (JointFit,)

    def reads(self, folder: Path) -> Any | None:
        found = read(folder, KIND)
        return read(folder, "joint_fit") if found is None else found

    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        out: list[Block] = []
        for run in of_kind(results, JointRun):
            out += [*points([answer(run), *sentences(run)]), _posterior(run), *_tests(run)]
            shown = _with_predictions(run)
            out += [_bands(run, shown)] if shown else []
        for fit in of_kind(results, JointFit):
            out += [*points([fit_sentence(fit)]), _optimum(fit)]
        return out

    def answer(self, results: Sequence[Any]) -> Sequence[str]:
        fits = [fit_sentence(f) for f in of_kind(results, JointFit)]
        return [*(answer(run) for run in of_kind(results, JointRun)), *fits]

    def warnings(self, results: Sequence[Any]) -> Sequence[str]:
        return [s for run in of_kind(results, JointRun) for s in sentences(run)]

    def glances(self, results: Sequence[Any]) -> Sequence[Glance]:
        runs = [
            Glance(
                "joint calibration",
                f"{material_title(r.joint.material.name)} on {listed(r.joint.labels)}",
                f"{r.status['status']}; {len(r.joint.names)} parameters",
            )
            for r in of_kind(results, JointRun)
        ]
        fits = [
            Glance(
                "joint fit",
                f"{material_title(f.joint.material.name)} on {listed(f.joint.labels)}",
                "convex" if f.convex else "not convex",
            )
            for f in of_kind(results, JointFit)
        ]
        return runs + fits

    def subject(self, results: Sequence[Any]) -> Subject | None:
        every: list[JointRun | JointFit] = [*of_kind(results, JointRun), *of_kind(results, JointFit)]
        if not every:
            return None
        tests = dict.fromkeys(label for e in every for label in e.joint.labels)
        return Subject(tuple(tests), f"One material in the tests {listed(tests)}.", "curves")


def _posterior(run: JointRun) -> Table:
    """Natural parameters: mean, standard deviation and 94 % interval."""
    joint = run.joint
    columns = (
        Column("parameter", "parameter"),
        Column("unit", "unit"),
        Column("mean", "mean"),
        Column("sd", "sd", ".2g"),
        Column("low", "94 % from"),
        Column("high", "to"),
    )
    rows = []
    for p, v in zip(joint.natural_parameters, run.status["posterior"].values(), strict=True):
        name, factor, unit = _read_as(run, p)
        rows.append((name, unit, *(factor * u for u in (v["mean"], v["sd"], *v["hdi_94"]))))
    caption = (
        "The joint posterior. Parameters of the energy are those of the thinnest film, "
        f"{1e6 * joint.thickness:.4g} um thick, and all tests share them; the others belong to one test."
    )
    return Table("joint posterior", caption, columns, tuple(rows))


def _read_as(run: JointRun, p: Natural) -> tuple[str, float, str]:
    """(name, factor, unit) of a parameter as people read it: that of a test with its label, in the units of its rig."""
    for part in run.joint.parts:
        if not p.name.startswith(f"{part.label}."):
            continue
        m, own = part.measurement, p.name.removeprefix(f"{part.label}.")
        block = own.partition(".")[0]
        title = f"{effect_title(block)}, " if block in components("effects") else ""
        factor, unit = m.rig.shown(m.specimen.thickness).get(p.unit, (1.0, p.unit))
        return f"{part.label}: {title}{spoken_parameter(own)}", factor, unit
    return spoken_parameter(p.name), 1.0, p.unit


def _tests(run: JointRun) -> list[Table]:
    """How well the most probable draw fits each test, by its own noise: a table for all that are read in one unit."""
    every = zip(run.joint.parts, run.parts, strict=True)
    return [_tests_table(group) for group in in_one_unit(every, lambda test: seen(test[0].measurement))]


def _tests_table(tests: Sequence[tuple[JointTest, Run]]) -> Table:
    unit = seen(tests[0][0].measurement).small[1]
    columns = (
        Column("test", "test"),
        Column("rig", "rig"),
        Column("points", "points", "d"),
        Column("thickness_um", "thickness (um)"),
        Column(f"rmse_{unit}", f"rms residual ({unit})", PLAIN),
        Column(f"own_noise_{unit}", f"stated noise ({unit})", PLAIN),
        Column("reduced_chi2", "reduced chi-square", ".3g"),
        Column("p_value", "p-value", "p"),
    )
    rows = []
    for part, found in tests:
        g, m = found.status["goodness"], part.measurement
        factor, own = seen(m).small[0], g["own_noise_N"]
        rows.append(
            (
                part.label,
                m.rig.name,
                len(m),
                1e6 * m.specimen.thickness,
                factor * g["rmse_N"],
                None if own is None else factor * own,
                g["reduced_chi2"],
                g["p_value"],
            )
        )
    caption = "Every test at the most probable draw. Chi-square and p-value use the noise that the test states."
    return Table("joint tests", caption, columns, tuple(rows))


def _optimum(fit: JointFit) -> Table:
    columns = (Column("parameter", "parameter"), Column("value", "value"), Column("sd", "sd", ".2g"))
    rows = tuple((spoken_parameter(n), v, sd) for n, (v, sd) in fit.parameters.items())
    caption = (
        "Joint least squares, every test in units of its own noise. Parameters of the energy are those of the thinnest "
        f"film, {1e6 * fit.joint.thickness:.4g} um thick."
    )
    return Table("joint fit", caption, columns, rows)


def _with_predictions(run: JointRun) -> list[Shown]:
    """The tests whose predictions are stored: nothing is solved here."""
    return [shown_run(part) for part in run.parts if has_predictions(part)]


def _bands(run: JointRun, shown: Sequence[Shown]) -> Figure:
    names = listed(run.joint.labels)
    return Figure(
        bands_picture(run.joint.labels, shown),
        alt=f"Measured curves of {names}, each with the band that the joint posterior predicts for it",
        caption="Every test with what the joint posterior says of it: 90 % band of a new measurement (light) and of "
        "the curve (dark), and its median, within the fitted range.",
    )


def bands_picture(labels: Sequence[str], shown: Sequence[Shown]) -> Picture:
    """A small picture for every test."""
    rows = -(-len(shown) // ACROSS)
    with style():
        figure = new_figure(3.1 * rows)
        grid = figure.subplots(rows, ACROSS, squeeze=False)
        for ax in grid.ravel()[len(shown) :]:
            ax.set_visible(False)
        for ax, label, s in zip(grid.ravel(), labels, shown, strict=False):
            d, how, c = s.digest, s.how, colour(s.look)
            errorbars(ax, s.points)
            if s.film.rig.has_path:
                x, inside = how.along(d.deflection), ~d.beyond
                band(ax, x, how.carried(d.repeat), inside, Shade(c, 0.18))
                band(ax, x, how.carried(d.curve), inside, Shade(c, 0.4))
                ax.plot(x[inside], how.carried(d.curve[1])[inside], color=c)
            else:  # each state is by itself, and no curve leads through them
                low, middle, high = how.carried(d.curves_at)
                x = how.along(d.at)
                ax.vlines(x, low, high, color=c, linewidth=4, alpha=0.4)
                ax.plot(x, middle, color=c, marker="_", markersize=9, linestyle="none", zorder=6)
            ax.set_title(label)
            ax.set_xlabel(how.travel_label)
            ax.set_ylabel(how.load_label)
            ax.set_ylim(bottom=min(0.0, 1.1 * float(np.min(how.carried(d.force)))))
            ax.grid(color=FAINT, linewidth=0.6)
        return encoded(figure, "svg")
