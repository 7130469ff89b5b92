"""The tables of a report: raw values in columns with units, printed for people and stored for programs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bayesmembrane.calibration.beside_paper import Compared
from bayesmembrane.calibration.posterior import Outcome
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.cache import Tally
from bayesmembrane.physics.convexity import RESTRICTING
from bayesmembrane.report.sentences import percent
from bayesmembrane.report.style import spoken, title
from bayesmembrane.report.view import Shown

Value = str | float | int | bool | None


@dataclass(frozen=True)
class Column:
    """``key`` for programs, ``head`` for people (with the unit), and how numbers are printed."""

    key: str
    head: str
    form: str = ".4g"

    def text(self, value: Value) -> str:
        """A cell; a dash where there is nothing."""
        if value is None or (isinstance(value, float) and not math.isfinite(value)):
            return "-"
        if isinstance(value, bool):
            return "yes" if value else "no"
        if isinstance(value, str):
            return value
        if self.form == "%":
            return percent(float(value))
        if self.form == "p" and value < 1e-4:
            return "< 0.0001"
        return _plain(f"{value:{'.2g' if self.form == 'p' else self.form}}")


def _plain(text: str) -> str:
    """A number without an exponent where that is short, and with a true minus sign."""
    if "e" in text and abs(float(text)) < 1e7 and abs(float(text)) >= 1e-4:
        text = f"{float(text):,.0f}" if abs(float(text)) >= 1 else f"{float(text):.6f}".rstrip("0")
    return "\u2212" + text[1:] if text.startswith("-") else text


@dataclass(frozen=True)
class Table:
    """Rows of raw values under ``columns``; ``caption`` says what they are, with units."""

    name: str
    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Value, ...], ...]

    def cells(self) -> list[list[str]]:
        """The rows as people read them."""
        return [[c.text(v) for c, v in zip(self.columns, row, strict=True)] for row in self.rows]

    def numeric(self) -> list[bool]:
        """Which columns hold numbers."""
        return [all(not isinstance(row[i], str) for row in self.rows) for i in range(len(self.columns))]

    def records(self) -> list[dict[str, Value]]:
        """The rows as programs read them: nan and infinity as None."""
        return [{c.key: _finite(v) for c, v in zip(self.columns, row, strict=True)} for row in self.rows]


def _finite(value: Value) -> Value:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _number(value: float | None) -> float | None:
    return None if value is None else float(value)


def fits_table(shown: Sequence[Shown]) -> Table:
    """How well each run's curve fits, judged by the measurement's own noise."""
    columns = (
        Column("run", "material"),
        Column("end_mm", "fitted up to (mm)"),
        Column("points", "points", "d"),
        Column("parameters", "parameters", "d"),
        Column("rmse_mN", "rms residual (mN)", ".3g"),
        Column("max_mN", "largest residual (mN)", ".3g"),
        Column("loss_N", "loss (N)"),
        Column("own_noise_mN", "stated noise (mN)", ".3g"),
        Column("extra_noise_mN", "inferred extra noise (mN)", ".3g"),
        Column("reduced_chi2", "reduced chi-square", ".3g"),
        Column("p_value", "p-value", "p"),
        Column("verdict", "verdict"),
    )
    words = {"adequate": "describes the curve", "strained": "close, not within noise", "misses": "misses something"}
    rows = []
    for s in shown:
        fit, case = s.goodness, s.case
        rows.append(
            (
                s.name,
                1e3 * s.digest.end,
                int(s.digest.at.size),
                s.hypothesis.curve_size,
                1e3 * (fit["rmse_N"] or 0.0),
                1e3 * (fit["max_N"] or 0.0),
                fit["loss_N"],
                _milli(fit["own_noise_N"]),
                _milli(case.extra_noise),
                fit["reduced_chi2"],
                fit["p_value"],
                words.get(case.verdict, "noise not stated"),
            )
        )
    return Table(
        "fits",
        "Residuals of the most probable draw of each run: forces in N and mN, deflections in mm. Chi-square and "
        "p-value use the noise that the measurement states, never the inferred one.",
        columns,
        tuple(rows),
    )


def _milli(value: float | None) -> float | None:
    return None if value is None else 1e3 * value


def sampling_table(shown: Sequence[Shown]) -> Table:
    """How each run was sampled."""
    columns = (
        Column("run", "material"),
        Column("end_mm", "fitted up to (mm)"),
        Column("status", "status"),
        Column("ess", "ESS, worst (-)", ".0f"),
        Column("r_hat", "R-hat, worst (-)", ".4f"),
        Column("tau", "autocorrelation, worst (steps)", ".0f"),
        Column("ensembles", "ensembles", "d"),
        Column("walkers", "walkers each", "d"),
        Column("steps", "steps", "d"),
        Column("burn", "of these discarded", "d"),
        Column("acceptance", "acceptance", "%"),
        Column("evaluations", "evaluations", ",d"),
        Column("failed", "numerical failures", "%"),
        Column("seconds", "time (s)", ".1f"),
    )
    rows = tuple(
        (
            s.name,
            1e3 * s.digest.end,
            s.sampling.status,
            s.case.ess,
            s.case.r_hat,
            float(np.max(s.sampling.tau)),
            s.sampling.ensembles,
            s.sampling.walkers,
            s.sampling.steps,
            s.sampling.burn,
            s.sampling.acceptance,
            s.sampling.evaluations,
            s.case.failed,
            s.sampling.seconds,
        )
        for s in shown
    )
    return Table("sampling", "How each run was sampled: steps without unit, time in s.", columns, rows)


def parameters_table(s: Shown, compared: Compared | None = None) -> Table:
    """Natural parameters of one run: posterior, our optimum, the paper's."""
    columns = (
        Column("parameter", "parameter"),
        Column("unit", "unit"),
        Column("mean", "mean", ".5g"),
        Column("sd", "sd", ".2g"),
        Column("hdi_low", "94 % from"),
        Column("hdi_high", "to"),
        Column("optimum", "least squares", ".5g"),
        Column("optimum_convex", "least squares, convex", ".5g"),
        Column("paper", "paper", ".5g"),
    )
    ours = compared.parameters if compared else {}
    held = compared.held_parameters if compared else {}
    paper = compared.published if compared else {}
    rows = []
    for i, (name, unit) in enumerate(zip(s.hypothesis.natural_names, s.hypothesis.natural_units, strict=True)):
        own, values = name.partition(".")[2], s.natural[:, i]
        material = name.startswith(f"{s.material}.")
        low, high = hdi(values)
        rows.append(
            (
                spoken(name),
                unit,
                float(np.mean(values)),
                float(np.std(values)),
                low,
                high,
                *(d.get(own) if material else None for d in (ours, held, paper)),
            )
        )
    caption = "Parameters of the membrane: posterior mean, standard deviation and shortest interval that holds 94 %."
    return Table(f"parameters {s.key}", caption, _without_empty(columns, rows)[0], _without_empty(columns, rows)[1])


