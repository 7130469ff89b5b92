"""Exp-Ln: an exponential that stiffens and a logarithm that softens, of the first invariant."""

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
class ExpLn(Material):
    """W = c1 [exp(a (I1 - 3)) / a + b (I1 - 2) (1 - ln(I1 - 2)) - 1 / a - b]; G d = 2 c1.

    I1 = l1^2 + l2^2 + (l1 l2)^-2. With K = I1 - 3, dW/dK = c1 (exp(a K) - b ln(1 + K)): b softens at moderate
    stretches, a > 0 stiffens at large ones.
    """

    c1: float
    a: float
    b: float

    name: ClassVar[str] = "exp_ln"
    title: ClassVar[str] = "Exp-Ln"
    ordinary: ClassVar[bool] = False
    reference: ClassVar[str] = "H. Khajehsaeid, J. Arghavani, R. Naghdabadi, Eur. J. Mech. A Solids 38 (2013) 144"
    units: ClassVar[tuple[str, ...]] = ("N/m", "-", "-")
    meanings: ClassVar[tuple[str, ...]] = (
        "half the shear modulus x thickness",
        "rate of the exponential",
        "weight of the logarithm",
    )
    scales: ClassVar[tuple[int, ...]] = (1, 0, 0)
    coordinates: ClassVar[tuple[Parameter, ...]] = (
        LN_GD,
        Parameter("ln_a", "-", "logarithm of the rate of the exponential", Normal(np.log(0.02), 1.5), (-18.0, 3.0)),
        Parameter("b", "-", "weight of the logarithm", Normal(0.15, 0.15), (-2.0, 2.0)),
    )

    @staticmethod
    def derivatives(p: Any, l1: Any, l2: Any) -> Derivatives:
        i = first_invariant(l1, l2)
        k = i[0]
        rise, ln, t = exp_minus_one(p[1] * k), ln_one_plus(k), 1.0 + k
        return of_first(
            i,
            p[0] * (rise / p[1] + p[2] * (k - t * ln)),
            p[0] * (1.0 + rise - p[2] * ln),
            p[0] * (p[1] * (1.0 + rise) - p[2] / t),
        )

    @staticmethod
    def sensitivities(p: Any, l1: Any, l2: Any) -> tuple[tuple[Any, Any, Any], ...]:
        i = first_invariant(l1, l2)
        k = i[0]
        rise, ln, t = exp_minus_one(p[1] * k), ln_one_plus(k), 1.0 + k
        bend = k - t * ln
        return (
            rate_of_first(i, rise / p[1] + p[2] * bend, 1.0 + rise - p[2] * ln),
            rate_of_first(i, p[0] * (k * (1.0 + rise) - rise / p[1]) / p[1], p[0] * k * (1.0 + rise)),
            rate_of_first(i, p[0] * bend, -p[0] * ln),
        )

    @staticmethod
    def to_coordinates(p: ArrayLike) -> Array:
        c1, a, b = np.asarray(p, dtype=float)
        with np.errstate(all="ignore"):
            return np.stack([np.log(2.0 * c1), np.log(a), b])

    @staticmethod
    def from_coordinates(x: ArrayLike) -> Array:
        ln_gd, ln_a, b = np.asarray(x, dtype=float)
        return np.stack([0.5 * np.exp(ln_gd), np.exp(ln_a), b])

    @staticmethod
    def neo_hookean(gd: float) -> Array:
        return np.array([np.log(gd), ExpLn.coordinates[1].bounds[0], 0.0])

    @staticmethod
    def shear_modulus(p: Any) -> Any:
        return 2.0 * p[0]
