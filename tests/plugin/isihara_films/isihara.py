"""Isihara: Mooney-Rivlin with the square of the first invariant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.ground.parameters import Array, Normal, Parameter
from bayesmembrane.physics.materials.base import LN_GD, Derivatives, Material
from bayesmembrane.physics.materials.invariants import both_invariants, of_both, rate_of_both


@dataclass(frozen=True)
class Isihara(Material):
    """W = c1 K1 + c2 K2 + c3 K1^2 with K1 = I1 - 3 and K2 = I2 - 3; G d = 2 (c1 + c2)."""

    c1: float
    c2: float
    c3: float

    name: ClassVar[str] = "isihara"
    title: ClassVar[str] = "Isihara"
    reference: ClassVar[str] = "A. Isihara, N. Hashitsume, M. Tatibana, J. Chem. Phys. 19 (1951) 1508"
    units: ClassVar[tuple[str, ...]] = ("N/m", "N/m", "N/m")
    meanings: ClassVar[tuple[str, ...]] = (
        "coefficient of I1 - 3",
        "coefficient of I2 - 3",
        "coefficient of its square",
    )
    scales: ClassVar[tuple[int, ...]] = (1, 1, 1)
    coordinates: ClassVar[tuple[Parameter, ...]] = (
        LN_GD,
        Parameter("share", "-", "share of the second coefficient, c2 / (c1 + c2)", Normal(0.0, 0.3), (-2.0, 2.0)),
        Parameter("bend", "-", "third coefficient over the modulus, c3 / (c1 + c2)", Normal(0.0, 0.03), (-0.5, 0.5)),
    )

    @staticmethod
    def derivatives(p: Any, l1: Any, l2: Any) -> Derivatives:
        i = both_invariants(l1, l2)
        k1, k2 = i[0][0], i[1][0]
        psi = p[0] * k1 + p[1] * k2 + p[2] * k1 * k1
        return of_both(i, psi, (p[0] + 2.0 * p[2] * k1, p[1]), (2.0 * p[2], 0.0, 0.0))

    @staticmethod
    def sensitivities(p: Any, l1: Any, l2: Any) -> tuple[tuple[Any, Any, Any], ...]:
        i = both_invariants(l1, l2)
        k1, k2 = i[0][0], i[1][0]
        return (
            rate_of_both(i, k1, 1.0, 0.0),
            rate_of_both(i, k2, 0.0, 1.0),
            rate_of_both(i, k1 * k1, 2.0 * k1, 0.0),
        )

    @staticmethod
    def to_coordinates(p: ArrayLike) -> Array:
        c1, c2, c3 = np.asarray(p, dtype=float)
        with np.errstate(all="ignore"):
            return np.stack([np.log(2.0 * (c1 + c2)), c2 / (c1 + c2), c3 / (c1 + c2)])

    @staticmethod
    def from_coordinates(x: ArrayLike) -> Array:
        ln_gd, share, bend = np.asarray(x, dtype=float)
        half = 0.5 * np.exp(ln_gd)
        return np.stack([(1.0 - share) * half, share * half, bend * half])

    @staticmethod
    def shear_modulus(p: Any) -> Any:
        return 2.0 * (p[0] + p[1])
