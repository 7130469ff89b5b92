"""Neo-Hooke: linear in the first invariant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.ground.parameters import Array, Parameter
from bayesmembrane.physics.materials.base import LN_GD, Derivatives, Material
from bayesmembrane.physics.materials.invariants import first_invariant, rate_of_first


@dataclass(frozen=True)
class NeoHookean(Material):
    """W = c1 K with K = I1 - 3 and I1 = l1^2 + l2^2 + (l1 l2)^-2; G d = 2 c1."""

    c1: float

    name: ClassVar[str] = "neo_hookean"
    title: ClassVar[str] = "neo-Hookean"
    colour: ClassVar[str] = "#0072B2"
    reference: ClassVar[str] = "L. R. G. Treloar, Trans. Faraday Soc. 39 (1943) 241"
    units: ClassVar[tuple[str, ...]] = ("N/m",)
    meanings: ClassVar[tuple[str, ...]] = ("half the shear modulus x thickness",)
    scales: ClassVar[tuple[int, ...]] = (1,)
    coordinates: ClassVar[tuple[Parameter, ...]] = (LN_GD,)

    @staticmethod
    def derivatives(p: Any, l1: Any, l2: Any) -> Derivatives:
        i = first_invariant(l1, l2)
        return p[0] * i[0], p[0] * i[1], p[0] * i[2], p[0] * i[3], p[0] * i[4], p[0] * i[5]

    @staticmethod
    def convex_everywhere(p: Any) -> Any:
        """K is convex in the stretches."""
        return p[0] > 0

    @staticmethod
    def sensitivities(p: Any, l1: Any, l2: Any) -> tuple[tuple[Any, Any, Any], ...]:
        i = first_invariant(l1, l2)
        return (rate_of_first(i, i[0], 1.0),)

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
    def neo_hookean(gd: float) -> Array:
        return np.array([np.log(gd)])

    @staticmethod
    def shear_modulus(p: Any) -> Any:
        return 2.0 * p[0]
