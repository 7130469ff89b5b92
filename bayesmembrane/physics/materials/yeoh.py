"""Yeoh: a cubic in the first invariant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.ground.parameters import Array, Normal, Parameter
from bayesmembrane.physics.materials.base import LN_GD, Derivatives, Material
from bayesmembrane.physics.materials.invariants import first_invariant, of_first, rate_of_first

CURVED = 3.1
"""Bounds g.H^-1 g / K of the gradient g and the Hessian H of K, whose largest value is 3.074 at l1 = l2 = 1.556."""


@dataclass(frozen=True)
class Yeoh(Material):
    """W = c1 K + c2 K^2 + c3 K^3 with K = I1 - 3 and I1 = l1^2 + l2^2 + (l1 l2)^-2; G d = 2 c1."""

    c1: float
    c2: float
    c3: float

    name: ClassVar[str] = "yeoh"
    title: ClassVar[str] = "Yeoh"
    colour: ClassVar[str] = "#D55E00"
    reference: ClassVar[str] = "O. H. Yeoh, Rubber Chem. Technol. 66 (1993) 754"
    units: ClassVar[tuple[str, ...]] = ("N/m", "N/m", "N/m")
    meanings: ClassVar[tuple[str, ...]] = (
        "coefficient of I1 - 3",
        "coefficient of its square",
        "coefficient of its cube",
    )
    scales: ClassVar[tuple[int, ...]] = (1, 1, 1)
    coordinates: ClassVar[tuple[Parameter, ...]] = (
        LN_GD,
        Parameter("c2_c1", "-", "second coefficient relative to the first", Normal(0.0, 0.4), (-2.0, 2.0)),
        Parameter("c3_c1", "-", "third coefficient relative to the first", Normal(0.0, 0.015), (-0.5, 0.5)),
    )

    @staticmethod
    def derivatives(p: Any, l1: Any, l2: Any) -> Derivatives:
        i = first_invariant(l1, l2)
        k = i[0]
        psi = k * (p[0] + k * (p[1] + k * p[2]))
        return of_first(i, psi, p[0] + k * (2.0 * p[1] + 3.0 * k * p[2]), 2.0 * p[1] + 6.0 * k * p[2])

    @staticmethod
    def convex_everywhere(p: Any) -> Any:
        """c1 + (2 + 2 q) c2 K + (3 + 6 q) c3 K^2 > 0 for all K > 0, with q = `CURVED`.

        The Hessian of W is W' H + W'' g g^T with that H of K and its gradient g, and positive where W' + W'' g.H^-1 g
        is. Where W'' is negative, g.H^-1 g < q K bounds that from below.
        """
        linear, square = (2.0 + 2.0 * CURVED) * p[1], (3.0 + 6.0 * CURVED) * p[2]
        return (p[0] > 0) & (square >= 0) & ((linear >= 0) | (linear * linear < 4.0 * p[0] * square))

    @staticmethod
    def sensitivities(p: Any, l1: Any, l2: Any) -> tuple[tuple[Any, Any, Any], ...]:
        i = first_invariant(l1, l2)
        k = i[0]
        return (
            rate_of_first(i, k, 1.0),
            rate_of_first(i, k * k, 2.0 * k),
            rate_of_first(i, k * k * k, 3.0 * k * k),
        )

    @staticmethod
    def to_coordinates(p: ArrayLike) -> Array:
        c1, c2, c3 = np.asarray(p, dtype=float)
        with np.errstate(all="ignore"):
            return np.stack([np.log(2.0 * c1), c2 / c1, c3 / c1])

    @staticmethod
    def from_coordinates(x: ArrayLike) -> Array:
        ln_gd, b2, b3 = np.asarray(x, dtype=float)
        c1 = 0.5 * np.exp(ln_gd)
        return np.stack([c1, b2 * c1, b3 * c1])

    @staticmethod
    def neo_hookean(gd: float) -> Array:
        return np.array([np.log(gd), 0.0, 0.0])

    @staticmethod
    def shear_modulus(p: Any) -> Any:
        return 2.0 * p[0]
