"""Gent: chains of limited extensibility."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.ground.parameters import Array, Normal, Parameter
from bayesmembrane.physics.materials.base import LN_GD, Derivatives, Material
from bayesmembrane.physics.materials.invariants import first_invariant, of_first, rate_of_first


@dataclass(frozen=True)
class Gent(Material):
    """W = -c1 c2 ln(1 - K / c2) with K = I1 - 3 and I1 = l1^2 + l2^2 + (l1 l2)^-2; G d = 2 c1.

    c2 = Jm is the limit: states with K >= Jm do not exist, and everything is nan there. The 3-D form is
    -mu Jm / 2 ln(1 - K / Jm), so that c1 = d mu / 2.
    """

    c1: float
    c2: float

    name: ClassVar[str] = "gent"
    title: ClassVar[str] = "Gent"
    colour: ClassVar[str] = "#009E73"
    reference: ClassVar[str] = "A. N. Gent, Rubber Chem. Technol. 69 (1996) 59"
    units: ClassVar[tuple[str, ...]] = ("N/m", "-")
    meanings: ClassVar[tuple[str, ...]] = ("half the shear modulus x thickness", "limit of I1 - 3")
    scales: ClassVar[tuple[int, ...]] = (1, 0)
    coordinates: ClassVar[tuple[Parameter, ...]] = (
        LN_GD,
        Parameter("ln_jm", "-", "logarithm of the limit of I1 - 3", Normal(np.log(50.0), 1.5), (-3.0, 23.0)),
    )

    @staticmethod
    def derivatives(p: Any, l1: Any, l2: Any) -> Derivatives:
        i = first_invariant(l1, l2)
        u = i[0] / p[1]
        t = 1.0 - u
        r = 1.0 / t
        # ln(1 - u) with the rounding error of 1 - u put back: exact for u -> 0, nan beyond the limit.
        ln = np.log(t) + ((1.0 - t) - u) * r
        # 0 ln carries that nan into the derivatives, which would be finite there.
        d = p[0] * r + 0.0 * ln
        return of_first(i, 0.0 * ln - p[0] * p[1] * ln, d, d * r / p[1])

    @staticmethod
    def convex_everywhere(p: Any) -> Any:
        """W rises with K ever faster, and K is convex in the stretches."""
        return (p[0] > 0) & (p[1] > 0)

    @staticmethod
    def sensitivities(p: Any, l1: Any, l2: Any) -> tuple[tuple[Any, Any, Any], ...]:
        i = first_invariant(l1, l2)
        u = i[0] / p[1]
        t = 1.0 - u
        ln = np.log(t) + ((1.0 - t) - u) / t
        r = 1.0 / t + 0.0 * ln
        return (
            rate_of_first(i, 0.0 * ln - p[1] * ln, r),
            rate_of_first(i, -p[0] * (ln + u * r), -p[0] * u * r * r / p[1]),
        )

    @staticmethod
    def to_coordinates(p: ArrayLike) -> Array:
        c1, jm = np.asarray(p, dtype=float)
        with np.errstate(all="ignore"):
            return np.stack([np.log(2.0 * c1), np.log(jm)])

    @staticmethod
    def from_coordinates(x: ArrayLike) -> Array:
        ln_gd, ln_jm = np.asarray(x, dtype=float)
        return np.stack([0.5 * np.exp(ln_gd), np.exp(ln_jm)])

    @staticmethod
    def neo_hookean(gd: float) -> Array:
        return np.array([np.log(gd), Gent.coordinates[1].bounds[1]])

    @staticmethod
    def shear_modulus(p: Any) -> Any:
        return 2.0 * p[0]

    @staticmethod
    def extensibility(p: Any) -> Any:
        return p[1]
