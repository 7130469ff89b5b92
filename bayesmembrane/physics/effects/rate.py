"""A film that is pulled faster is stiffer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.data.motion import NOMINAL_SPEED, Motion
from bayesmembrane.ground.parameters import Array, HalfNormal
from bayesmembrane.physics.effects.base import EffectParameter, Memory


@dataclass(frozen=True)
class Rate(Memory):
    """F = F0 (v / (1 mm/s))^exponent, with the speed v of the disc: the material's constants are those at 1 mm/s."""

    name: ClassVar[str] = "rate"
    title: ClassVar[str] = "stiffening with speed"
    reference: ClassVar[str] = (
        "G. Cowper, P. Symonds, Brown University TR 28 (1957); L. Mullins, J. Rubber Res. 16 (1947) 275"
    )
    signature: ClassVar[str] = (
        "Parts of the test that run faster lie higher by a constant factor, on loading and unloading alike; at one "
        "speed the material absorbs it."
    )
    needs_time: ClassVar[bool] = True
    scales_with_modulus: ClassVar[bool] = True
    rank: ClassVar[int] = 1
    of_the_material = True
    constant = True
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("exponent", "-", "power of the speed", HalfNormal(0.05), (0.0, 0.5), 0.0),
    )

    def remember(self, p: Array, force: Array, path: Motion) -> Array:
        return np.asarray(force * np.exp(p[:, :1] * np.log(path.speed / NOMINAL_SPEED)))
