"""The shape of the deformed film."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.mechanics.near_flat import lifted, settled
from bayesmembrane.physics.mechanics.request import Request, request
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
    at = np.atleast_1d(deflection)
    asked = request(type(material), material.vector, at, inner_radius, outer_radius, prestretch=prestretch)
    return profiles(asked, points)[0]


def profiles(asked: Request, points: int = 201) -> list[Profile]:
    """`profile` of B films, each at the only deflection (B, 1) that is asked for: they are solved side by side."""
    at, l0 = asked.deflection, asked.prestretch[:, None]
    asked = replace(asked, deflection=np.abs(at))
    solved = lifted(asked)
    t = np.linspace(0.0, np.log(asked.ratio), points)
    found, (l2, u, w, rise) = ritz.shapes(solved, t)
    curves = settled(found, asked)
    side, lift = np.sign(at), solved.deflection
    part = np.divide(np.abs(at), lift, out=np.ones(lift.shape), where=lift > 0)
    l2, u = l0 + part**2 * (l2 - l0), l0 + part**2 * (u - l0)
    w, rise, rho = part * w, part * rise, asked.inner_radius / l0
    l1 = np.hypot(u, w)
    f, height, angle = rho * np.exp(t) * l2, side * (np.abs(at) - rho * rise), side * np.arctan2(w, u)
    out = []
    for b, film in enumerate(asked.parameters):
        with np.errstate(all="ignore"):
            tension = asked.material.from_vector(film).tension(l1[b], l2[b])
        force, energy = float(curves.force[b, 0] * side[b, 0]), float(curves.energy[b, 0])
        arrays = (asked.inner_radius * np.exp(t), f[b], height[b], l1[b], l2[b], angle[b], *tension)
        out.append(Profile(*arrays, force, energy, Status(int(curves.status[b, 0]))))
    return out
