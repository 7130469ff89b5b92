"""Frame, load cell and grips yield: the film gets less than the crosshead's travel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.ground.parameters import Array, Lomax, Normal
from bayesmembrane.physics.effects.base import Compliance, EffectParameter

NEWTON = 1.0  # N: the force at which the compliance is what its name says, whatever the exponent
SMALLEST = 1e-9  # N: below it a power less than one has no slope


@dataclass(frozen=True)
class MachineCompliance(Compliance):
    """delta_film = delta - compliance F |F / 1 N|^(exponent - 1).

    Beams and load cells yield in proportion to the force (1), contacts of round bodies as F^(2/3) (H. Hertz, J. Reine
    Angew. Math. 92 (1882) 156), rough seats, whose stiffness grows with the force, more nearly as its logarithm, joints
    that open the other way round: the compliance of real frames changes with the load, by tens of percents. And frames
    differ by orders of magnitude: a prior that falls like a normal one would rather let the film be softer than the
    frame.
    """

    name: ClassVar[str] = "machine_compliance"
    title: ClassVar[str] = "compliance of the machine"
    reference: ClassVar[str] = "S. R. Kalidindi, A. Abusafieh, E. El-Danaf, Exp. Mech. 37 (1997) 210"
    signature: ClassVar[str] = (
        "Too soft where the force is high: the residual follows force times slope, alike on all legs, and a blank run "
        "shows it."
    )
    remembers: ClassVar[bool] = False
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("compliance", "m/N", "travel lost by the first newton", Lomax(5e-4), (0.0, 1e-2), 0.0),
        EffectParameter("exponent", "-", "of the force that the travel lost grows with", Normal(0.8, 0.16), (0.3, 1.4)),
    )

    def yielding(self, p: Array, force: Array) -> tuple[Array, Array]:
        compliance, exponent = p[:, :1], p[:, 1:2]
        secant = compliance * (np.maximum(np.abs(force), SMALLEST) / NEWTON) ** (exponent - 1)
        return secant * force, exponent * secant
