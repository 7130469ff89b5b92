"""The secant stiffness of a fit, force over deflection, at the end of its range."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from bayesmembrane.calibration.fit import Fit
from bayesmembrane.report.blocks import Block, Text
from bayesmembrane.report.sections.base import Section, of_kind


class Stiffness(Section):
    """One sentence for each fit."""

    name = "stiffness"
    title = "Secant stiffness"
    order = 36
    takes = (Fit,)

    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        return [
            Text(f"The secant stiffness of {f.hypothesis.material.title} is {f.force[-1] / f.deflection[-1]:.4g} N/m.")
            for f in of_kind(results, Fit)
        ]
