"""Simulated tests of one material, in closed form: strips and sheets, whose forces are solved with nothing."""

from __future__ import annotations

import numpy as np

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.base import Rig
from bayesmembrane.physics.rigs.equibiaxial import Equibiaxial
from bayesmembrane.physics.rigs.uniaxial import Uniaxial

STRIP, SHEET = Uniaxial(), Equibiaxial()


def made(
    rig: Rig,
    name: str,
    parameters: tuple[float, ...],
    *,
    top: float = 0.05,
    points: int = 15,
    thickness: float = 1e-4,
    noise: float = 0.01,
    stated: bool = True,
    seed: int = 0,
    specimen: str = "strip",
) -> Measurement:
    """Forces of membrane ``parameters`` (N/m) of a film 0.1 mm thick, with ``noise`` times the largest one."""
    x = np.linspace(top / points, top, points)
    film = Specimen(specimen, thickness)
    clean = Measurement(x, np.ones(points), rig, film)
    vector = np.array([parameters]) * (thickness / 1e-4) ** np.asarray(hypothesis(name).material.scales)
    force = Forward(hypothesis(name), clean, x).film_force(vector)[0]
    sd = noise * float(np.max(force))
    force = force + sd * np.random.default_rng(seed).standard_normal(points)
    return Measurement(x, force, rig, film, force_sd=np.full(points, sd) if stated and sd else None)
