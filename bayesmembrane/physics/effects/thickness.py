"""The film is thicker or thinner than stated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from bayesmembrane.ground.parameters import Array, Normal
from bayesmembrane.physics.effects.base import Carried, EffectParameter, FilmState


@dataclass(frozen=True)
class Thickness(Carried):
    """F = F0 (1 + error): membrane constants are proportional to the thickness."""

    name: ClassVar[str] = "thickness"
    title: ClassVar[str] = "error of the film's thickness"
    reference: ClassVar[str] = "J. E. Adkins, R. S. Rivlin, Phil. Trans. R. Soc. A 244 (1952) 505"
    signature: ClassVar[str] = "None: the whole curve is scaled, and so is the material's modulus."
    absorbed: ClassVar[str] = (
        "The material's modulus absorbs a wrong thickness without trace: the curve gives modulus times thickness only."
    )
    exact: ClassVar[bool] = True
    remembers: ClassVar[bool] = False
    scales_with_modulus: ClassVar[bool] = True
    mistaken: ClassVar[float] = 0.01
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("error", "-", "true over stated thickness, less one", Normal(0.0, 0.05), (-0.5, 0.5), 0.0),
    )

    def carried(self, p: Array, force: Array, state: FilmState) -> Array:
        return force * (1.0 + p[:, :1])
