"""A comparison in a report: its tables, and its sentences beside the paper's ranking."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bayesmembrane.comparison.evidence.estimate import BRIDGE, NESTED
from bayesmembrane.comparison.result import Comparison, Row
from bayesmembrane.physics.convexity import MODES
from bayesmembrane.report.sentences import listed
from bayesmembrane.report.style import title
from bayesmembrane.report.tables import Column, Table, Value

Paper = Mapping[str, Mapping[str, float]]
"""By range and material: the loss of the paper's optimum, N."""

LEVEL = 0.1  # losses that differ by less than this part rank the same
DECIDED = 2.0

_EVIDENCE = (
    Column("range", "range"),
    Column("hypothesis", "hypothesis"),
    Column("nested", "ln Z, nested", ".2f"),
    Column("nested_sd", "+-", ".2f"),
    Column("bridge", "ln Z, bridge", ".2f"),
    Column("bridge_sd", "+-", ".2f"),
    Column("probability", "posterior probability", "p"),
    Column("elpd_loo", "elpd, leave one out", ".1f"),
    Column("loo_se", "+-", ".1f"),
    Column("refits", "refits", ".0f"),
    Column("held_rmse", "rms error of the rest (N)", ".3g"),
    Column("mass", "prior mass", ".3f"),
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
        spoken_label(row),
        e.log_evidence[NESTED] if e else None,
        e.log_evidence_sd[NESTED] if e else None,
        e.log_evidence[BRIDGE] if e else None,
        e.log_evidence_sd[BRIDGE] if e else None,
        row.posterior_probability,
        loo.elpd if loo else None,
        loo.se if loo else None,
        len(loo.refitted) if loo else None,
        row.rest.rmse_N if row.rest else None,
        row.prior_mass.value if row.prior_mass else None,
        row.reason or (e.reason if e else "") or "-",
    )


def spoken_label(row: Row) -> str:
    """Material and effects for people."""
    h = row.hypothesis
    return " + ".join([title(h.material.name), *(e.name.replace("_", " ") for e in h.effects)])


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
            cells: list[Value] = [name, spoken_label(r)]
            for mode in MODES:
                m = by_mode[mode]
                cells += [m.log_evidence, m.sd, m.mass]
            rows.append(tuple(cells))
    if not rows:
        return None
    caption = (
        "Evidence if the prior asked for convexity elsewhere: on the states reached, on the box of stretches from 1 "
        "to 8, for ellipticity alone, or not at all; each divided by the mass of its own prior. A dash: next to no "
        "film near the data meets the mode, or its mass is not known."
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
                rows.append((name, spoken_label(r), parameter, *cells))
    caption = (
        "Change of ln Z when the prior of one coordinate is half or twice as wide, by reweighting the draws; a dash "
        "where the draws cannot tell."
    )
    return Table("prior widths", caption, columns, tuple(rows))


def ranking_table(found: Mapping[str, Comparison], paper: Paper) -> Table | None:
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
        ours = [spoken_label(r) for r in c.ranking] or ["no ranking"] * len(fitted)
        loo = [spoken_label(r) for r in sorted(fitted, key=lambda r: -r.loo.elpd if r.loo else np.inf)]
        theirs = [f"{title(m)} ({losses[m]:.3g} N)" for m in sorted(losses, key=lambda m: losses[m])]
        for i in range(max(len(ours), len(theirs))):
            row = [names[i] if i < len(names) else "-" for names in (ours, loo, theirs)]
            rows.append((name, i + 1, *row))
    return Table("rankings", "Our rankings beside the paper's.", columns, tuple(rows)) if rows else None


def comparison_sentences(found: Mapping[str, Comparison], paper: Paper) -> list[str]:
    """What each range says, whether it survives other priors, and every difference to the paper's ranking."""
    told = []
    for name, c in found.items():
        start = f"{name}: "
        told += [start + s for s in (c.reason, c.sentence, c.survival) if s]
        told += [start + s for s in _differences(c, paper.get(name, {}))]
    return told


def _differences(c: Comparison, losses: Mapping[str, float]) -> list[str]:
    """A sentence for every pair that evidence and the paper's losses put in another order, and one if there is none."""
    ranking = [r for r in c.ranking if r.hypothesis.material.name in losses and not r.hypothesis.effects]
    told = []
    for i, better in enumerate(ranking):
        for worse in ranking[i + 1 :]:
            a, b = losses[better.hypothesis.material.name], losses[worse.hypothesis.material.name]
            if a > b:
                told.append(_difference(better, worse, a, b))
    if len(ranking) > 1 and not told:
        told.append("the evidence puts the materials in the same order as the paper's losses.")
    return told


def _difference(better: Row, worse: Row, a: float, b: float) -> str:
    assert better.evidence is not None
    assert worse.evidence is not None
    (za, sa), (zb, sb) = better.evidence.best, worse.evidence.best
    gap, sd = za - zb, float(np.hypot(sa, sb))
    names = spoken_label(better), spoken_label(worse)
    start = (
        f"the evidence puts {names[0]} before {names[1]} by {gap:.1f} +- {sd:.2g} in ln Z, and the paper has them the "
        f"other way round, with losses of {a:.3g} and {b:.3g} N"
    )
    if gap < DECIDED * sd or gap < 1.0:
        return f"{start}; neither order is decided."
    extra = worse.hypothesis.curve_size - better.hypothesis.curve_size
    if extra > 0 and a < (1 + LEVEL) * b:
        return (
            f"{start}: the losses are level within {100 * LEVEL:.0f} %, and the {extra} more parameters of {names[1]} "
            "do not pay for themselves."
        )
    if extra > 0:
        return (
            f"{start}: the loss counts the fit of the best point alone; the evidence also counts the {extra} more "
            f"parameters of {names[1]}, most of whose prior the data rule out."
        )
    return (
        f"{start}: the paper's losses weigh every point alike and come from optima without our convexity prior; the "
        "evidence weighs each point by its noise and averages over the prior."
    )


def alternative_text(found: Mapping[str, Comparison]) -> str:
    """What the figure shows, for those who cannot see it."""
    names = listed(dict.fromkeys(spoken_label(r) for c in found.values() for r in c.rows))
    return f"Evidence and leave-one-out prediction of {names}, relative to the best, for {listed(found)}"