def coordinates_table(s: Shown) -> Table:
    """The coordinates that were sampled: meaning, prior, and what the chains are worth."""
    columns = (
        Column("coordinate", "coordinate"),
        Column("unit", "unit"),
        Column("meaning", "meaning"),
        Column("prior", "prior"),
        Column("mean", "posterior mean", ".5g"),
        Column("sd", "posterior sd", ".2g"),
        Column("tau", "autocorrelation (steps)", ".0f"),
    )
    rows = tuple(
        (
            spoken(p.name),
            p.unit,
            p.meaning,
            str(p.prior),
            float(np.mean(s.x[:, i])),
            float(np.std(s.x[:, i])),
            float(s.sampling.tau[i]),
        )
        for i, p in enumerate(s.hypothesis.parameters)
    )
    return Table(f"coordinates {s.key}", "Coordinates that were sampled, with their priors.", columns, rows)


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
            title(c.material),
            c.range,
            c.ours,
            c.constrained,
            c.printed,
            c.evaluated,
            c.ours / c.evaluated if c.evaluated else None,
            ", ".join(spoken(n) for n in c.at_bound) or None,
        )
        for c in compared
    )
    caption = (
        "Losses in N: Euclidean norm of measured minus computed force over the points of a range. Re-evaluated: the "
        "paper's optimum of that range, with our solver, on the reconstructed curve."
    )
    return Table("losses", caption, *_without_empty(columns, rows))


