"""A tear grows: less and less of the film carries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.effects._history import EXPONENT, REPEATED, growth
from bayesmembrane.effects.base import Carried, EffectParameter, State
from bayesmembrane.parameters import Array, HalfNormal


@dataclass(frozen=True)
class Tearing(Carried):
    """F = F0 exp(-loss G), with the growth G of the test (1 after a first loading to its full range)."""

    name: ClassVar[str] = "tearing"
    title: ClassVar[str] = "tearing of the film"
    reference: ClassVar[str] = "R. S. Rivlin, A. G. Thomas, J. Polym. Sci. 10 (1953) 291"
    signature: ClassVar[str] = (
        "The whole curve is lower by the same part from one cycle to the next, also where first loading is passed; "
        "nothing comes back."
    )
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter(
            "loss", "-", "log of the part that still carries, after a first loading", HalfNormal(0.1), (0.0, 3.0), 0.0
        ),
        EXPONENT,
        REPEATED,
    )

    def carried(self, p: Array, force: Array, state: State) -> Array:
        return np.asarray(force * np.exp(-p[:, :1] * growth(p[:, 1:2], p[:, 2:3], state.deflection, state.path)))
