"""The same film in FElupe: an axisymmetric solid, one quadratic element thick, clamped at its rims, lifted by the disc.

A user of FElupe would write this: there is no membrane element for large stretch in it. Lengths in mm, stresses in MPa.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import felupe as fe
import numpy as np
from tensortrax.math import log, trace
from tensortrax.math import sum as tsum
from tensortrax.math.linalg import det, eigvalsh

from bayesmembrane.ground.parameters import Array

STIFF = 1e4  # bulk modulus over shear modulus: less would soften the force by the strain of volume that is left
TOLERANCE = 1e-6  # of the norm of the forces left; round-off of the bulk keeps it from much less
ELEMENTS = 200
FIRST, GROWTH = 0.2, 1.25  # thicknesses of the first increment, where a flat film can only bend, and each to the next


@dataclass(frozen=True, eq=False)
class Lifted:
    """force : (N,) N; seconds : of a processor; increments : solved"""

    force: Array
    seconds: float
    increments: int


def _isochoric(C, energy):
    return energy(det(C) ** (-1 / 3) * C)


def _energy(name: str, c: Array, thickness: float):
    """W / d as a function of the isochoric right Cauchy-Green tensor; c (n,) N/m, thickness mm."""
    k = np.asarray(c) / thickness / 1e3

    def polynomial(C):
        return sum(v * (trace(C) - 3) ** (i + 1) for i, v in enumerate(k))

    def mooney_rivlin(C):
        return k[0] * (trace(C) - 3) + k[1] * ((trace(C) ** 2 - trace(C @ C)) / 2 - 3)

    def gent(C):
        return -k[0] * c[1] * log(1 - (trace(C) - 3) / c[1])

    def ogden(C):
        squares = eigvalsh(C)
        return sum(
            v / a * (tsum(squares ** (a / 2)) - 3) for v, a in zip(k[: len(k) // 2], c[len(c) // 2 :], strict=True)
        )

    of = {"neo_hookean": polynomial, "yeoh": polynomial, "mooney_rivlin": mooney_rivlin, "gent": gent, "ogden": ogden}
    return of[name]


def lifted(name: str, c: Array, thickness: float, rims: tuple[float, float], deflection: Array) -> Lifted:
    """Force at each deflection, mm, of a film with constants c (n,) N/m; thickness and radii of both rims in mm."""
    began, (inner, outer) = time.process_time(), rims
    mesh = fe.Rectangle(a=(0, inner), b=(thickness, outer), n=(2, ELEMENTS + 1))
    mesh = fe.mesh.add_midpoints_edges(mesh)
    field = fe.FieldContainer([fe.FieldAxisymmetric(fe.RegionQuadraticQuad(mesh), dim=2)])
    umat = fe.Hyperelastic(_isochoric, energy=_energy(name, c, thickness))
    solid = fe.SolidBodyNearlyIncompressible(umat, field, bulk=STIFF * 2e-3 * c[0] / thickness)
    bounds = {
        "ring": fe.Boundary(field[0], fy=outer),
        "disc, radial": fe.Boundary(field[0], fy=inner, skip=(1, 0)),
        "disc": fe.Boundary(field[0], fy=inner, skip=(0, 1)),
    }
    ways = _ways(FIRST * thickness, deflection)
    step = fe.Step(items=[solid], ramp={bounds["disc"]: ways}, boundaries=bounds)
    curve = fe.CharacteristicCurve(steps=[step], boundary=bounds["disc"])
    curve.evaluate(verbose=False, tol=TOLERANCE)
    force = np.abs([y[0] for y in curve.y])[-len(ways) :]
    return Lifted(force[np.searchsorted(ways, deflection)], time.process_time() - began, len(ways))


def _ways(first: float, deflection: Array) -> Array:
    """Deflections in steps that grow from ``first``, with all of ``deflection`` among them, increasing."""
    ways, at = [], 0.0
    for end in np.sort(deflection):
        while at < end:
            step = max(first, (GROWTH - 1) * at)
            at = end if at + 1.5 * step > end else at + step
            ways.append(at)
    return np.array(ways)