def break_table(shown: Sequence[Shown]) -> Table:
    """Forces at which specimens broke, and the predictions."""
    first = shown[0].digest
    columns = (
        Column("specimen", "specimen"),
        Column("thickness_um", "thickness (um)", ".0f"),
        Column("deflection_mm", "deflection (mm)", ".0f"),
        Column("observed_N", "observed (N)", ".3g"),
        *(Column(f"{s.key}_N", f"{s.name}, {1e3 * s.digest.end:.3g} mm (N)") for s in shown),
    )
    rows: tuple[tuple[Value, ...], ...] = tuple(
        (
            name,
            1e6 * float(first.break_thickness[i]),
            1e3 * float(first.break_at[i]),
            float(first.break_force[i]),
            *(_interval(s.digest.break_predicted[:, i], float(s.digest.break_lost[i])) for s in shown),
        )
        for i, name in enumerate(first.specimens)
    )
    caption = (
        "Break points, forces in N: observed, and predicted from the fitted film by thickness alone (median, 90 % "
        "interval, and the share of the draws that have no force there)."
    )
    return Table(f"break_points {1e3 * first.end:.4g}mm", caption, columns, rows)


def _interval(q: Array, lost: float) -> str:
    gone = f"; {percent(lost)} none" if lost >= 0.005 else ""
    if not np.all(np.isfinite(q)):
        return f"no force ({percent(lost)} of the draws)"
    low, middle, high = (_plain(f"{v:.3g}") for v in q)
    return f"{middle} ({low} to {high}){gone}"


def masses_table(shown: Sequence[Shown]) -> Table:
    """What the convexity prior leaves, and how many posterior draws meet the stronger modes."""
    columns = (
        Column("run", "material"),
        Column("end_mm", "fitted up to (mm)"),
        Column("mode", "prior used"),
        *(Column(f"mass_{m}", f"prior mass, {m}", "%") for m in [m.name for m in RESTRICTING]),
        *(Column(f"draws_{m}", f"posterior draws, {m}", "%") for m in [m.name for m in RESTRICTING]),
    )
    rows = tuple(
        (
            s.name,
            1e3 * s.digest.end,
            s.hypothesis.convexity.name,
            *(_number(s.masses.get(m, (None, None))[0]) for m in [m.name for m in RESTRICTING]),
            *(s.digest.convex.get(m) for m in [m.name for m in RESTRICTING]),
        )
        for s in shown
    )
    caption = (
        "Convexity, shares in %: part of the untruncated prior that each mode leaves, and part of the posterior draws "
        "that meet it. reached: the Hessian is positive semidefinite on the states that the film reaches; box: on [1, "
        "8]^2; elliptic: P11 > 0 and P22 > 0 on the reached states."
    )
    return Table("convexity", caption, columns, rows)


def crosscheck_table(shown: Sequence[Shown]) -> Table:
    """What the second solver found."""
    columns = (
        Column("run", "material"),
        Column("end_mm", "fitted up to (mm)"),
        Column("draws", "films solved twice", "d"),
        Column("compared", "forces compared", "d"),
        Column("largest", "largest relative difference (-)", ".1e"),
        Column("at_mm", "met at (mm)"),
        Column("missing", "forces that one solver lacks", "d"),
    )
    keys = ("draws", "compared", "largest", "at_mm", "missing")
    rows: tuple[tuple[Value, ...], ...] = tuple(
        (s.name, 1e3 * s.digest.end, *(s.crosscheck.get(k) for k in keys)) for s in shown
    )
    caption = (
        "A sample of the posterior draws of each run, computed a second time with the other solver, which works by "
        "another principle (shooting against energy minimisation). Differences relative to the force."
    )
    return Table("crosscheck", caption, columns, rows)


