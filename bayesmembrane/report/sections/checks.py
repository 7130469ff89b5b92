"""Cross-checks: the second solver, the convexity prior, and what became of all evaluations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from bayesmembrane.calibration.posterior import Outcome
from bayesmembrane.physics.convexity import RESTRICTING
from bayesmembrane.report.blocks import Block, Column, Table, Value
from bayesmembrane.report.runs import Shown, end_column, ends, in_order
from bayesmembrane.report.sections.base import Section, of_kind
from bayesmembrane.words.calibration import disagreement
from bayesmembrane.words.seen import in_one_unit

MODES = tuple(m.name for m in RESTRICTING)


class ChecksSection(Section):
    """What another solver, the prior and the tally of failures say of every run."""

    name = "checks"
    title = "Cross-checks"
    order = 100

    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        shown = in_order(of_kind(results, Shown))
        if not shown:
            return ()
        checks = [crosscheck_table(group) for group in in_one_unit(shown, lambda s: s.how)]
        return [*checks, masses_table(shown), outcomes_table(shown)]

    def warnings(self, results: Sequence[Any]) -> Sequence[str]:
        told = []
        for s in in_order(of_kind(results, Shown)):
            largest = s.crosscheck.get("largest")
            if isinstance(largest, float):
                told.append(disagreement(s.name, s.end, largest))
        return [t for t in told if t]


def masses_table(shown: Sequence[Shown]) -> Table:
    """What the convexity prior leaves, and how many posterior draws meet the stronger modes."""
    columns = (
        Column("run", "material"),
        end_column(shown),
        Column("mode", "prior used"),
        *(Column(f"mass_{m}", f"prior mass, {m}", "%") for m in MODES),
        *(Column(f"draws_{m}", f"posterior draws, {m}", "%") for m in MODES),
    )
    rows = tuple(
        (
            s.name,
            end,
            s.hypothesis.convexity.name,
            *(s.masses[m][0] if m in s.masses else None for m in MODES),
            *(s.digest.convex.get(m) for m in MODES),
        )
        for s, end in zip(shown, ends(shown), strict=True)
    )
    caption = (
        "Convexity, shares in %: part of the untruncated prior that each mode leaves, and part of the posterior draws "
        "that meet it. reached: the Hessian is positive semidefinite on the states that the film reaches; box: on [1, "
        "8]^2; elliptic: P11 > 0 and P22 > 0 on the reached states."
    )
    return Table("convexity", caption, columns, rows)


def crosscheck_table(shown: Sequence[Shown]) -> Table:
    """What the second solver found, of runs that are read in the same units."""
    how = shown[0].how
    unit = how.travel if how.bare else how.travel_scale[1]
    columns = (
        Column("run", "material"),
        end_column(shown),
        Column("draws", "films solved twice", "d"),
        Column("compared", "forces compared", "d"),
        Column("largest", "largest relative difference (-)", ".1e"),
        Column(f"at_{unit}", f"met at ({unit})"),
        Column("missing", "forces that one solver lacks", "d"),
    )
    keys = ("draws", "compared", "largest", "at_mm", "missing")
    rows: tuple[tuple[Value, ...], ...] = tuple(
        (s.name, end, *(_met(s, k) for k in keys)) for s, end in zip(shown, ends(shown), strict=True)
    )
    caption = (
        "A sample of the posterior draws of each run, computed a second time with the other solver, which works by "
        "another principle (shooting against energy minimisation). Differences relative to the force."
    )
    if how.bare:
        caption += " The force of a homogeneous test is a closed form, the same for both: nothing is checked by it."
    return Table("crosscheck", caption, columns, rows)


def _met(s: Shown, key: str) -> Value:
    """What a cross-check found; where it was met as people read it."""
    value: Value = s.crosscheck.get(key)
    return s.how.rest + s.how.travel_scale[0] * 1e-3 * value if key == "at_mm" and isinstance(value, float) else value


def outcomes_table(shown: Sequence[Shown]) -> Table:
    """What became of all evaluations."""
    reasons = [o.label for o in Outcome if any(s.outcomes.get(o.label) for s in shown)]
    columns = (
        Column("run", "material"),
        end_column(shown),
        *(Column(r.replace(" ", "_"), r, ",d") for r in reasons),
    )
    rows: tuple[tuple[Value, ...], ...] = tuple(
        (s.name, end, *(int(s.outcomes.get(r, 0)) for r in reasons)) for s, end in zip(shown, ends(shown), strict=True)
    )
    caption = (
        "What became of all evaluations, in numbers of films: all but ok have no posterior density; unresolved and "
        "iteration limit are failures of the numbers, the others are physics or prior."
    )
    return Table("outcomes", caption, columns, rows)
