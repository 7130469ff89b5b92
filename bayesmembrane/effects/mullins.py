"""Softening of the film below the largest deflection that it has seen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.special import erf

from bayesmembrane.effects.base import Carried, EffectParameter, State
from bayesmembrane.parameters import Array, HalfNormal, LogNormal


@dataclass(frozen=True)
class Mullins(Carried):
    """F = F0 (1 - softening erf((m^2 - delta^2) / (width D^2 + m^2 / 4))), m: largest deflection so far.

    Far out the stored energy of the reference grows like delta^2, which stands for it here; D is the full range of the
    test. Unloading runs below loading, and reloading rejoins at m.
    """

    name: ClassVar[str] = "mullins"
    title: ClassVar[str] = "Mullins softening"
    reference: ClassVar[str] = "R. W. Ogden, D. G. Roxburgh, Proc. R. Soc. A 455 (1999) 2861"
    signature: ClassVar[str] = (
        "Unloading and reloading below the previous maximum are softer than first loading and coincide with each "
        "other; the curve rejoins first loading where the previous maximum is passed."
    )
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter(
            "softening", "-", "part of the force that is lost far below the maximum", HalfNormal(0.2), (0.0, 0.95), 0.0
        ),
        EffectParameter(
            "width",
            "-",
            "drop in delta^2 over which it is lost, relative to the square of the full range",
            LogNormal(0.3, 1.0),
            (0.01, 10.0),
        ),
    )

    def carried(self, p: Array, force: Array, state: State) -> Array:
        now, largest = np.maximum(state.deflection, 0.0) ** 2, state.reached**2
        scale = p[:, 1:2] * state.path.full_range**2 + 0.25 * largest
        return np.asarray(force * (1.0 - p[:, :1] * erf((largest - now) / scale)))