def outcomes_table(shown: Sequence[Shown]) -> Table:
    """What became of all evaluations."""
    reasons = [o.label for o in Outcome if any(s.outcomes.get(o.label) for s in shown)]
    columns = (
        Column("run", "material"),
        Column("end_mm", "fitted up to (mm)"),
        *(Column(r.replace(" ", "_"), r, ",d") for r in reasons),
    )
    rows: tuple[tuple[Value, ...], ...] = tuple(
        (s.name, 1e3 * s.digest.end, *(int(s.outcomes.get(r, 0)) for r in reasons)) for s in shown
    )
    caption = (
        "What became of all evaluations, in numbers of films: all but ok have no posterior density; unresolved and "
        "iteration limit are failures of the numbers, the others are physics or prior."
    )
    return Table("outcomes", caption, columns, rows)


def cache_table(shown: Sequence[Shown], total: Tally | None = None) -> Table:
    """What the curve cache did in each run, beside the films that were solved directly; and in all."""
    columns = (
        Column("run", "material"),
        Column("end_mm", "fitted up to (mm)"),
        Column("hits", "found", ",d"),
        Column("from_disk", "curves read from disk", ",d"),
        Column("misses", "solved and kept", ",d"),
        Column("bypassed", "solved directly", ",d"),
        Column("rebuilt", "damaged, made anew", ",d"),
        Column("seconds_looking", "looking up (s)", ".2g"),
        Column("seconds_solving", "solving what is kept (s)", ".2g"),
        Column("seconds_saved", "saved (s)", ".2g"),
    )
    keys = [c.key for c in columns[2:]]
    rows: list[tuple[Value, ...]] = [
        (s.name, 1e3 * s.digest.end, *(s.cache.get(k) for k in keys)) for s in shown if s.cache
    ]
    if total is not None:
        summary = total.summary()
        rows.append(("all work, predictions included", None, *(summary[k] for k in keys)))
    caption = (
        "The curve cache, in numbers of films: those found in it, those solved once and kept, and those solved "
        "directly because draws of a material with shape parameters never repeat; curves of a material without them "
        "are scaled from one before the cache is asked. Saved: calls that needed no solution, times the mean time of "
        "one film, less the time spent looking up; negative where nothing repeats."
    )
    return Table("cache", caption, columns, tuple(rows))


def own_facts_table(shown: Sequence[Shown], common: Mapping[str, Any]) -> Table:
    """Settings in which the runs differ."""
    names = list(dict.fromkeys(k for s in shown for k in s.facts if k not in common))
    columns = (Column("run", "material"), Column("end_mm", "fitted up to (mm)"), *(Column(n, n) for n in names))
    rows: tuple[tuple[Value, ...], ...] = tuple(
        (s.name, 1e3 * s.digest.end, *(_fact(s.facts.get(n)) for n in names)) for s in shown
    )
    return Table("settings_of_runs", "Settings in which the runs differ.", columns, rows)


def facts_table(name: str, caption: str, facts: Mapping[str, Any]) -> Table:
    """Names and values, nested mappings flattened."""
    rows = tuple((k, _fact(v)) for k, v in _flat(facts).items())
    return Table(name, caption, (Column("name", "name"), Column("value", "value")), rows)


def _flat(facts: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    out: dict[str, Any] = {}
    for key, value in facts.items():
        own = f"{prefix}{key}".replace("_", " ")
        if isinstance(value, Mapping):
            out |= _flat(value, f"{own}: ")
        else:
            out[own] = value
    return out


def _fact(value: Any) -> str:
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "-"}[value]
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list | tuple):
        return ", ".join(_fact(v) for v in value) or "-"
    return str(value)


def _without_empty(
    columns: Sequence[Column], rows: Sequence[tuple[Value, ...]]
) -> tuple[tuple[Column, ...], tuple[tuple[Value, ...], ...]]:
    """Without columns that hold nothing at all."""
    keep = [i for i in range(len(columns)) if any(row[i] is not None for row in rows)]
    return tuple(columns[i] for i in keep), tuple(tuple(row[i] for i in keep) for row in rows)


def hdi(values: Array, share: float = 0.94) -> tuple[float, float]:
    """The shortest interval that holds ``share`` of the draws."""
    ordered = np.sort(values)
    inside = max(1, int(np.floor(share * ordered.size)))
    if inside >= ordered.size:
        return float(ordered[0]), float(ordered[-1])
    start = int(np.argmin(ordered[inside:] - ordered[: ordered.size - inside]))
    return float(ordered[start]), float(ordered[start + inside])
