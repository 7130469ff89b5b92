"""What hangs on the load cell pulls by its weight, which was not balanced."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.parameters import Array, HalfNormal
from bayesmembrane.physics.effects.base import EffectParameter, Sensor


@dataclass(frozen=True)
class LightDisc(Sensor):
    """F_read = F - weight: the load cell was set to zero with the disc or the grip on it."""

    name: ClassVar[str] = "light_disc"
    title: ClassVar[str] = "weight of disc or grip"
    reference: ClassVar[str] = "ISO 376:2011, zero error of force-proving instruments"
    signature: ClassVar[str] = "A constant force is missing everywhere, also where the film is slack."
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("weight", "N", "weight of disc or grip", HalfNormal(0.03), (0.0, 1.0), 0.0),
    )

    def read(self, p: Array, force: Array, path: Motion) -> Array:
        return force - p[:, :1]
