"""The film is a thin plate: bending at clamp and disc adds stiffness before the membrane is taut."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.ground.parameters import Array, HalfNormal
from bayesmembrane.physics.effects.base import Carried, EffectParameter, FilmState

THINNEST = 200e-6  # m


@dataclass(frozen=True)
class ClampBending(Carried):
    """F = F0 + stiffness delta while delta > 0: the linear stiffness of a clamped plate beside that of the membrane."""

    name: ClassVar[str] = "clamp_bending"
    title: ClassVar[str] = "bending stiffness of the film"
    reference: ClassVar[str] = (
        "S. P. Timoshenko, S. Woinowsky-Krieger, Theory of Plates and Shells, 2nd ed. (1959), 17, 97"
    )
    signature: ClassVar[str] = (
        "A force proportional to the deflection, seen in the flat toe of the curve, the same on all legs; stiffer "
        "materials hide it at large deflections."
    )
    needs_clamp: ClassVar[bool] = True
    remembers: ClassVar[bool] = False
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("stiffness", "N/m", "linear stiffness of the plate", HalfNormal(0.5), (0.0, 50.0), 0.0),
    )

    def negligible(self, thickness: float) -> str:
        # E h^3 / (0.1 R2^2) with E = 1 MPa, R2 = 35 mm: 1e-3 N/m at 50 um, 0.07 N/m or 1 mN at 15 mm here.
        if thickness < THINNEST:
            return f"a film of {1e6 * thickness:g} um bends too easily: below a millinewton"
        return ""

    def carried(self, p: Array, force: Array, state: FilmState) -> Array:
        return np.asarray(force + p[:, :1] * np.maximum(state.deflection, 0.0))
