"""The shape of the deformed film."""

from __future__ import annotations

import numpy as np

from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.mechanics.near_flat import lifted, settled
from bayesmembrane.physics.mechanics.request import request
from bayesmembrane.physics.mechanics.ritz import solver as ritz
from bayesmembrane.physics.mechanics.solution import Profile, Status


def profile(
    material: Material,
    deflection: float,
    *,
    inner_radius: float,
    outer_radius: float,
    prestretch: float = 1.0,
    points: int = 201,
) -> Profile:
    """Deformed film at one deflection (m), at ``points`` radii equally spaced in ln R.

    f = R l2, h from the height polynomials of the Ritz solution (h = deflection at the disc, 0 at the ring), stretches
    and tensions from their derivatives. Of a film that is all but flat h is in proportion to the deflection, and what
    it is stretched to its square. All arrays are nan, and ``status`` says why, where the film has no solution.
    Raises `SettingsError` for radii or pre-stretches that make no sense.
    """
    asked = request(type(material), material.vector, abs(deflection), inner_radius, outer_radius, prestretch=prestretch)
    solved = lifted(asked)
    curves = settled(ritz.solve(solved), asked)
    status = Status(int(curves.status[0, 0]))
    t = np.linspace(0.0, np.log(asked.ratio), points)
    radius = inner_radius * np.exp(t)
    if status is not Status.OK:
        gap = np.full(points, np.nan)
        return Profile(radius, gap, gap, gap, gap, gap, gap, gap, np.nan, np.nan, status)
    l2, u, w, rise = ritz.shape(solved, t)
    side, lift = np.sign(deflection), float(solved.deflection[0, 0])
    part = abs(deflection) / lift if lift > 0 else 1.0
    l2, u = prestretch + part**2 * (l2 - prestretch), prestretch + part**2 * (u - prestretch)
    l1, rise = np.hypot(u, part * w), part * rise
    p1, p2 = material.tension(l1, l2)
    rho = inner_radius / prestretch
    return Profile(
        radius=radius,
        f=rho * np.exp(t) * l2,
        height=side * (abs(deflection) - rho * rise),
        l1=l1,
        l2=l2,
        angle=side * np.arctan2(part * w, u),
        tension_1=p1,
        tension_2=p2,
        force=float(curves.force[0, 0] * side),
        energy=float(curves.energy[0, 0]),
        status=status,
    )
