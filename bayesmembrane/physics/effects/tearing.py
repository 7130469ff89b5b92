"""A tear grows: less and less of the film carries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.ground.parameters import Array, HalfNormal
from bayesmembrane.physics.effects._history import EXPONENT, JUMP, JUMPS, PLACE, REPEATED, growth, jumped
from bayesmembrane.physics.effects.base import Carried, EffectParameter, FilmState


@dataclass(frozen=True)
class Tearing(Carried):
    """F = F0 exp(-loss [(1 - jump) G + jump / (1 + exp((place - m / D) / w))]), w = 0.015.

    G is the growth law of the test (1 after a first loading to its full range D), m the largest deflection so far: a
    film tears little by little, and by a jump.
    """

    name: ClassVar[str] = "tearing"
    title: ClassVar[str] = "tearing of the film"
    reference: ClassVar[str] = "R. S. Rivlin, A. G. Thomas, J. Polym. Sci. 10 (1953) 291"
    signature: ClassVar[str] = (
        "The whole curve is lower by the same part from one cycle to the next, also where first loading is passed; "
        "nothing comes back."
    )
    twins_at_any_speed: ClassVar[tuple[str, ...]] = ("mullins",)  # with damage alone both are less by what was reached
    sudden: ClassVar[bool] = True  # in a hold or a later cycle too, where its law knows no moment
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter(
            "loss", "-", "log of the part that still carries, after a first loading", HalfNormal(0.1), (0.0, 3.0), 0.0
        ),
        EXPONENT,
        REPEATED,
        JUMP,
        PLACE,
    )

    @property
    def starts(self) -> list[dict[str, float]]:
        return [*JUMPS]

    def carried(self, p: Array, force: Array, state: FilmState) -> Array:
        slow = growth(p[:, 1:2], p[:, 2:3], state.deflection, state.path)
        return np.asarray(force * np.exp(-p[:, :1] * jumped(p[:, 3:4], p[:, 4:5], slow, state.reached, state.path)))
