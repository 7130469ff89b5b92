"""Frame, load cell and grips yield: the film gets less than the crosshead's travel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.ground.parameters import Array, HalfNormal
from bayesmembrane.physics.effects.base import Compliance, EffectParameter


@dataclass(frozen=True)
class MachineCompliance(Compliance):
    """delta_film = delta - compliance F.

    Joints seat and grips give: the compliance of real frames changes with the load, by tens of percents.
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
        EffectParameter("compliance", "m/N", "travel lost per newton", HalfNormal(3e-4), (0.0, 1e-2), 0.0),
    )

    def yielding(self, p: Array, force: Array) -> tuple[Array, Array]:
        return p[:, :1] * force, np.broadcast_to(p[:, :1], force.shape)
