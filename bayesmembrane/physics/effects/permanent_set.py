"""The film stays longer after it was stretched."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.parameters import Array, HalfNormal, Uniform
from bayesmembrane.physics.effects._history import CREEPS, EXPONENT, REPEATED, SATURATION, growth
from bayesmembrane.physics.effects.base import Deflection, EffectParameter, running_max


@dataclass(frozen=True)
class PermanentSet(Deflection):
    """delta_film = delta - set G (1 - rejoin delta / m), slack below; m: largest deflection so far.

    G is the growth law of the test (1 after a first loading to its full range). ``rejoin`` 1 comes back to the first
    loading curve at m, 0 keeps the whole shift.
    """

    name: ClassVar[str] = "permanent_set"
    title: ClassVar[str] = "permanent set"
    reference: ClassVar[str] = "A. Dorfmann, R. W. Ogden, Int. J. Solids Struct. 41 (2004) 1855"
    signature: ClassVar[str] = (
        "After each new maximum the film comes back slack: unloading reaches zero force before zero deflection, "
        "reloading starts there, and the shift grows with the largest deflection."
    )
    rank: ClassVar[int] = 1
    of_the_material = True
    needs_return: ClassVar[bool] = True
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter(
            "set", "m", "deflection at which the film is slack after the test", HalfNormal(1e-3), (0.0, 2e-2), 0.0
        ),
        EXPONENT,
        EffectParameter(
            "rejoin",
            "-",
            "part of the set that is gone when the previous maximum is reached again",
            Uniform(0.0, 1.0),
            (0.0, 1.0),
        ),
        REPEATED,
        SATURATION,
        CREEPS,
    )

    def deflect(self, p: Array, deflection: Array, path: Motion) -> Array:
        largest = running_max(deflection)
        lasting = p[:, :1] * growth(p[:, 1:2], p[:, 3:4], deflection, path, p[:, 4:5], p[:, 5:6])
        with np.errstate(all="ignore"):
            part = np.where(largest > 0, np.maximum(deflection, 0.0) / largest, 0.0)
        return np.asarray(deflection - lasting * (1 - p[:, 2:3] * part))
