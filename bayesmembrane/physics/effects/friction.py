"""Friction in the guide of the disc: it adds on loading and takes away on unloading."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.parameters import Array, HalfNormal, LogNormal, Normal
from bayesmembrane.physics.effects._history import relaxing
from bayesmembrane.physics.effects.base import EffectParameter, Sensor

SMALLEST = 1e-9  # N: a power of nothing has no slope
SLOWEST, FASTEST = 0.03, 30.0
"""Times the speed of the first loading: what comes to rest, or waits before it starts, has any speed."""


@dataclass(frozen=True)
class Friction(Sensor):
    """F_read = F + level [1 + (|F| / doubled_at)^load] (v / v_1)^-slower z, with z relaxing to +1 on loading and -1 on
    unloading over ``travel``.

    dz/ds = (direction - z) / travel along the distance s travelled, z = 0 at the start. A guide that the film presses
    to its side rubs the more the larger the force is, as a rope does on its pulley. A dry guide rubs somewhat more when
    it moves slower, an oiled one less (R. Stribeck, Z. VDI 46 (1902) 1341), down to `SLOWEST` and up to `FASTEST` times
    the speed v_1 of the first loading; a guide at rest rubs as when it last moved.
    """

    name: ClassVar[str] = "friction"
    title: ClassVar[str] = "friction in the guide"
    reference: ClassVar[str] = "P. R. Dahl, AIAA J. 14 (1976) 1675"
    signature: ClassVar[str] = (
        "A force up on loading and down on unloading: jumps at each reversal, also at small deflections and at any "
        "speed, the same at large forces or larger, and somewhat larger or less where the disc moves slower."
    )
    twins_one_way: ClassVar[tuple[str, ...]] = ("force_offset",)  # both add a force, which only one turns with the disc
    rank: ClassVar[int] = -1  # the guide has the film's force, before the load cell adds to it
    mistaken: ClassVar[float] = 0.01
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("level", "N", "sliding friction without a force", HalfNormal(0.03), (0.0, 2.0), 0.0),
        EffectParameter(
            "travel", "m", "distance after a reversal over which it turns", LogNormal(3e-4, 1.0), (1e-6, 2e-2)
        ),
        EffectParameter(
            "doubled_at", "N", "force at which it is twice as large", LogNormal(10.0, 1.5), (5e-2, 2e3), begin=3.0
        ),
        EffectParameter("load", "-", "power of the force with which it grows", LogNormal(1.0, 0.4), (0.2, 4.0)),
        EffectParameter("slower", "-", "power of the speed by which it falls", Normal(0.0, 0.1), (-0.5, 0.5)),
    )

    def read(self, p: Array, force: Array, path: Motion) -> Array:
        # A pull of one per length travelled, and its own relaxation: z = direction (1 - exp(-s / travel)).
        signed = np.cumsum(path.steps * path.leg) / p[:, 1:2]
        z = relaxing(signed, path.steps, p[:, 1:2])
        pressed = (np.maximum(np.abs(force), SMALLEST) / p[:, 2:3]) ** p[:, 3:4]
        faster = np.clip(_last_moving(path) / path.pace, SLOWEST, FASTEST)
        return np.asarray(force + p[:, :1] * (1.0 + pressed) * faster ** -p[:, 4:5] * z)


def _last_moving(path: Motion) -> Array:
    """(N,) m/s: the speed, and at rest that before."""
    speed = path.moving_speed
    moving = np.maximum.accumulate(np.where(speed > 0, np.arange(speed.size), 0))
    return np.where(speed[moving] > 0, speed[moving], path.pace)
