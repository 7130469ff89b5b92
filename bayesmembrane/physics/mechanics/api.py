"""One door to both solvers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.ground.errors import unknown_name
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import material as material_named
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.mechanics import fallback
from bayesmembrane.physics.mechanics.problem import Problem, problem
from bayesmembrane.physics.mechanics.profile import profile
from bayesmembrane.physics.mechanics.ritz import solver as ritz
from bayesmembrane.physics.mechanics.shooting import solver as shooting
from bayesmembrane.physics.mechanics.solution import Curves, Status

SOLVERS: MappingProxyType[str, Callable[[Problem, bool, str, float], Curves]] = MappingProxyType(
    {"ritz": fallback.solve, "ritz_alone": ritz.solve, "shooting": shooting.solve}
)
__all__ = ["SOLVERS", "force_curve", "profile", "ritz", "solve"]


def solve(
    material: type[Material],
    parameters: ArrayLike,
    deflection: ArrayLike,
    *,
    inner_radius: float,
    outer_radius: float,
    prestretch: ArrayLike = 1.0,
    sensitivities: bool = False,
    solver: str = "ritz",
    only: str = "all",
    exact_up_to: float = np.inf,
) -> Curves:
    """Force-deflection curves F = dE/d(delta) of B films at N deflections, in SI units.

    Parameters
    ----------
    material : class of the strain energy
    parameters : (B, n) or (n,) membrane parameters, N/m and dimensionless
    deflection : (N,), or (B, N) if films differ by small shifts, m; any order, repeats allowed
    inner_radius, outer_radius : radii of disc and ring as clamped, m
    prestretch : scalar or (B,) equibiaxial stretch before clamping
    sensitivities : also dF/d(parameters), from the factorisation that is there anyway
    solver : "ritz" (batched, exact derivatives; films it cannot resolve go to shooting), "ritz_alone" or "shooting"
    only : "convex" or "elliptic" saves effort on films that turn out not to be so: their flags need not be final
    exact_up_to : m; beyond it the Ritz solver only sees to it that films stay stable, and forces are good to 1e-3

    Raises `SettingsError` for arguments that make no sense. What the film cannot do is told by ``status``.
    """
    if solver not in SOLVERS:
        raise unknown_name("solver", solver, SOLVERS)
    return SOLVERS[solver](
        problem(material, parameters, deflection, inner_radius, outer_radius, prestretch),
        sensitivities,
        only,
        exact_up_to,
    )


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
    curves = solve(
        kind, vector, deflection, inner_radius=inner_radius, outer_radius=outer_radius, prestretch=prestretch
    )
    return curves.force[0], [Status(int(s)).label for s in curves.status[0]]
