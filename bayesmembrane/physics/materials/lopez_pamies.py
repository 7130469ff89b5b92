"""Lopez-Pamies: two powers of the first invariant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.ground.parameters import Array, Normal, Parameter
from bayesmembrane.physics.materials._digits import exp_minus_one, ln_one_plus
from bayesmembrane.physics.materials.base import LN_GD, Derivatives, Material
from bayesmembrane.physics.materials.invariants import first_invariant, of_first, rate_of_first


@dataclass(frozen=True)
class LopezPamies(Material):
    """W = sum_i c_i 3^(1 - a_i) / (2 a_i) (I1^a_i - 3^a_i), i = 1, 2; G d = c1 + c2.

    I1 = l1^2 + l2^2 + (l1 l2)^-2, and no exponent is 0. The energy takes any constants, its sampling coordinates only
    c_i > 0 and a1 < a2: the order of the exponents forbids exchanging the terms. Elsewhere the coordinates are nan.
    """

    c1: float
    c2: float
    a1: float
    a2: float

    name: ClassVar[str] = "lopez_pamies"
    title: ClassVar[str] = "Lopez-Pamies"
    ordinary: ClassVar[bool] = False
    reference: ClassVar[str] = "O. Lopez-Pamies, C. R. Mecanique 338 (2010) 3"
    units: ClassVar[tuple[str, ...]] = ("N/m", "N/m", "-", "-")
    meanings: ClassVar[tuple[str, ...]] = (
        "modulus of the first power x thickness",
        "modulus of the second power x thickness",
        "first exponent",
        "second exponent",
    )
    scales: ClassVar[tuple[int, ...]] = (1, 1, 0, 0)
    coordinates: ClassVar[tuple[Parameter, ...]] = (
        LN_GD,
        Parameter("ln_r2", "-", "ln(c2 / c1), stiffness of term 2 to term 1", Normal(-1.0, 2.0), (-25.0, 15.0)),
        # Films with nothing but negative exponents soften until they give way: few draws are such.
        Parameter("a1", "-", "the lower exponent", Normal(0.7, 0.8), (-6.0, 7.0)),
        Parameter("ln_a21", "-", "logarithm of a2 - a1", Normal(np.log(2.5), 0.7), (-5.0, 5.0)),
    )

    @staticmethod
    def derivatives(p: Any, l1: Any, l2: Any) -> Derivatives:
        i = first_invariant(l1, l2)
        # (I1 / 3)^a - 1 of each term.
        t, ln = 1.0 + i[0] / 3.0, ln_one_plus(i[0] / 3.0)
        e1, e2 = exp_minus_one(p[2] * ln), exp_minus_one(p[3] * ln)
        d1, d2 = 0.5 * p[0] * (1.0 + e1) / t, 0.5 * p[1] * (1.0 + e2) / t
        return of_first(
            i,
            1.5 * (p[0] * e1 / p[2] + p[1] * e2 / p[3]),
            d1 + d2,
            (d1 * (p[2] - 1.0) + d2 * (p[3] - 1.0)) / (3.0 * t),
        )

    @staticmethod
    def sensitivities(p: Any, l1: Any, l2: Any) -> tuple[tuple[Any, Any, Any], ...]:
        i = first_invariant(l1, l2)
        t, ln = 1.0 + i[0] / 3.0, ln_one_plus(i[0] / 3.0)
        e1, e2 = exp_minus_one(p[2] * ln), exp_minus_one(p[3] * ln)
        d1, d2 = 0.5 * (1.0 + e1) / t, 0.5 * (1.0 + e2) / t
        return (
            rate_of_first(i, 1.5 * e1 / p[2], d1),
            rate_of_first(i, 1.5 * e2 / p[3], d2),
            rate_of_first(i, 1.5 * p[0] / p[2] * (ln * (1.0 + e1) - e1 / p[2]), p[0] * ln * d1),
            rate_of_first(i, 1.5 * p[1] / p[3] * (ln * (1.0 + e2) - e2 / p[3]), p[1] * ln * d2),
        )

    @staticmethod
    def to_coordinates(p: ArrayLike) -> Array:
        c1, c2, a1, a2 = np.asarray(p, dtype=float)
        with np.errstate(all="ignore"):
            inside = (c1 > 0) & (c2 > 0) & (a2 > a1)
            x = np.stack([np.log(c1 + c2), np.log(c2 / c1), a1, np.log(a2 - a1)])
            return np.where(inside, x, np.nan)

    @staticmethod
    def from_coordinates(x: ArrayLike) -> Array:
        ln_gd, ln_r2, a1, ln_a21 = np.asarray(x, dtype=float)
        c1 = np.exp(ln_gd) / (1.0 + np.exp(ln_r2))
        return np.stack([c1, c1 * np.exp(ln_r2), a1, a1 + np.exp(ln_a21)])

    @staticmethod
    def neo_hookean(gd: float) -> Array:
        # The first term with a1 = 1; the other as soft as it may be.
        return np.array([np.log(gd), LopezPamies.coordinates[1].bounds[0], 1.0, 0.0])

    @staticmethod
    def shear_modulus(p: Any) -> Any:
        return p[0] + p[1]
