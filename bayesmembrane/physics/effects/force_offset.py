"""The load cell does not read zero without load."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.parameters import Array, Normal
from bayesmembrane.physics.effects.base import EffectParameter, Sensor


@dataclass(frozen=True)
class ForceOffset(Sensor):
    """F_read = F + offset."""

    name: ClassVar[str] = "force_offset"
    title: ClassVar[str] = "offset of the force zero"
    reference: ClassVar[str] = "ISO 376:2011, zero error of force-proving instruments"
    signature: ClassVar[str] = "A constant force everywhere, also where the film is slack."
    exact: ClassVar[bool] = True
    remembers: ClassVar[bool] = False
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("offset", "N", "reading without load", Normal(0.0, 0.03), (-1.0, 1.0), 0.0),
    )

    def read(self, p: Array, force: Array, path: Motion) -> Array:
        return force + p[:, :1]
