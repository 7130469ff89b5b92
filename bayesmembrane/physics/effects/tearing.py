"""A tear grows: less and less of the film carries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.ground.parameters import Array, HalfNormal, LogNormal, Uniform
from bayesmembrane.physics.effects._history import CREEPS, EXPONENT, JUMP, REPEATED, SATURATION, growth
from bayesmembrane.physics.effects.base import Carried, EffectParameter, FilmState
from bayesmembrane.physics.reach import SOURCE

PLACES = (0.15, 0.27, 0.39, 0.51, 0.63, 0.75, 0.87)
"""Of the duration: moments to begin a search with, for one is found from nearby only."""


@dataclass(frozen=True)
class Tearing(Carried):
    """F = F0 exp(-loss [(1 - jump) G + jump (1 - exp(-(t - moment) / takes))]), the second part from the moment on.

    G is the growth law of the test (1 after a first loading to its full range), t the time since its start: a film
    tears little by little as it is stretched, and a tear runs at some moment, be it in a hold, and comes to rest.
    Without times the clock is the distance travelled at 1 mm/s.
    """

    name: ClassVar[str] = "tearing"
    title: ClassVar[str] = "tearing of the film"
    reference: ClassVar[str] = "R. S. Rivlin, A. G. Thomas, J. Polym. Sci. 10 (1953) 291"
    signature: ClassVar[str] = (
        "The whole curve is lower by the same part from one cycle to the next, also where first loading is passed; "
        "nothing comes back."
    )
    twins_at_any_speed: ClassVar[tuple[str, ...]] = ("mullins",)  # with damage alone both are less by what was reached
    sudden: ClassVar[bool] = True
    begins: ClassVar[str] = "moment"
    scales_with_modulus: ClassVar[bool] = True
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter(
            "loss", "-", "log of the part that still carries, after a first loading", HalfNormal(0.1), (0.0, 3.0), 0.0
        ),
        EXPONENT,
        REPEATED,
        SATURATION,
        JUMP,
        EffectParameter(
            "moment",
            "s",
            "when a tear runs",
            Uniform(0.0, SOURCE.duration),
            (0.0, SOURCE.duration),
            of_the_test=True,
        ),
        EffectParameter(
            "takes",
            "s",
            "time after which it has nearly come to rest",
            LogNormal(0.02 * SOURCE.duration, 0.95),
            (0.001 * SOURCE.duration, 0.5 * SOURCE.duration),
            of_the_test=True,
        ),
        CREEPS,
    )

    @property
    def starts(self) -> list[dict[str, float]]:
        whole = next(c.bounds[1] for c in self.coordinates if c.name == "moment")
        return [{"jump": 0.05}, *({"jump": 0.6, "moment": part * whole, "takes": 0.03 * whole} for part in PLACES)]

    def carried(self, p: Array, force: Array, state: FilmState) -> Array:
        slow = growth(p[:, 1:2], p[:, 2:3], state.deflection, state.path, p[:, 3:4], p[:, 7:8])
        since = np.maximum(state.path.clock - p[:, 5:6], 0.0)
        ran = -np.expm1(-since / p[:, 6:7])
        return np.asarray(force * np.exp(-p[:, :1] * ((1 - p[:, 4:5]) * slow + p[:, 4:5] * ran)))
