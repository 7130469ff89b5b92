"""A film pulled half as far across as along: l2 = (1 + l) / 2."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.rigs.base import Strip


@dataclass(frozen=True)
class HalfBiaxial(Strip):
    """A film pulled half as far across as along: l2 = (1 + l) / 2; the force along is measured."""

    length: float = 0.080
    width: float = 0.020

    name: ClassVar[str] = "half_biaxial"
    title: ClassVar[str] = "film pulled half as far across"

    @staticmethod
    def lateral(stretch: Array, across: Array | None = None) -> tuple[Array, Array]:
        return 0.5 * (1.0 + stretch), np.full_like(stretch, 0.5)
