"""How far a test went: what lengths, forces and their rates are small or large beside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayesmembrane.data.measurement import Measurement

SHORTEST = 1e-12  # s


@dataclass(frozen=True)
class Reach:
    """What a test reached, in the units of its rig.

    travel : largest deflection of the whole test; force : largest measured; duration : s, of the whole test since the
        disc stood at zero, which is what its clock shows; clamped : True if the film is clamped all round
    """

    travel: float
    force: float
    duration: float
    clamped: bool = True

    @property
    def by_unit(self) -> dict[str, float]:
        """{SI unit: what sizes of this unit are parts of}; pure numbers, and times of a film, are parts of nothing."""
        return {
            "m": self.travel,
            "N": self.force,
            "N/s": self.force / self.duration,
            "N/m": self.force / self.travel,
            "m/N": self.travel / self.force,
        }

    def times(self, unit: str) -> float:
        """How many times as large a size of this unit is here as in `SOURCE`; 1 of what is no part of anything."""
        return self.by_unit.get(unit, 1.0) / SOURCE.by_unit.get(unit, 1.0)

    @property
    def times_as_long(self) -> float:
        """How many times as long as `SOURCE`."""
        return self.duration / SOURCE.duration


SOURCE = Reach(0.0915, 2.25, 35.0)
"""That of the operating point OP1 of the source, for which effects declare the priors of their sizes."""


def reach_of(measurement: Measurement) -> Reach:
    """Of one measurement."""
    force = float(np.max(np.abs(measurement.force)))
    duration = max(float(measurement.path.clock[-1]), SHORTEST)
    return Reach(measurement.full_range, force if force > 0 else SOURCE.force, duration, measurement.rig.clamped)
