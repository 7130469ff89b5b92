"""The question put to a solver, checked once: films, deflections, geometry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.materials.base import Material


@dataclass(frozen=True)
class Problem:
    """B films at N deflections, all finite, in SI units.

    Attributes
    ----------
    material : the strain energy
    parameters : (B, n) membrane parameters
    deflection : (B, N) m; a negative deflection gives the mirror image and the opposite force
    prestretch : (B,) equibiaxial stretch l0 > 0 of the film when it was clamped
    inner_radius, outer_radius : radii of the disc and of the ring, m
    """

    material: type[Material]
    parameters: Array
    deflection: Array
    prestretch: Array
    inner_radius: float
    outer_radius: float

    @property
    def scaled(self) -> Array:
        """(B, N) |deflection| over the stress-free inner radius R1/l0."""
        return np.abs(self.deflection) * self.prestretch[:, None] / self.inner_radius

    @property
    def ratio(self) -> float:
        """R2/R1."""
        return self.outer_radius / self.inner_radius


def problem(
    material: type[Material],
    parameters: ArrayLike,
    deflection: ArrayLike,
    inner_radius: float,
    outer_radius: float,
    prestretch: ArrayLike = 1.0,
) -> Problem:
    """Broadcast and check; raises `SettingsError` for shapes, radii or pre-stretches that make no sense."""
    p = np.atleast_2d(np.asarray(parameters, dtype=float))
    names = material.field_names()
    if p.ndim != 2 or p.shape[1] != len(names):
        raise SettingsError(f"{material.name} takes {len(names)} parameters ({', '.join(names)}), not {p.shape[-1]}")
    count, d = p.shape[0], np.asarray(deflection, dtype=float)
    if not count or not d.size:
        raise SettingsError("there is no film or no deflection to solve for", remedy="give at least one of each")
    if not np.all(np.isfinite(d)):
        raise SettingsError("a deflection is not a finite number", remedy="give deflections in metres")
    if d.ndim > 2 or (d.ndim == 2 and d.shape[0] not in (1, count)):
        raise SettingsError(
            f"the deflections have the shape {d.shape}", remedy=f"give one row for all films, or {count} rows"
        )
    l0 = np.asarray(prestretch, dtype=float)
    if l0.ndim > 1 or l0.size not in (1, count):
        raise SettingsError(
            f"the pre-stretches have the shape {l0.shape}", remedy=f"give one for all films, or {count} numbers"
        )
    if not np.all((l0 > 0) & np.isfinite(l0)):
        raise SettingsError("the pre-stretch must be a positive number", remedy="1 means clamped without stretch")
    if not 0 < inner_radius < outer_radius < np.inf:
        raise SettingsError(
            f"the inner radius ({inner_radius * 1e3:g} mm) must be positive and smaller than the outer one "
            f"({outer_radius * 1e3:g} mm)"
        )
    d = np.broadcast_to(np.atleast_1d(d), (count, d.shape[-1] if d.ndim else 1))
    return Problem(material, p, d, np.broadcast_to(l0, (count,)), float(inner_radius), float(outer_radius))


def extensibility(problem: Problem) -> Array:
    """(B,) the bound on I1 - 3 of each film, infinite unless its chains lock."""
    bound = problem.material.extensibility(problem.parameters.T)
    return np.broadcast_to(np.asarray(bound, dtype=float), problem.prestretch.shape)
