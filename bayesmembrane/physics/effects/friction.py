"""Friction in the guide of the disc: it adds on loading and takes away on unloading."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.special import expit

from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.parameters import Array, HalfNormal, LogNormal, Normal
from bayesmembrane.physics.effects._history import relaxing
from bayesmembrane.physics.effects.base import EffectParameter, Sensor
from bayesmembrane.physics.reach import SOURCE

SMALLEST = 1e-6
"""Of the largest force: a power of nothing has no slope."""


@dataclass(frozen=True)
class Friction(Sensor):
    """F_read = F + level [1 - p + p (|F| / F_r)^load] (v / v_1)^-slower z, p = 1 / (1 + exp(-log_odds_pressed)), with z
    relaxing to +1 on loading and -1 on unloading over ``travel``.

    dz/ds = (direction - z) / travel along the distance s travelled, z = 0 at the start. A guide that the film presses
    to its side rubs the more the larger the force is (p), as a rope does on its pulley; F_r is the largest force of the
    test. A dry guide rubs somewhat more when it moves slower, an oiled one less (R. Stribeck, Z. VDI 46 (1902) 1341);
    v_1 is the speed of the first loading, and a guide at rest rubs as when it last moved.
    """

    name: ClassVar[str] = "friction"
    title: ClassVar[str] = "friction in the guide"
    reference: ClassVar[str] = "P. R. Dahl, AIAA J. 14 (1976) 1675"
    signature: ClassVar[str] = (
        "A force up on loading and down on unloading: jumps at each reversal, also at small deflections and at any "
        "speed, the same at large forces or larger, and somewhat larger or less where the disc moves slower."
    )
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("level", "N", "sliding friction at the largest force", HalfNormal(0.03), (0.0, 2.0), 0.0),
        EffectParameter(
            "travel", "m", "distance after a reversal over which it turns", LogNormal(3e-4, 1.0), (1e-6, 2e-2)
        ),
        EffectParameter(
            "log_odds_pressed",
            "-",
            "log odds of the part of it that grows with the force",
            Normal(-2.5, 2.0),
            (-20.0, 6.0),
            begin=-1.0,
        ),
        EffectParameter("load", "-", "power of the force with which that part grows", LogNormal(1.0, 0.4), (0.2, 4.0)),
        EffectParameter("slower", "-", "power of the speed by which it falls", Normal(0.0, 0.1), (-0.5, 0.5)),
    )

    def read(self, p: Array, force: Array, path: Motion) -> Array:
        # A pull of one per length travelled, and its own relaxation: z = direction (1 - exp(-s / travel)).
        signed = np.cumsum(path.steps * path.leg) / p[:, 1:2]
        z = relaxing(signed, path.steps, p[:, 1:2])
        pressed = expit(p[:, 2:3])
        part = np.maximum(np.abs(force) / (self.reach or SOURCE).force, SMALLEST) ** p[:, 3:4]
        faster = _last_moving(path) / path.pace
        return np.asarray(force + p[:, :1] * (1.0 - pressed + pressed * part) * faster ** -p[:, 4:5] * z)


def _last_moving(path: Motion) -> Array:
    """(N,) m/s: the speed, and at rest that before."""
    speed = path.moving_speed
    moving = np.maximum.accumulate(np.where(speed > 0, np.arange(speed.size), 0))
    return np.where(speed[moving] > 0, speed[moving], path.pace)
