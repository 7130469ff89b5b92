"""A block pressed in a channel, which keeps its width: l < 1 along, l2 = 1."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.rigs._pressed import Pressed
from bayesmembrane.physics.rigs.planar import Planar


@dataclass(frozen=True)
class PlanarCompression(Pressed):
    """A block pressed in a channel, which keeps its width: l < 1 along, l2 = 1."""

    length: float = 0.050
    width: float = 0.010

    name: ClassVar[str] = "planar_compression"
    title: ClassVar[str] = "block in planar compression (channel)"

    @staticmethod
    def lateral(stretch: Array, across: Array | None = None) -> tuple[Array, Array]:
        return Planar.lateral(stretch)
