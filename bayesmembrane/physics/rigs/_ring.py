"""What rigs with a flat ring of film between a clamp and a disc share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from bayesmembrane.ground.errors import DataError
from bayesmembrane.physics.rigs.base import Rig


@dataclass(frozen=True)
class Ring(Rig):
    """Film between the radii R1 (edge of the disc) and R2 (edge of the clamp), 0 < R1 < R2, in m."""

    inner_radius: float
    outer_radius: float

    clamped: ClassVar[bool] = True

    def check(self) -> None:
        """Raise `DataError` unless R1 < R2."""
        if self.inner_radius >= self.outer_radius:
            raise DataError(
                f"the inner radius ({1e3 * self.inner_radius:g} mm) must be smaller than the outer radius "
                f"({1e3 * self.outer_radius:g} mm)",
                self.name,
                "exchange them if they are swapped, and check their units",
            )

    def size(self) -> float:
        return self.outer_radius

    def ring(self) -> tuple[float, float]:
        return self.inner_radius, self.outer_radius
