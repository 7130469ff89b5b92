"""Mooney-Rivlin: linear in both invariants."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.ground.parameters import Array, Normal, Parameter
from bayesmembrane.physics.materials.base import LN_GD, Derivatives, Material
from bayesmembrane.physics.materials.invariants import both_invariants, of_both, rate_of_both


@dataclass(frozen=True)
class MooneyRivlin(Material):
    """W = c1 (I1 - 3) + c2 (I2 - 3); G d = 2 (c1 + c2).

    I1 = l1^2 + l2^2 + (l1 l2)^-2 and I2 = (l1 l2)^2 + l1^-2 + l2^-2. Sampled in G d and the share c2 / (c1 + c2), which
    may be negative.
    """

    c1: float
    c2: float

    name: ClassVar[str] = "mooney_rivlin"
    title: ClassVar[str] = "Mooney-Rivlin"
    colour: ClassVar[str] = "#E69F00"
    reference: ClassVar[str] = (
        "M. Mooney, J. Appl. Phys. 11 (1940) 582; R. S. Rivlin, Phil. Trans. R. Soc. A 241 (1948) 379"
    )
    units: ClassVar[tuple[str, ...]] = ("N/m", "N/m")
    meanings: ClassVar[tuple[str, ...]] = ("coefficient of I1 - 3", "coefficient of I2 - 3")
    scales: ClassVar[tuple[int, ...]] = (1, 1)
    coordinates: ClassVar[tuple[Parameter, ...]] = (
        LN_GD,
        Parameter("share", "-", "share of the second coefficient, c2 / (c1 + c2)", Normal(0.0, 0.5), (-3.0, 3.0)),
    )

    @staticmethod
    def derivatives(p: Any, l1: Any, l2: Any) -> Derivatives:
        i = both_invariants(l1, l2)
        return of_both(i, p[0] * i[0][0] + p[1] * i[1][0], (p[0], p[1]), (0.0, 0.0, 0.0))

    @staticmethod
    def sensitivities(p: Any, l1: Any, l2: Any) -> tuple[tuple[Any, Any, Any], ...]:
        i = both_invariants(l1, l2)
        return rate_of_both(i, i[0][0], 1.0, 0.0), rate_of_both(i, i[1][0], 0.0, 1.0)

    @staticmethod
    def to_coordinates(p: ArrayLike) -> Array:
        c1, c2 = np.asarray(p, dtype=float)
        with np.errstate(all="ignore"):
            ln_gd = np.log(2.0 * (c1 + c2))
            return np.stack([ln_gd, np.where(np.isfinite(ln_gd), c2 / (c1 + c2), np.nan)])

    @staticmethod
    def from_coordinates(x: ArrayLike) -> Array:
        ln_gd, share = np.asarray(x, dtype=float)
        half = 0.5 * np.exp(ln_gd)
        return np.stack([(1.0 - share) * half, share * half])

    @staticmethod
    def neo_hookean(gd: float) -> Array:
        return np.array([np.log(gd), 0.0])

    @staticmethod
    def shear_modulus(p: Any) -> Any:
        return 2.0 * (p[0] + p[1])
