"""What a solver is asked, checked once: films, deflections, geometry, and how much of the answer is wanted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.materials.base import Material


class Spared(Enum):
    """Films on which no further effort is to be spent once a resolved state shows that they are such."""

    NONE = "none"
    NOT_CONVEX = "not convex"
    NOT_ELLIPTIC = "not elliptic"


@dataclass(frozen=True)
class Request:
    """Force-deflection curves F = dE/d(delta) of B films at N deflections, all finite, in SI units.

    `request` makes one and checks it.

    Attributes
    ----------
    material : class of the strain energy
    parameters : (B, n) membrane parameters, N/m and dimensionless
    deflection : (B, N) m, in any order; a negative deflection gives the mirror image and the opposite force
    prestretch : (B,) equibiaxial stretch l0 > 0 of the film when it was clamped
    inner_radius, outer_radius : radii of the disc and of the ring as clamped, m
    sensitivities : whether dF/d(parameters) is wanted too
    spare : the flags of such films need not be final
    read : of so many deflections, the first ones, the forces are read (None: all); the others show whether films stay
        stable and convex there, and their forces may be good to 1e-3
    solver : "ritz" (batched, exact derivatives; films that it cannot resolve are shot), "ritz_alone" or "shooting"
    """

    material: type[Material]
    parameters: Array
    deflection: Array
    prestretch: Array
    inner_radius: float
    outer_radius: float
    sensitivities: bool = False
    spare: Spared = Spared.NONE
    read: int | None = None
    solver: str = "ritz"

    @property
    def scaled(self) -> Array:
        """(B, N) |deflection| over the stress-free inner radius R1/l0."""
        return np.abs(self.deflection) * self.prestretch[:, None] / self.inner_radius

    @property
    def ratio(self) -> float:
        """R2/R1."""
        return self.outer_radius / self.inner_radius

    def of(self, films: NDArray[np.intp] | slice) -> Request:
        """The same asked of some films."""
        return replace(
            self,
            parameters=self.parameters[films],
            deflection=self.deflection[films],
            prestretch=self.prestretch[films],
        )


def request(
    material: type[Material],
    parameters: ArrayLike,
    deflection: ArrayLike,
    inner_radius: float,
    outer_radius: float,
    **more: Any,
) -> Request:
    """Broadcast and check; ``more`` are the other fields of `Request`.

    ``parameters`` (B, n) or (n,), ``deflection`` (N,) or (B, N), ``prestretch`` a number or (B,).
    Raises `SettingsError` for shapes, radii or pre-stretches that make no sense.
    """
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
    l0 = np.asarray(more.pop("prestretch", 1.0), dtype=float)
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
    l0 = np.broadcast_to(l0, (count,))
    return Request(material, p, d, l0, float(inner_radius), float(outer_radius), **more)


def extensibility(asked: Request) -> Array:
    """(B,) the bound on I1 - 3 of each film, infinite unless its chains lock."""
    bound = asked.material.extensibility(asked.parameters.T)
    return np.broadcast_to(np.asarray(bound, dtype=float), asked.prestretch.shape)
