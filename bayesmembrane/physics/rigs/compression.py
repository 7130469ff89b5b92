"""A block pressed between smooth plates, its sides free: l < 1 along, l2 = l3 = l^(-1/2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.rigs._pressed import Pressed
from bayesmembrane.physics.rigs.uniaxial import Uniaxial


@dataclass(frozen=True)
class Compression(Pressed):
    """A block pressed between smooth plates, its sides free: l < 1 along, l2 = l3 = l^(-1/2)."""

    length: float = 0.050
    width: float = 0.010

    name: ClassVar[str] = "compression"
    title: ClassVar[str] = "block in compression"

    @staticmethod
    def lateral(stretch: Array, across: Array | None = None) -> tuple[Array, Array]:
        return Uniaxial.lateral(stretch)
