"""A strip much wider than long, pulled at its long sides, which keep its width: l2 = 1."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.rigs.base import Strip


@dataclass(frozen=True)
class Planar(Strip):
    """A strip much wider than long, pulled at its long sides, which keep its width: l2 = 1."""

    length: float = 0.050
    width: float = 0.010

    name: ClassVar[str] = "planar"
    title: ClassVar[str] = "planar strip (pure shear)"
    proposal: ClassVar[str] = "a wide short strip pulled lengthwise (planar)"
    pressed: ClassVar[str] = "planar_compression"

    @staticmethod
    def lateral(stretch: Array, across: Array | None = None) -> tuple[Array, Array]:
        return np.ones_like(stretch), np.zeros_like(stretch)
