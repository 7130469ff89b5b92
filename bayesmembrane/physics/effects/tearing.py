"""A tear grows: less and less of the film carries."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from bayesmembrane.ground.parameters import Array, HalfNormal, LogNormal, Uniform
from bayesmembrane.physics.effects._history import CREEPS, EXPONENT, JUMP, REPEATED, SATURATION, SECOND, growth
from bayesmembrane.physics.effects.base import Carried, EffectParameter, FilmState
from bayesmembrane.physics.reach import SOURCE

PLACES = (0.15, 0.27, 0.39, 0.51, 0.63, 0.75, 0.87)
"""Of the duration: moments to begin a search with, for one is found from nearby only."""
MOMENT = EffectParameter(
    "moment",
    "s",
    "when a tear runs",
    Uniform(0.0, SOURCE.duration),
    (0.0, SOURCE.duration),
    of_the_test=True,
    event="clock",
)
IN_A_WHILE, AT_ONCE = 0.03, 2e-3
"""Of the duration: what a tear takes that is searched for."""
SECOND_PLACES = tuple(np.linspace(0.02, 0.98, 33).tolist())
"""Of the duration: moments at which a second one may run."""


@dataclass(frozen=True)
class Tearing(Carried):
    """F = F0 exp(-loss [(1 - jump) G + jump ((1 - second) R(moment) + second R(second_moment))]),
    R(m) = 1 - exp(-(t - m) / takes) from the moment m on.

    G is the growth law of the test (1 after a first loading to its full range), t the time since its start: a film
    tears little by little as it is stretched, and a tear runs at some moment, be it in a hold, comes to rest, and may
    run once more. Without times the clock is the distance travelled at 1 mm/s.
    """

    name: ClassVar[str] = "tearing"
    title: ClassVar[str] = "tearing of the film"
    reference: ClassVar[str] = "R. S. Rivlin, A. G. Thomas, J. Polym. Sci. 10 (1953) 291"
    signature: ClassVar[str] = (
        "The whole curve is lower by the same part from one cycle to the next, also where first loading is passed; "
        "nothing comes back."
    )
    twins_at_any_speed: ClassVar[tuple[str, ...]] = ("mullins",)  # with damage alone both are less by what was reached
    twins_one_way: ClassVar[tuple[str, ...]] = ("clamp_slip",)  # both are a force that falls; what slid is slack later
    like_foreign: ClassVar[tuple[str, ...]] = ("sudden_change", "lost_steps")
    begins: ClassVar[str] = "moment"
    second: ClassVar[tuple[str, str, str] | None] = ("second", "moment", "second_moment")
    scales_with_modulus: ClassVar[bool] = True
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter(
            "loss", "-", "log of the part that still carries, after a first loading", HalfNormal(0.1), (0.0, 3.0), 0.0
        ),
        EXPONENT,
        REPEATED,
        SATURATION,
        JUMP,
        MOMENT,
        EffectParameter(
            "takes",
            "s",
            "time after which it has nearly come to rest",
            LogNormal(0.02 * SOURCE.duration, 0.95),
            (0.001 * SOURCE.duration, 0.5 * SOURCE.duration),
            of_the_test=True,
        ),
        CREEPS,
        SECOND,
        replace(MOMENT, name="second_moment", meaning="when it runs once more"),
    )

    @property
    def starts(self) -> list[dict[str, float]]:
        whole = self._whole
        return [
            {"jump": 0.05},
            *({"jump": 0.6, "moment": part * whole, "takes": IN_A_WHILE * whole} for part in PLACES),
        ]

    def come_at(self, moment: float) -> list[dict[str, float]]:
        """In a while, and at once."""
        return [
            {"jump": jump, "moment": moment, "takes": takes * self._whole}
            for jump, takes in ((0.6, IN_A_WHILE), (0.9, AT_ONCE))
        ]

    @property
    def second_places(self) -> list[float]:
        return [part * self._whole for part in SECOND_PLACES]

    @property
    def _whole(self) -> float:
        """s: how long the test takes."""
        return next(c.bounds[1] for c in self.coordinates if c.name == "moment")

    def carried(self, p: Array, force: Array, state: FilmState) -> Array:
        slow = growth(p[:, 1:2], p[:, 2:3], state.deflection, state.path, p[:, 3:4], p[:, 7:8])
        first, then = (-np.expm1(-np.maximum(state.path.clock - p[:, i : i + 1], 0.0) / p[:, 6:7]) for i in (5, 9))
        ran = first + p[:, 8:9] * (then - first)
        return np.asarray(force * np.exp(-p[:, :1] * ((1 - p[:, 4:5]) * slow + p[:, 4:5] * ran)))
