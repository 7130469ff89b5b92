"""Gent-Thomas: linear in the first invariant, logarithmic in the second."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.ground.parameters import Array, Normal, Parameter
from bayesmembrane.physics.materials._digits import ln_one_plus
from bayesmembrane.physics.materials.base import LN_GD, Derivatives, Material
from bayesmembrane.physics.materials.invariants import both_invariants, of_both, rate_of_both


@dataclass(frozen=True)
class GentThomas(Material):
    """W = c1 (I1 - 3) + c2 ln(I2 / 3); G d = 2 (c1 + c2 / 3).

    I1 = l1^2 + l2^2 + (l1 l2)^-2 and I2 = (l1 l2)^2 + l1^-2 + l2^-2. What the second invariant adds softens with the
    stretch, while that of Mooney-Rivlin does not. Sampled in G d and the share of the second term in it.
    """

    c1: float
    c2: float

    name: ClassVar[str] = "gent_thomas"
    title: ClassVar[str] = "Gent-Thomas"
    ordinary: ClassVar[bool] = False
    reference: ClassVar[str] = "A. N. Gent, A. G. Thomas, J. Polym. Sci. 28 (1958) 625"
    units: ClassVar[tuple[str, ...]] = ("N/m", "N/m")
    meanings: ClassVar[tuple[str, ...]] = ("coefficient of I1 - 3", "coefficient of ln(I2 / 3)")
    scales: ClassVar[tuple[int, ...]] = (1, 1)
    coordinates: ClassVar[tuple[Parameter, ...]] = (
        LN_GD,
        Parameter("share", "-", "share of the second term, c2 / (3 c1 + c2)", Normal(0.2, 0.4), (-3.0, 3.0)),
    )

    @staticmethod
    def derivatives(p: Any, l1: Any, l2: Any) -> Derivatives:
        i = both_invariants(l1, l2)
        k1, k2 = i[0][0], i[1][0]
        d2 = p[1] / (3.0 + k2)
        psi = p[0] * k1 + p[1] * ln_one_plus(k2 / 3.0)
        return of_both(i, psi, (p[0], d2), (0.0, 0.0, -d2 / (3.0 + k2)))

    @staticmethod
    def sensitivities(p: Any, l1: Any, l2: Any) -> tuple[tuple[Any, Any, Any], ...]:
        i = both_invariants(l1, l2)
        k1, k2 = i[0][0], i[1][0]
        return rate_of_both(i, k1, 1.0, 0.0), rate_of_both(i, ln_one_plus(k2 / 3.0), 0.0, 1.0 / (3.0 + k2))

    @staticmethod
    def to_coordinates(p: ArrayLike) -> Array:
        c1, c2 = np.asarray(p, dtype=float)
        with np.errstate(all="ignore"):
            ln_gd = np.log(2.0 * (c1 + c2 / 3.0))
            return np.stack([ln_gd, np.where(np.isfinite(ln_gd), c2 / (3.0 * c1 + c2), np.nan)])

    @staticmethod
    def from_coordinates(x: ArrayLike) -> Array:
        ln_gd, share = np.asarray(x, dtype=float)
        half = 0.5 * np.exp(ln_gd)
        return np.stack([(1.0 - share) * half, 3.0 * share * half])

    @staticmethod
    def neo_hookean(gd: float) -> Array:
        return np.array([np.log(gd), 0.0])

    @staticmethod
    def shear_modulus(p: Any) -> Any:
        return 2.0 * (p[0] + p[1] / 3.0)
