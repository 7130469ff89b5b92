"""How far each calibrated material is stable, mode by mode, with what the posterior leaves open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bayesmembrane.calibration.fit import Fit
from bayesmembrane.calibration.joint.fit import JointFit
from bayesmembrane.calibration.joint.run import JointRun
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.stability import SIDES, stability
from bayesmembrane.report.blocks import Block, Column, Table, Text, Value
from bayesmembrane.report.runs import Shown, in_order, reach
from bayesmembrane.report.sections.base import Section, of_kind
from bayesmembrane.words.hypothesis import material_title, spoken
from bayesmembrane.words.language import listed
from bayesmembrane.words.seen import seen_by_fit

DRAWS = 200


@dataclass(frozen=True, eq=False)
class Calibrated:
    """A material as it was calibrated: membrane ``parameters`` (B, n) N/m, of draws, or of one optimum (B = 1)."""

    name: str
    fitted: str
    material: type[Material]
    parameters: Array


class StabilitySection(Section):
    """A table of the stretches at which a film's material loses stability."""

    name = "stability"
    title = "Stability limits"
    order = 65

    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        found = [*_drawn(results), *_fitted(results)]
        if not found:
            return ()
        text = (
            "Stretches at which the material loses stability (Drucker's criterion, as finite element programs print "
            "it), whatever the film reaches, on both sides of rest: median and 90 % interval of the draws that lose "
            "it, and their share; least squares has the optimum alone. What is not in the table loses it nowhere "
            f"between {min(SIDES.values()):g} and {max(SIDES.values()):g} of stretch."
        )
        table = limits_table(found)
        return [Text(text), table] if table.rows else [Text(f"{text} That is all of them.")]


def limits_table(found: Sequence[Calibrated]) -> Table:
    """One row for each material, mode and side where some film loses stability."""
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
    for c in found:
        limits = stability(c.material, c.parameters)
        for (mode, side), at in limits.limits.items():
            known = at[np.isfinite(at)]
            if not known.size:
                continue
            median, *ends = np.quantile(known, (0.5, 0.05, 0.95)).tolist()
            spread = (*ends, limits.share(mode, side)) if len(c.parameters) > 1 else (None, None, None)
            rows.append((c.name, c.fitted, mode, side, median, *spread))
    return Table("stability limits", "Stability limits by mode, on both sides of rest.", columns, tuple(rows))


def _drawn(results: Sequence[Any]) -> list[Calibrated]:
    """Posteriors of one test, and of several."""
    shown = in_order(of_kind(results, Shown))
    alone = [Calibrated(s.name, reach(s, shown), s.hypothesis.material, s.hypothesis.films(_some(s.x))) for s in shown]
    joint = [
        Calibrated(
            material_title(r.joint.material.name),
            f"{listed(r.joint.labels)} together",
            r.joint.material,
            r.joint.films(_some(r.draws())),
        )
        for r in of_kind(results, JointRun)
    ]
    return alone + joint


def _fitted(results: Sequence[Any]) -> list[Calibrated]:
    """Optima of one test, and of several; not those that do not exist."""
    alone = [
        Calibrated(
            f"{spoken(f.hypothesis)}, least squares",
            seen_by_fit(f).place(float(np.max(f.deflection))),
            f.hypothesis.material,
            f.hypothesis.films(f.coordinates),
        )
        for f in of_kind(results, Fit)
    ]
    joint = [
        Calibrated(
            f"{material_title(f.joint.material.name)}, least squares",
            f"{listed(f.joint.labels)} together",
            f.joint.material,
            f.joint.films(f.coordinates),
        )
        for f in of_kind(results, JointFit)
    ]
    return [c for c in alone + joint if np.all(np.isfinite(c.parameters))]


def _some(draws: Array) -> Array:
    some: Array = draws[np.linspace(0, len(draws) - 1, min(DRAWS, len(draws))).astype(int)]
    return some
