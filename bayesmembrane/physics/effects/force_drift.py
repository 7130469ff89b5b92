"""The zero of the load cell wanders."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.parameters import Array, LogNormal, Normal
from bayesmembrane.physics.effects.base import EffectParameter, Sensor


@dataclass(frozen=True)
class ForceDrift(Sensor):
    """F_read = F + rate t1 [(t / t1) (rest + t1) / (rest + t)]^exponent, with the time t since the start.

    t1 is when the first leg ends, and ``rate`` the mean until then: what comes later does not change what was read. A
    cell that warms up drifts quickly at first (exponent below 1) and comes to rest (t beyond ``rest``). Without times
    the clock is the distance travelled at 1 mm/s.
    """

    name: ClassVar[str] = "force_drift"
    title: ClassVar[str] = "drift of the force zero"
    reference: ClassVar[str] = "ISO 376:2011, C.3 (drift of the zero); OIML R 60-1:2021, 3.9"
    signature: ClassVar[str] = (
        "A force that grows (or falls) with time, steadily or until it rests, whatever the deflection: all cycles "
        "shift, slack parts too."
    )
    rank: ClassVar[int] = 1
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter(
            "rate", "N/s", "mean change of the zero with time, on the first leg", Normal(0.0, 3e-4), (-1.0, 1.0), 0.0
        ),
        EffectParameter("exponent", "-", "power of the time with which it goes on", LogNormal(1.0, 0.28), (0.4, 3.0)),
        EffectParameter(
            "rest",
            "s",
            "time after which it comes to rest",
            LogNormal(500.0, 1.6),
            (1e-2, 1e7),
        ),
    )

    def read(self, p: Array, force: Array, path: Motion) -> Array:
        turns = np.flatnonzero(np.diff(path.leg))
        first = max(float(path.clock[turns[0] if turns.size else -1]), 1e-12)
        part = path.clock / first * (p[:, 2:3] + first) / (p[:, 2:3] + path.clock)
        return np.asarray(force + p[:, :1] * first * part ** p[:, 1:2])
