"""Films that are all but flat: no strain is left there that a double could tell from nothing, but the law is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.mechanics.request import Request
from bayesmembrane.physics.mechanics.solution import Curves

FLAT = 3e-4
"""Of the free width: below it strains are less than 3e-7 (4e-6 beside a pre-stretch, on the widest rigs) and the film
is linear elastic, to 2e-7 of its force. Solvers, which lose films of wide rigs from 4e-5 on, are asked for this
deflection instead."""


def lifted(request: Request) -> Request:
    """The same with no deflection below ``FLAT (R2 - R1)``, of films that were not clamped slack."""
    least = FLAT * (request.outer_radius - request.inner_radius)
    near = _near(request, least)
    if not np.any(near):
        return request
    d = np.where(near, np.where(request.deflection < 0, -least, least), request.deflection)
    return replace(request, deflection=d)


def settled(curves: Curves, request: Request) -> Curves:
    """Forces of the film that was asked for, from those of the `lifted` one:

        F(d) = (1 - k) F0 s^3 + k F0 s,  s = d / d0,  3 - 2 k = F0' d0 / F0,

    which is the law of a flat film without (k = 0) and of one with a pre-stretch (k = 1), and close to it between: up
    to a tenth of a force that is below 1e-11 N, where the pre-stretch is 1e-7 to 1e-5.
    """
    l0 = request.prestretch[:, None]
    lift = np.where(curves.deflection == 0, 1.0, curves.deflection)
    s = np.where(curves.deflection == 0, 1.0, request.deflection / lift)
    near = s != 1
    with np.errstate(invalid="ignore", divide="ignore"):
        k = np.where(l0 == 1, 0.0, np.clip((3 - curves.slope * lift / curves.force) / 2, 0.0, 1.0))
        work = curves.force * lift * ((1 - k) / 4 * (1 - s**4) + k / 2 * (1 - s**2))
    part = np.where(near, (1 - k) * s**3 + k * s, 1.0)
    slope = np.where(near, curves.force / lift * (3 * (1 - k) * s**2 + k), curves.slope)
    sensitivity = curves.sensitivity
    return replace(
        curves,
        deflection=request.deflection,
        force=np.where(near, curves.force * part, curves.force),
        slope=slope,
        sensitivity=None
        if sensitivity is None
        else np.where(near[..., None], sensitivity * part[..., None], sensitivity),
        max_stretch=np.where(near, l0 + (curves.max_stretch - l0) * s**2, curves.max_stretch),
        energy=np.where(near, curves.energy - work, curves.energy),
    )


def _near(request: Request, least: float) -> Array:
    """(B, N) True where the disc is all but level with the ring."""
    return np.asarray((np.abs(request.deflection) < least) & (request.prestretch >= 1)[:, None])
