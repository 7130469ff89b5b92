"""A block pressed alike from both sides, free in the third direction: l = l2 < 1."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.rigs._pressed import Pressed
from bayesmembrane.physics.rigs.equibiaxial import Equibiaxial


@dataclass(frozen=True)
class EquibiaxialCompression(Pressed):
    """A block pressed alike from both sides, free in the third direction: l = l2 < 1."""

    length: float = 0.050
    width: float = 0.010

    name: ClassVar[str] = "equibiaxial_compression"
    title: ClassVar[str] = "block in equibiaxial compression"

    @staticmethod
    def lateral(stretch: Array, across: Array | None = None) -> tuple[Array, Array]:
        return Equibiaxial.lateral(stretch)
