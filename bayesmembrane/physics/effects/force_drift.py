"""The zero of the load cell wanders."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.parameters import Array, HalfNormal, LogNormal, Normal, Uniform
from bayesmembrane.physics.effects.base import EffectParameter, Sensor


@dataclass(frozen=True)
class ForceDrift(Sensor):
    """F_read = F + rate {(1 - w) t1 [(t / t1) (rest + t1) / (rest + t)]^exponent + w s}, with w = swings^2, the time t
    since the start, and s = (period / 4) [sin(2 pi (t / period + phase)) - sin(2 pi phase)].

    t1 is when the first leg ends: what comes later does not change what was read. ``rate`` is the mean until then of
    what goes one way, and that of the first quarter of a period of what swings back, as with the temperature of a room.
    A cell that warms up drifts quickly at first (exponent below 1) and comes to rest (t beyond ``rest``). Without times
    the clock is the distance travelled at 1 mm/s.
    """

    name: ClassVar[str] = "force_drift"
    title: ClassVar[str] = "drift of the force zero"
    reference: ClassVar[str] = "ISO 376:2011, C.3 (drift of the zero); OIML R 60-1:2021, 3.9"
    signature: ClassVar[str] = (
        "A force that grows (or falls) with time, steadily, until it rests or until it swings back, whatever the "
        "deflection: all cycles shift, slack parts too."
    )
    rank: ClassVar[int] = 1
    mistaken: ClassVar[float] = 0.01
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter(
            "rate",
            "N/s",
            "mean change of the zero with time: on the first leg, or in a quarter of a period",
            Normal(0.0, 3e-4),
            (-1.0, 1.0),
            0.0,
        ),
        EffectParameter("exponent", "-", "power of the time with which it goes on", LogNormal(1.0, 0.28), (0.4, 3.0)),
        EffectParameter(
            "rest",
            "s",
            "time after which it comes to rest",
            LogNormal(500.0, 1.6),
            (1e-2, 1e7),
        ),
        EffectParameter(
            "swings", "-", "root of the part of it that swings back", HalfNormal(0.3), (0.0, 1.0), begin=0.0
        ),
        EffectParameter(
            "period", "s", "time after which that comes again", LogNormal(35.0, 0.6), (5.0, 350.0), of_the_test=True
        ),
        EffectParameter("phase", "-", "of a period, where it is at the start", Uniform(0.0, 1.0), (0.0, 1.0)),
    )

    @property
    def starts(self) -> list[dict[str, float]]:
        """A swing is found from nearby only: half a one and more than one, from its middle and from its end."""
        usual = next(p.typical for p in self.coordinates if p.name == "period")
        return [{"swings": 0.6, "period": k * usual, "phase": f} for k in (0.7, 1.6) for f in (0.05, 0.3)]

    def read(self, p: Array, force: Array, path: Motion) -> Array:
        first = max(path.first_turn, 1e-12)
        part = path.clock / first * (p[:, 2:3] + first) / (p[:, 2:3] + path.clock)
        once = part ** p[:, 1:2]
        angle = 2 * np.pi * p[:, 5:6]
        swing = 0.25 * p[:, 4:5] * (np.sin(2 * np.pi * path.clock / p[:, 4:5] + angle) - np.sin(angle))
        return np.asarray(force + p[:, :1] * (first * once + p[:, 3:4] ** 2 * (swing - first * once)))
