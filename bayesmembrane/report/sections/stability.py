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
            "it), whatever the film reaches, on both sides of rest: median and 90 % interval of the draws that lose "
            f"it, and their share. What is not in the table loses it nowhere between {min(SIDES.values()):g} "
            f"and {max(SIDES.values()):g} of stretch."
        )
        table = limits_table(shown)
        return [Text(text), table] if table.rows else [Text(f"{text} That is all of them.")]


def limits_table(shown: Sequence[Shown]) -> Table:
    """One row for each run, mode and side where some draw loses stability."""
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
            if not known.size:
                continue
            q = np.quantile(known, (0.5, 0.05, 0.95)).tolist()
            rows.append((s.name, reach(s, shown), mode, side, *q, found.share(mode, side)))
    return Table("stability limits", "Stability limits by mode, on both sides of rest.", columns, tuple(rows))
