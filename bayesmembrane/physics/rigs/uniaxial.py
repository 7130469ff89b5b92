"""A strip pulled at its ends; its sides are free: l2 = l3 = l^(-1/2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.rigs.base import Strip


@dataclass(frozen=True)
class Uniaxial(Strip):
    """A strip pulled at its ends; its sides are free: l2 = l3 = l^(-1/2)."""

    length: float = 0.050
    width: float = 0.010

    name: ClassVar[str] = "uniaxial"
    title: ClassVar[str] = "uniaxial strip"
    proposal: ClassVar[str] = "a strip pulled lengthwise (uniaxial)"
    pressed: ClassVar[str] = "compression"

    @staticmethod
    def lateral(stretch: Array, across: Array | None = None) -> tuple[Array, Array]:
        return 1 / np.sqrt(stretch), -0.5 * stretch**-1.5
