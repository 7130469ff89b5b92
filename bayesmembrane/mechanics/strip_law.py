"""The law of a homogeneous test, in closed form: F = width P1(l, l2(l)) with l = 1 + delta / L."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.materials.base import Material
from bayesmembrane.mechanics.solution import Status
from bayesmembrane.parameters import Array
from bayesmembrane.rigs.base import Strip


@dataclass(frozen=True)
class StripLaw:
    """F(delta) of B films.

    material, parameters : the films (B, n)
    rig : length, width and lateral stretch
    pushes : True if the specimen bears compression; else it is slack there
    """

    material: type[Material]
    parameters: Array
    rig: Strip
    pushes: bool = False

    @property
    def status(self) -> NDArray[np.int8]:
        """(B,) `Status` where there is no force: the chains are stretched out."""
        return np.full(len(self.parameters), Status.LOCKED, np.int8)

    def __call__(self, deflection: Array, excess: Array | None = None) -> tuple[Array, Array]:
        """((B, N) N, (B, N) N/m): force and dF/d(delta) at deflections (B, N) m; nan where there is none.

        With ``excess`` e (B, N) the strip is longer by that part: l = (1 + delta / L) / (1 + e).
        """
        longer = 1.0 if excess is None else 1.0 + excess
        stretch = (1.0 + deflection / self.rig.length) / longer
        pulled = np.maximum(stretch, 1e-3 if self.pushes else 1.0)
        l2, dl2 = self.rig.lateral(pulled)
        with np.errstate(all="ignore"):
            _, p1, _, p11, p12, _ = self.material.derivatives(self.parameters.T[:, :, None], pulled, l2)
        width = self.rig.width
        force = np.where(pulled == stretch, width * p1, 0.0 * p1)
        slope = np.where(pulled == stretch, width * (p11 + p12 * dl2) / (self.rig.length * longer), 0.0 * p1)
        return force, slope

    def varied(self, change: Array) -> StripLaw:
        """The law of films whose parameters differ by ``change`` (B, n)."""
        return replace(self, parameters=self.parameters + change)

    @staticmethod
    def stack(laws: Sequence[StripLaw]) -> StripLaw:
        """The films of all laws, one after the other."""
        return replace(laws[0], parameters=np.concatenate([law.parameters for law in laws]))


def margins(material: type[Material], films: Array, rig: Strip, deflection: Array) -> tuple[Array, Array]:
    """((B, M), (B, M)): least eigenvalue of the Hessian of W, and least of P11 and P22, over G d.

    films : (B, n) membrane parameters
    deflection : (M,) m, states at which they are taken; nan where there is none
    """
    stretch = np.maximum(1.0 + deflection / rig.length, 1e-3)
    l2, _ = rig.lateral(stretch)
    with np.errstate(all="ignore"):
        *_, a, b, c = material.derivatives(films.T[:, :, None], stretch, l2)
        gd = np.abs(np.asarray(material.shear_modulus(films.T)))[:, None]
        least = 0.5 * (a + c) - np.sqrt(0.25 * (a - c) ** 2 + b * b)
    return np.asarray(least / gd), np.asarray(np.minimum(a, c) / gd)
