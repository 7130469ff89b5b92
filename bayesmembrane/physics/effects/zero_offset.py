"""The deflection counter does not read zero where the film becomes taut."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.parameters import Array, Normal
from bayesmembrane.physics.effects.base import Deflection, EffectParameter


@dataclass(frozen=True)
class ZeroOffset(Deflection):
    """delta_film = delta - shift. Below zero a film is slack; one with a pre-stretch is taut, and pulls back."""

    name: ClassVar[str] = "zero_offset"
    title: ClassVar[str] = "offset of the deflection zero"
    reference: ClassVar[str] = "ISO 7500-1:2018, zero of the measuring system; ASTM D412-16, 12.1 (slack at the start)"
    signature: ClassVar[str] = (
        "The whole curve lies to the right (or left): the residual follows the slope of the curve, alike on all legs."
    )
    exact: ClassVar[bool] = True
    may_change: ClassVar[bool] = True
    remembers: ClassVar[bool] = False
    mistaken: ClassVar[float] = 0.12
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter(
            "shift", "m", "deflection read when the film becomes taut", Normal(0.0, 5e-4), (-5e-3, 5e-3), 0.0
        ),
    )

    def deflect(self, p: Array, deflection: Array, path: Motion) -> Array:
        return deflection - p[:, :1]
