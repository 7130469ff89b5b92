"""Neo-Hooke: linear in the first invariant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.ground.parameters import Array, Normal, Parameter
from bayesmembrane.physics.materials.base import Derivatives, Material


@dataclass(frozen=True)
class NeoHookean(Material):
    """W = c1 K with K = I1 - 3 and I1 = l1^2 + l2^2 + (l1 l2)^-2; G d = 2 c1."""

    c1: float

    name: ClassVar[str] = "neo_hookean"
    title: ClassVar[str] = "neo-Hookean"
    colour: ClassVar[str] = "#0072B2"
    reference: ClassVar[str] = "L. R. G. Treloar, Trans. Faraday Soc. 39 (1943) 241"
    units: ClassVar[tuple[str, ...]] = ("N/m",)
    scales: ClassVar[tuple[int, ...]] = (1,)
    coordinates: ClassVar[tuple[Parameter, ...]] = (
        Parameter("ln_gd", "ln(N/m)", "log of shear modulus x thickness", Normal(np.log(15.0), 2.0), (-7.0, 14.0)),
    )

    @staticmethod
    def derivatives(p: Any, l1: Any, l2: Any) -> Derivatives:
        # With x = l1^2 - 1 and y = l2^2 - 1, K and its slopes are free of cancellation at small strain.
        x, y = (l1 - 1.0) * (l1 + 1.0), (l2 - 1.0) * (l2 + 1.0)
        s1, s2 = l1 * l1, l2 * l2
        ab = 1.0 / (s1 * s2)
        a, b = s2 * ab, s1 * ab
        return (
            p[0] * ab * (x * x + y * y + x * y * (1.0 + x + y)),
            p[0] * 2.0 * l1 * a * ab * (x * (2.0 + x) * s2 + y),
            p[0] * 2.0 * l2 * b * ab * (y * (2.0 + y) * s1 + x),
            p[0] * (2.0 + 6.0 * a * ab),
            p[0] * 4.0 * ab * ab * l1 * l2,
            p[0] * (2.0 + 6.0 * b * ab),
        )

    @staticmethod
    def sensitivities(p: Any, l1: Any, l2: Any) -> tuple[tuple[Any, Any, Any], ...]:
        x, y = (l1 - 1.0) * (l1 + 1.0), (l2 - 1.0) * (l2 + 1.0)
        s1, s2 = l1 * l1, l2 * l2
        ab = 1.0 / (s1 * s2)
        a, b = s2 * ab, s1 * ab
        return (
            (
                ab * (x * x + y * y + x * y * (1.0 + x + y)),
                2.0 * l1 * a * ab * (x * (2.0 + x) * s2 + y),
                2.0 * l2 * b * ab * (y * (2.0 + y) * s1 + x),
            ),
        )

    @staticmethod
    def to_coordinates(p: ArrayLike) -> Array:
        (c1,) = np.asarray(p, dtype=float)
        with np.errstate(all="ignore"):
            return np.stack([np.log(2.0 * c1)])

    @staticmethod
    def from_coordinates(x: ArrayLike) -> Array:
        (ln_gd,) = np.asarray(x, dtype=float)
        return np.stack([0.5 * np.exp(ln_gd)])

    @staticmethod
    def shear_modulus(p: Any) -> Any:
        return 2.0 * p[0]
