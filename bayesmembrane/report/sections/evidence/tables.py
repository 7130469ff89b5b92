"""The tables of a comparison: evidence and prediction, convexity modes, prior widths, rankings."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bayesmembrane.comparison.evidence.estimate import BRIDGE, NESTED
from bayesmembrane.comparison.noises import noises_of, over_noises, several
from bayesmembrane.comparison.result import Comparison, Row
from bayesmembrane.physics.convexity import MODES
from bayesmembrane.report.blocks import Column, Table, Value
from bayesmembrane.words.beside_paper import PaperLosses
from bayesmembrane.words.comparison import called, remark
from bayesmembrane.words.hypothesis import material_title, spoken
from bayesmembrane.words.language import spoken_parameter

_EVIDENCE = (
    Column("range", "range"),
    Column("hypothesis", "hypothesis"),
    Column("nested", "ln Z, nested", ".2f"),
    Column("nested_sd", "+-", ".2f"),
    Column("bridge", "ln Z, bridge", ".2f"),
    Column("bridge_sd", "+-", ".2f"),
    Column("probability", "posterior probability", "p"),
    Column("probability_sd", "+-", "p"),
    Column("elpd_loo", "elpd, leave one out", ".1f"),
    Column("loo_se", "+-", ".1f"),
    Column("refits", "refits", ".0f"),
    Column("held_rmse", "rms error of the rest (N)", ".3g"),
    Column("mass", "prior mass", ".3f"),
    Column("mass_sd", "+-", ".3f"),
    Column("reason", "remark"),
)


def evidence_table(found: Mapping[str, Comparison]) -> Table:
    """One row for each range and hypothesis."""
    rows = tuple(_evidence(name, r) for name, c in found.items() for r in c.rows)
    caption = (
        "Evidence ln Z by two estimators, divided by the prior mass that convexity leaves, each with its standard "
        "error; expected log predictive density of points left out, with exact refits where importance weights fail; "
        "error of the rest of the curve, predicted from the fitted range."
    )
    return Table("evidence", caption, _EVIDENCE, rows)


def _evidence(name: str, row: Row) -> tuple[Value, ...]:
    e, loo = row.evidence, row.loo
    return (
        name,
        called(row),
        e.log_evidence[NESTED] if e else None,
        e.log_evidence_sd[NESTED] if e else None,
        e.log_evidence[BRIDGE] if e else None,
        e.log_evidence_sd[BRIDGE] if e else None,
        row.posterior_probability,
        row.posterior_probability_sd,
        loo.elpd if loo else None,
        loo.se if loo else None,
        len(loo.refitted) if loo else None,
        row.rest.rmse_N if row.rest else None,
        row.prior_mass.value if row.prior_mass else None,
        row.prior_mass.sd if row.prior_mass else None,
        remark(row) or "-",
    )


def noises_table(found: Mapping[str, Comparison]) -> Table | None:
    """What each hypothesis is worth whatever the noise, and under each; None if there is one noise model alone."""
    some = {name: c for name, c in found.items() if several(c)}
    models = list(dict.fromkeys(n for c in some.values() for n in noises_of(c)))
    columns = (
        Column("range", "range"),
        Column("hypothesis", "hypothesis"),
        Column("probability", "posterior probability", "p"),
        Column("log_evidence", "ln Z", ".2f"),
        Column("sd", "+-", ".2f"),
        *(Column(n, f"ln Z, {n}", ".2f") for n in models),
    )
    rows: list[tuple[Value, ...]] = [
        (
            name,
            spoken(s.hypothesis),
            s.posterior_probability,
            s.log_evidence,
            s.sd,
            *(s.by_noise.get(n) for n in models),
        )
        for name, c in some.items()
        for s in over_noises(c)
    ]
    caption = (
        "Each hypothesis whatever the noise: ln of the mean evidence over the noise models, which are equally probable "
        "before, and the posterior probability that all of them give it together; then ln Z under each."
    )
    return Table("evidence whatever the noise", caption, columns, tuple(rows)) if rows else None


def modes_table(found: Mapping[str, Comparison]) -> Table | None:
    """ln Z under every convexity mode; None if nobody asked for it."""
    columns = [Column("range", "range"), Column("hypothesis", "hypothesis")]
    for mode in MODES:
        columns += [Column(mode, f"ln Z, {mode}", ".2f"), Column(f"{mode}_sd", "+-", ".2f")]
        columns.append(Column(f"{mode}_mass", "mass", ".3f"))
    rows = []
    for name, c in found.items():
        for r in (r for r in c.rows if r.modes):
            by_mode = {m.mode: m for m in r.modes}
            cells: list[Value] = [name, called(r)]
            for mode in MODES:
                m = by_mode[mode]
                cells += [m.log_evidence, m.sd, m.mass]
            rows.append(tuple(cells))
    if not rows:
        return None
    caption = (
        "Evidence if the prior asked for convexity elsewhere: on the states reached, on the box of stretches from 1 "
        "to 8, for ellipticity alone, or not at all; each divided by the mass of its own prior. A dash: too few "
        "draws, or films near the data, meet the mode to tell."
    )
    return Table("evidence by convexity mode", caption, tuple(columns), tuple(rows))


def widths_table(found: Mapping[str, Comparison]) -> Table:
    """The change of ln Z when one prior is made narrower or wider."""
    columns = (
        Column("range", "range"),
        Column("hypothesis", "hypothesis"),
        Column("parameter", "prior of"),
        Column("half", "half as wide", "+.2f"),
        Column("half_sd", "+-", ".2f"),
        Column("twice", "twice as wide", "+.2f"),
        Column("twice_sd", "+-", ".2f"),
    )
    rows = []
    for name, c in found.items():
        for r in c.rows:
            by = {(w.parameter, w.factor): w for w in r.widths}
            for parameter in dict.fromkeys(w.parameter for w in r.widths):
                half, twice = by.get((parameter, 0.5)), by.get((parameter, 2.0))
                cells = [v for w in (half, twice) for v in ((w.change, w.sd) if w else (None, None))]
                rows.append((name, called(r), spoken_parameter(parameter), *cells))
    caption = (
        "Change of ln Z when the prior of one coordinate is half or twice as wide, by reweighting the draws; a dash "
        "where the draws cannot tell."
    )
    return Table("prior widths", caption, columns, tuple(rows))


def ranking_table(found: Mapping[str, Comparison], paper: PaperLosses) -> Table | None:
    """Our ranking beside the paper's, by range; None if the paper says nothing of these ranges."""
    columns = (
        Column("range", "range"),
        Column("place", "place", ".0f"),
        Column("ours", "by evidence"),
        Column("loo", "by leave one out"),
        Column("paper", "paper, by loss"),
    )
    rows: list[tuple[Value, ...]] = []
    for name, c in found.items():
        losses = paper.get(name, {})
        fitted = [r for r in c.rows if r.evidence is not None]
        if not losses or not fitted:
            continue
        ours = [called(r) for r in c.ranking] or ["no ranking"] * len(fitted)
        loo = [called(r) for r in sorted(fitted, key=lambda r: -r.loo.elpd if r.loo else np.inf)]
        theirs = [f"{material_title(m)} ({losses[m]:.3g} N)" for m in sorted(losses, key=lambda m: losses[m])]
        for i in range(max(len(ours), len(theirs))):
            row = [names[i] if i < len(names) else "-" for names in (ours, loo, theirs)]
            rows.append((name, i + 1, *row))
    return Table("rankings", "Our rankings beside the paper's.", columns, tuple(rows)) if rows else None
