"""The film was stretched before it was clamped."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from bayesmembrane.ground.parameters import Array, HalfNormal
from bayesmembrane.physics.effects.base import EffectParameter, Geometry


@dataclass(frozen=True)
class Prestretch(Geometry):
    """l0 = stretch, alike in all directions: stress-free radii R / l0, and l2 = l0 at both edges."""

    name: ClassVar[str] = "prestretch"
    title: ClassVar[str] = "pre-stretch of the film"
    reference: ClassVar[str] = "J. E. Adkins, R. S. Rivlin, Phil. Trans. R. Soc. A 244 (1952) 505"
    signature: ClassVar[str] = (
        "Stiff at once: the curve starts linearly instead of with a flat toe; the surplus is largest at small "
        "deflections, fades at large ones, and is alike on all legs."
    )
    needs_clamp: ClassVar[bool] = True
    exact: ClassVar[bool] = True
    may_change: ClassVar[bool] = True
    remembers: ClassVar[bool] = False
    mistaken: ClassVar[float] = 0.01
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("stretch", "-", "equibiaxial stretch before clamping", HalfNormal(0.03, 1.0), (1.0, 1.3), 1.0),
    )

    def prestretch(self, p: Array) -> Array:
        return p[:, 0]
