"""Friction in the guide of the disc: it adds on loading and takes away on unloading."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.parameters import Array, HalfNormal, LogNormal
from bayesmembrane.physics.effects._history import relaxing
from bayesmembrane.physics.effects.base import EffectParameter, Sensor


@dataclass(frozen=True)
class Friction(Sensor):
    """F_read = F + level (1 + grows |delta| / D) z, z relaxing to +1 on loading and -1 on unloading over ``travel``.

    dz/ds = (direction - z) / travel along the distance s travelled, z = 0 at the start. A guide that the film presses
    to its side rubs the more the farther the disc is lifted, up to the full range D.
    """

    name: ClassVar[str] = "friction"
    title: ClassVar[str] = "friction in the guide"
    reference: ClassVar[str] = "P. R. Dahl, AIAA J. 14 (1976) 1675"
    signature: ClassVar[str] = (
        "A force up on loading and down on unloading: jumps at each reversal, also at small deflections and at any "
        "speed, the same at large ones or somewhat larger."
    )
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("level", "N", "force of sliding friction", HalfNormal(0.03), (0.0, 2.0), 0.0),
        EffectParameter(
            "travel", "m", "distance after a reversal over which it turns", LogNormal(3e-4, 1.0), (1e-6, 2e-2)
        ),
        EffectParameter("grows", "-", "by what part of it it is larger at the full range", HalfNormal(0.5), (0.0, 5.0)),
    )

    def read(self, p: Array, force: Array, path: Motion) -> Array:
        # A pull of one per length travelled, and its own relaxation: z = direction (1 - exp(-s / travel)).
        signed = np.cumsum(path.steps * path.leg) / p[:, 1:2]
        z = relaxing(signed, path.steps, p[:, 1:2])
        part = np.minimum(np.abs(path.deflection) / path.full_range, 1.0)
        return np.asarray(force + p[:, :1] * (1.0 + p[:, 2:3] * part) * z)
