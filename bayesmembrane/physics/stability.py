"""How far a material is stable in each mode of a test: Drucker's criterion, as finite element programs print it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.materials.base import Material

MODES: Mapping[str, Callable[[Array], Array]] = MappingProxyType(
    {
        "uniaxial": lambda stretch: stretch**-0.5,
        "planar": lambda stretch: np.ones_like(stretch),
        "equibiaxial": lambda stretch: stretch,
    }
)
"""Stretch across for a stretch along."""
COMPRESSION, TENSION = "compression", "tension"
SIDES: Mapping[str, float] = MappingProxyType({COMPRESSION: 0.1, TENSION: 10.0})
"""The stretch up to which each side is looked at: ten times shorter or longer."""
STATIONS, HALVINGS = 300, 40


@dataclass(frozen=True, eq=False)
class Stability:
    """Of B films of one material: the stretches at which they lose stability.

    limits : (mode, side) -> (B,) the first such stretch on the way from 1; nan where there is none up to `SIDES`, or
        the chains lock before
    """

    limits: Mapping[tuple[str, str], Array]

    def share(self, mode: str, side: str) -> float:
        """The part of the films that lose stability there at all."""
        return float(np.mean(np.isfinite(self.limits[mode, side])))


def stability(material: type[Material], parameters: ArrayLike) -> Stability:
    """Limits of films with membrane ``parameters`` (B, n).

    A state is stable where every small change does positive work, d tau : d ln(l) > 0 with Kirchhoff stresses tau: for
    plane stress and no change of volume that asks the matrix D_ij = l_i l_j W_ij + delta_ij l_i W_i to be positive
    definite (Abaqus, Theory Guide 4.6.1). Each side of stretch 1 is looked at in even steps of ln(l), and the first
    change of sign is halved down to round-off.
    """
    p = np.atleast_2d(np.asarray(parameters, dtype=float))
    return Stability(
        {
            (mode, side): _first(material, p, across, end)
            for mode, across in MODES.items()
            for side, end in SIDES.items()
        }
    )


def tangent(material: type[Material], parameters: Array, l1: Array, l2: Array) -> tuple[Array, Array, Array]:
    """(D11, D12, D22) of films (B, n) at stretches (B, N), N/m; nan outside of the energy's domain."""
    with np.errstate(all="ignore"):
        _, w1, w2, w11, w12, w22 = material.derivatives(parameters.T[:, :, None], l1, l2)
        return l1 * l1 * w11 + l1 * w1, l1 * l2 * w12 + 0.0 * l1, l2 * l2 * w22 + l2 * w2


def _first(material: type[Material], p: Array, across: Callable[[Array], Array], end: float) -> Array:
    """(B,) the first unstable stretch between 1 and ``end``, nan without any."""
    log = np.linspace(0.0, np.log(end), STATIONS + 1)[None, :]
    sign = _state(material, p, np.exp(np.repeat(log, len(p), axis=0)), across)
    bad, gone = sign < 0, np.isnan(sign)
    first = np.argmax(bad | gone, axis=1)
    rows = np.flatnonzero(bad[np.arange(len(p)), first])
    found = np.full(len(p), np.nan)
    if not rows.size:
        return found
    high = log[0, first[rows]]
    low = log[0, np.maximum(first[rows] - 1, 0)]
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        unstable = _state(material, p[rows], np.exp(middle)[:, None], across)[:, 0] < 0
        low, high = np.where(unstable, low, middle), np.where(unstable, middle, high)
    found[rows] = np.exp(high)
    return found


def _state(material: type[Material], p: Array, stretch: Array, across: Callable[[Array], Array]) -> NDArray[np.float64]:
    """(B, N) 1 where D is positive definite, -1 where it is not, nan outside of the domain."""
    d11, d12, d22 = tangent(material, p, stretch, across(stretch))
    with np.errstate(all="ignore"):
        least = np.minimum(d11 + d22, d11 * d22 - d12 * d12)
    return np.where(np.isnan(least), np.nan, np.where(least > 0, 1.0, -1.0))
