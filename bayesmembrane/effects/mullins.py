"""Softening of the film below the largest deflection that it has seen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.special import erf

from bayesmembrane.effects.base import Carried, EffectParameter, State, running_max
from bayesmembrane.parameters import Array, HalfNormal, LogNormal


@dataclass(frozen=True)
class Mullins(Carried):
    """F = F0 (1 - softening erf((w_max - w) / (width w_full + w_max / 4))), with the work w = F0 delta.

    w_max is its largest value so far and w_full that of the whole test: unloading runs below loading, and reloading
    rejoins.
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
            "drop in work, relative to that of the whole test, over which it is lost",
            LogNormal(0.3, 1.0),
            (0.01, 10.0),
        ),
    )

    def carried(self, p: Array, force: Array, state: State) -> Array:
        work = state.work
        largest = running_max(work)
        # nan where the film has no force: such a draw has no reading anyway.
        full = np.max(largest, axis=1, keepdims=True)
        scale = np.maximum(p[:, 1:2] * full + 0.25 * largest, 1e-300)
        return np.asarray(force * (1.0 - p[:, :1] * erf((largest - work) / scale)))
