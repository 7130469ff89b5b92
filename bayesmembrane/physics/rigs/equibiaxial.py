"""A film pulled alike in both directions: l2 = l."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.rigs.base import Strip


@dataclass(frozen=True)
class Equibiaxial(Strip):
    """A film pulled alike in both directions: l2 = l."""

    length: float = 0.050
    width: float = 0.010

    name: ClassVar[str] = "equibiaxial"
    title: ClassVar[str] = "equibiaxial film"
    proposal: ClassVar[str] = "a sheet pulled equally both ways (equibiaxial)"
    pressed: ClassVar[str] = "equibiaxial_compression"

    @staticmethod
    def lateral(stretch: Array, across: Array | None = None) -> tuple[Array, Array]:
        return stretch, np.ones_like(stretch)
