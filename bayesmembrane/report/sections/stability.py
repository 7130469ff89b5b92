"""How far each calibrated material is stable, mode by mode, with what the posterior leaves open."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from bayesmembrane.physics.stability import SIDES, stability
from bayesmembrane.report.blocks import Block, Column, Table, Text, Value
from bayesmembrane.report.runs import Shown, in_order, reach
from bayesmembrane.report.sections.base import Section, of_kind

DRAWS = 200


class StabilitySection(Section):
    """A table of the stretches at which a film's material loses stability."""

    name = "stability"
    title = "Stability limits"
    order = 65

    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        shown = in_order(of_kind(results, Shown))
        if not shown:
            return ()
        text = (
            "Stretches at which the material loses stability (Drucker's criterion, as finite element programs print "
            "it), whatever the film reaches: median and 90 % interval of the draws that lose it, and their share. A "
            f"dash: none does between stretches of {min(SIDES.values()):g} and {max(SIDES.values()):g}."
        )
        return [Text(text), limits_table(shown)]


def limits_table(shown: Sequence[Shown]) -> Table:
    """One row for each run, mode and side."""
    columns = (
        Column("run", "material"),
        Column("range", "fitted up to"),
        Column("mode", "mode"),
        Column("side", "side"),
        Column("median", "limit (stretch)"),
        Column("low", "5 %"),
        Column("high", "95 %"),
        Column("share", "share of draws", "%"),
    )
    rows: list[tuple[Value, ...]] = []
    for s in shown:
        some = s.x[np.linspace(0, len(s.x) - 1, min(DRAWS, len(s.x))).astype(int)]
        found = stability(s.hypothesis.material, s.hypothesis.films(some))
        for (mode, side), limits in found.limits.items():
            known = limits[np.isfinite(limits)]
            q = np.quantile(known, (0.5, 0.05, 0.95)).tolist() if known.size else [None] * 3
            rows.append((s.name, reach(s, shown), mode, side, *q, found.share(mode, side)))
    return Table("stability limits", "Stability limits by mode, on both sides of rest.", columns, tuple(rows))
