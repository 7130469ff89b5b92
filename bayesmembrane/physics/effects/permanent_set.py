"""The film stays longer after it was stretched."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.parameters import Array, HalfNormal, Normal, Uniform
from bayesmembrane.physics.effects._history import CREEPS, EXPONENT, REPEATED, SATURATION, growth, relaxing
from bayesmembrane.physics.effects.base import Deflection, EffectParameter, running_max

FLAT = 1e-3
"""Of the largest deflection so far: below it the shift changes no more, for a power is without bounds at zero."""


@dataclass(frozen=True)
class PermanentSet(Deflection):
    """delta_film = delta - set G (1 - rejoin y) (1 / (2 y))^relieved, y = delta / m, slack below; m: largest deflection
    so far.

    G is the growth law of the test (1 after a first loading to its full range), which the set follows with a delay, in
    holds and on the way back, too. ``rejoin`` 1 comes back to the first loading curve at m, 0 keeps the whole shift.
    What is lost may be a length (``relieved`` 0), or stay in the film as a force, which moves a flat, soft film further
    than a taut one (1 to 2, as the slope of its curve rises), or a stretch: a strip all of which is longer by a part e
    than it was is shifted by e (L + delta), so that ``rejoin`` is -m / L, and a film that was stretched most where it
    pulls most is shifted nearly in proportion to how far it is lifted (``relieved`` -1).
    """

    name: ClassVar[str] = "permanent_set"
    title: ClassVar[str] = "permanent set"
    reference: ClassVar[str] = "A. Dorfmann, R. W. Ogden, Int. J. Solids Struct. 41 (2004) 1855"
    signature: ClassVar[str] = (
        "After each new maximum the film comes back longer: mostly slack, so that unloading reaches zero force before "
        "zero deflection and reloading starts there, or softer at large deflections; more so after larger maxima."
    )
    rank: ClassVar[int] = 1
    of_the_material = True
    needs_return: ClassVar[bool] = True
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter(
            "set",
            "m",
            "shift at half of the largest deflection where nothing rejoins; of a lost length all of it",
            HalfNormal(1e-3),
            (0.0, 2e-2),
            0.0,
        ),
        EXPONENT,
        EffectParameter(
            "rejoin",
            "-",
            "part of the set that is gone when the previous maximum is reached again; below 0: that has come there",
            Uniform(-1.5, 1.0),
            (-1.5, 1.0),
        ),
        REPEATED,
        SATURATION,
        CREEPS,
        EffectParameter(
            "log_delay",
            "-",
            "ln of the time with which the set follows, over that of a first loading to the full range",
            Normal(-5.5, 1.3),
            (-11.0, 1.0),
        ),
        EffectParameter(
            "relieved",
            "-",
            "power by which the shift is larger the less the film is lifted; below 0: the more",
            Normal(0.3, 0.8),
            (-2.2, 4.0),
        ),
    )

    def deflect(self, p: Array, deflection: Array, path: Motion) -> Array:
        largest = running_max(deflection)
        grown = growth(p[:, 1:2], p[:, 3:4], deflection, path, p[:, 4:5], p[:, 5:6])
        delay = np.exp(p[:, 6:7]) * path.full_range / path.pace
        lasting = p[:, :1] * (grown - relaxing(grown, np.diff(path.clock, prepend=0.0), delay))
        with np.errstate(all="ignore"):
            part = np.where(largest > 0, np.maximum(deflection, 0.0) / largest, 0.0)
        further = (2 * np.maximum(part, FLAT)) ** -p[:, 7:8]
        return np.asarray(deflection - lasting * (1 - p[:, 2:3] * part) * further)

    def deflect_taut(self, p: Array, deflection: Array, path: Motion) -> Array:
        left = self.deflect(p, np.abs(deflection), path)
        return np.asarray(np.sign(deflection) * np.maximum(left, 0.0))  # no lost length pulls or pushes
