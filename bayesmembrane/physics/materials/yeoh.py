"""Yeoh: a cubic in the first invariant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.ground.parameters import Array, Normal, Parameter
from bayesmembrane.physics.materials.base import Derivatives, Material


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
    scales: ClassVar[tuple[int, ...]] = (1, 1, 1)
    coordinates: ClassVar[tuple[Parameter, ...]] = (
        Parameter("ln_gd", "ln(N/m)", "log of shear modulus x thickness", Normal(np.log(15.0), 2.0), (-7.0, 14.0)),
        Parameter("c2_c1", "-", "second coefficient relative to the first", Normal(0.0, 0.4), (-2.0, 2.0)),
        Parameter("c3_c1", "-", "third coefficient relative to the first", Normal(0.0, 0.015), (-0.5, 0.5)),
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
        w = k * (p[0] + k * (p[1] + k * p[2]))
        d = p[0] + k * (2.0 * p[1] + 3.0 * k * p[2])
        dd = 2.0 * p[1] + 6.0 * k * p[2]
        return (
            w,
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
        return (
            (k, k1, k2),
            (k * k, 2.0 * k * k1, 2.0 * k * k2),
            (k * k * k, 3.0 * k * k * k1, 3.0 * k * k * k2),
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
    def shear_modulus(p: Any) -> Any:
        return 2.0 * p[0]
