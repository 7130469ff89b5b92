"""One door to both solvers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.ground.errors import unknown_name
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import material as material_named
from bayesmembrane.physics.mechanics import fallback
from bayesmembrane.physics.mechanics.near_flat import lifted, settled
from bayesmembrane.physics.mechanics.profile import profile, profiles
from bayesmembrane.physics.mechanics.request import Request, Spared, request
from bayesmembrane.physics.mechanics.ritz import solver as ritz
from bayesmembrane.physics.mechanics.ritz.simd import LANES
from bayesmembrane.physics.mechanics.solution import Curves, Status, joined

Solve = Callable[[Request], Curves]
"""`solve`, or something in front of it."""

SOLVERS: MappingProxyType[str, Solve] = MappingProxyType(
    {"ritz": fallback.solve, "ritz_alone": ritz.solve, "shooting": fallback.shoot}
)
TOGETHER = 2**14
"""Forces that are solved for at once: what a solver needs beside them is many times as large as they are."""
__all__ = ["SOLVERS", "Request", "Solve", "Spared", "force_curve"]
__all__ += ["profile", "profiles", "request", "ritz", "solve", "unaided"]


def solve(request: Request) -> Curves:
    """Force-deflection curves F = dE/d(delta) of B films at N deflections, in SI units.

    Raises `SettingsError` for an unknown solver. What the film cannot do is told by ``status``.
    """
    if request.solver not in SOLVERS:
        raise unknown_name("solver", request.solver, SOLVERS)
    films, deflections = request.deflection.shape
    some = LANES * max(1, TOGETHER // deflections // LANES)
    parts = [slice(i, i + some) for i in range(0, films, some)]
    solver, asked = SOLVERS[request.solver], lifted(request)
    found = solver(asked) if len(parts) == 1 else joined([solver(asked.of(part)) for part in parts])
    return found if asked is request else settled(found, request)


def unaided(asked: Request, solve: Solve = solve) -> Curves:
    """What ``solve`` gives by the Ritz method alone: a film that it cannot resolve to 1e-6 stays without a force.

    For maps and first searches, which ask for many films that are no sensible ones: shooting at each of them takes a
    hundred to a thousand times longer.
    """
    return solve(replace(asked, solver="ritz_alone"))


def force_curve(
    material: str,
    parameters: Sequence[float],
    deflection: ArrayLike,
    inner_radius: float = 0.010,
    outer_radius: float = 0.035,
    prestretch: float = 1.0,
) -> tuple[Array, list[str]]:
    """Forces (N,) in newtons of one film at deflections (N,) in metres, and the status of each as a word."""
    kind = material_named(material)
    vector = kind.from_vector(np.asarray(parameters, dtype=float)).vector
    curves = solve(request(kind, vector, deflection, inner_radius, outer_radius, prestretch=prestretch))
    return curves.force[0], [Status(int(s)).label for s in curves.status[0]]
