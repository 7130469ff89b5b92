"""The load cell reads too much or too little by a constant factor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.parameters import Array, Normal
from bayesmembrane.physics.effects.base import EffectParameter, Sensor


@dataclass(frozen=True)
class ForceGain(Sensor):
    """F_read = F (1 + error)."""

    name: ClassVar[str] = "force_gain"
    title: ClassVar[str] = "gain error of the load cell"
    reference: ClassVar[str] = "ISO 7500-1:2018, 6.5 (relative indication error)"
    signature: ClassVar[str] = "None: the whole curve is scaled, and so is the material's modulus."
    absorbed: ClassVar[str] = (
        "The material's modulus absorbs a gain error of the load cell without trace; only a calibration weight shows "
        "it."
    )
    rank: ClassVar[int] = 2
    exact: ClassVar[bool] = True
    remembers: ClassVar[bool] = False
    scales_with_modulus: ClassVar[bool] = True
    mistaken: ClassVar[float] = 0.01
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("error", "-", "reading over true force, less one", Normal(0.0, 0.02), (-0.5, 0.5), 0.0),
    )

    def read(self, p: Array, force: Array, path: Motion) -> Array:
        return force * (1.0 + p[:, :1])
