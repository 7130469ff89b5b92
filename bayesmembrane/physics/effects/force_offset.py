"""The load cell does not read zero without load."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.special import expit

from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.parameters import Array, LogNormal, Normal
from bayesmembrane.physics.effects.base import EffectParameter, Sensor


@dataclass(frozen=True)
class ForceOffset(Sensor):
    """F_read = F + offset [1 + hangs delta / D - s exp(-|delta| / lift)], with s = 1 / (1 + exp(-log_odds_resting)).

    A load cell that was tared while the disc, or what hangs from it, rested on something reads its weight once it is
    lifted (s = 1); one that was not tared reads it from the start (0). Of cables and hoses that hang from it more or
    less pulls as the disc goes to the full range D of the test.
    """

    name: ClassVar[str] = "force_offset"
    title: ClassVar[str] = "offset of the force zero"
    reference: ClassVar[str] = "ISO 376:2011, zero error of force-proving instruments"
    signature: ClassVar[str] = (
        "A constant force everywhere, also where the film is slack, or nearly so, if a cable hangs from the disc; or "
        "one that comes with the first of the way, where what was resting is lifted."
    )
    exact: ClassVar[bool] = True
    remembers: ClassVar[bool] = False
    mistaken: ClassVar[float] = 0.01
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("offset", "N", "reading without load", Normal(0.0, 0.03), (-1.0, 1.0), 0.0),
        EffectParameter(
            "log_odds_resting",
            "-",
            "log odds of the part of it that rests on something until the disc is lifted",
            Normal(-4.0, 3.0),
            (-20.0, 8.0),
        ),
        EffectParameter("lift", "m", "way on which that is lifted", LogNormal(1e-3, 0.7), (5e-5, 1e-2)),
        EffectParameter("hangs", "-", "part by which it is larger at the full range", Normal(0.0, 0.15), (-0.8, 0.8)),
    )

    @property
    def starts(self) -> list[dict[str, float]]:
        """All of it resting: of a part that hardly does, the way on which it is lifted is not seen."""
        return [{"log_odds_resting": 3.0}]

    def read(self, p: Array, force: Array, path: Motion) -> Array:
        resting = expit(p[:, 1:2]) * np.exp(-np.abs(path.deflection) / p[:, 2:3])
        more = p[:, 3:4] * path.deflection / path.full_range
        return np.asarray(force + p[:, :1] * (1 + more - resting))
