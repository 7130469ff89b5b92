"""The annulus of the paper: a flat ring of film, clamped outside, lifted by a disc that is bonded to it inside."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.units import FORCE, LENGTH
from bayesmembrane.physics.rigs.base import Rig


@dataclass(frozen=True)
class Annulus(Rig):
    """Film between the radii R1 (edge of the disc) and R2 (edge of the clamp), 0 < R1 < R2, in m.

    The disc is lifted by the deflection; deflection and force are positive for a lifted disc.
    """

    inner_radius: float
    outer_radius: float

    name: ClassVar[str] = "annulus"
    title: ClassVar[str] = "clamped annulus with a lifted disc"
    columns: ClassVar[Mapping[str, str]] = {"deflection": LENGTH, "force": FORCE}

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

    @property
    def radius_ratio(self) -> float:
        """R2 / R1."""
        return self.outer_radius / self.inner_radius
