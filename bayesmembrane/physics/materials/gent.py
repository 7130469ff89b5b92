"""Gent: chains of limited extensibility."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.ground.parameters import Array, Normal, Parameter
from bayesmembrane.physics.materials.base import Derivatives, Material


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
    scales: ClassVar[tuple[int, ...]] = (1, 0)
    coordinates: ClassVar[tuple[Parameter, ...]] = (
        Parameter("ln_gd", "ln(N/m)", "log of shear modulus x thickness", Normal(np.log(15.0), 2.0), (-7.0, 14.0)),
        Parameter("ln_jm", "-", "logarithm of the limit of I1 - 3", Normal(np.log(50.0), 1.5), (-3.0, 16.0)),
    )

    @staticmethod
    def derivatives(p: Any, l1: Any, l2: Any) -> Derivatives:
        # With x = l1^2 - 1 and y = l2^2 - 1, K and its slopes are free of cancellation at small strain.
        x, y = (l1 - 1.0) * (l1 + 1.0), (l2 - 1.0) * (l2 + 1.0)
        s1, s2 = l1 * l1, l2 * l2
        ab = 1.0 / (s1 * s2)
        a, b = s2 * ab, s1 * ab
        k = ab * (x * x + y * y + x * y * (1.0 + x + y))
        k1 = 2.0 * l1 * a * ab * (x * (2.0 + x) * s2 + y)
        k2 = 2.0 * l2 * b * ab * (y * (2.0 + y) * s1 + x)
        u = k / p[1]
        t = 1.0 - u
        r = 1.0 / t
        # ln(1 - u) with the rounding error of 1 - u put back: exact for u -> 0, nan beyond the limit.
        ln = np.log(t) + ((1.0 - t) - u) * r
        # 0 ln carries that nan into the derivatives, which would be finite there.
        d = p[0] * r + 0.0 * ln
        dd = d * r / p[1]
        return (
            0.0 * ln - p[0] * p[1] * ln,
            d * k1,
            d * k2,
            d * (2.0 + 6.0 * a * ab) + dd * k1 * k1,
            d * 4.0 * ab * ab * l1 * l2 + dd * k1 * k2,
            d * (2.0 + 6.0 * b * ab) + dd * k2 * k2,
        )

    @staticmethod
    def sensitivities(p: Any, l1: Any, l2: Any) -> tuple[tuple[Any, Any, Any], ...]:
        x, y = (l1 - 1.0) * (l1 + 1.0), (l2 - 1.0) * (l2 + 1.0)
        s1, s2 = l1 * l1, l2 * l2
        ab = 1.0 / (s1 * s2)
        a, b = s2 * ab, s1 * ab
        k = ab * (x * x + y * y + x * y * (1.0 + x + y))
        k1 = 2.0 * l1 * a * ab * (x * (2.0 + x) * s2 + y)
        k2 = 2.0 * l2 * b * ab * (y * (2.0 + y) * s1 + x)
        u = k / p[1]
        t = 1.0 - u
        ln = np.log(t) + ((1.0 - t) - u) / t
        r = 1.0 / t + 0.0 * ln
        e = -p[0] * u * r * r / p[1]
        return (
            (0.0 * ln - p[1] * ln, r * k1, r * k2),
            (-p[0] * (ln + u * r), e * k1, e * k2),
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
    def shear_modulus(p: Any) -> Any:
        return 2.0 * p[0]

    @staticmethod
    def extensibility(p: Any) -> Any:
        return p[1]
