"""Mooney-Rivlin: linear in both invariants."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.ground.parameters import Array, Normal, Parameter
from bayesmembrane.physics.materials.base import Derivatives, Material


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
    scales: ClassVar[tuple[int, ...]] = (1, 1)
    coordinates: ClassVar[tuple[Parameter, ...]] = (
        Parameter("ln_gd", "ln(N/m)", "log of shear modulus x thickness", Normal(np.log(15.0), 2.0), (-7.0, 14.0)),
        Parameter("share", "-", "share of the second coefficient, c2 / (c1 + c2)", Normal(0.0, 0.5), (-3.0, 3.0)),
    )

    @staticmethod
    def derivatives(p: Any, l1: Any, l2: Any) -> Derivatives:
        # With x = l1^2 - 1 and y = l2^2 - 1, invariants and slopes are free of cancellation at small strain.
        x, y = (l1 - 1.0) * (l1 + 1.0), (l2 - 1.0) * (l2 + 1.0)
        s1, s2 = l1 * l1, l2 * l2
        ab = 1.0 / (s1 * s2)
        a, b = s2 * ab, s1 * ab
        # The slopes of I2 are those of I1 times the square of the other stretch.
        k1 = 2.0 * l1 * a * ab * (x * (2.0 + x) * s2 + y)
        k2 = 2.0 * l2 * b * ab * (y * (2.0 + y) * s1 + x)
        i1 = ab * (x * x + y * y + x * y * (1.0 + x + y))
        u, v = -x * a, -y * b
        i2 = s1 * s2 * (u * u + v * v + u * v * (1.0 + u + v))
        return (
            p[0] * i1 + p[1] * i2,
            (p[0] + p[1] * s2) * k1,
            (p[0] + p[1] * s1) * k2,
            p[0] * (2.0 + 6.0 * a * ab) + p[1] * (2.0 * s2 + 6.0 * a * a),
            (p[0] * ab * ab + p[1]) * 4.0 * l1 * l2,
            p[0] * (2.0 + 6.0 * b * ab) + p[1] * (2.0 * s1 + 6.0 * b * b),
        )

    @staticmethod
    def sensitivities(p: Any, l1: Any, l2: Any) -> tuple[tuple[Any, Any, Any], ...]:
        x, y = (l1 - 1.0) * (l1 + 1.0), (l2 - 1.0) * (l2 + 1.0)
        s1, s2 = l1 * l1, l2 * l2
        ab = 1.0 / (s1 * s2)
        a, b = s2 * ab, s1 * ab
        k1 = 2.0 * l1 * a * ab * (x * (2.0 + x) * s2 + y)
        k2 = 2.0 * l2 * b * ab * (y * (2.0 + y) * s1 + x)
        u, v = -x * a, -y * b
        return (
            (ab * (x * x + y * y + x * y * (1.0 + x + y)), k1, k2),
            (s1 * s2 * (u * u + v * v + u * v * (1.0 + u + v)), s2 * k1, s1 * k2),
        )

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
    def shear_modulus(p: Any) -> Any:
        return 2.0 * (p[0] + p[1])
