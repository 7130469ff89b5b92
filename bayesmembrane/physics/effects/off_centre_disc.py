"""The disc sits beside the centre of the ring: the film is shorter on one side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.ground.parameters import Array, HalfNormal
from bayesmembrane.physics.effects.base import Carried, EffectParameter, FilmState


@dataclass(frozen=True)
class OffCentreDisc(Carried):
    """F = F0 (1 + n (n + 1) square / 4), n = d ln F0 / d ln delta, square = (eccentricity / (R2 - R1))^2.

    Sectors of the film at angle phi, of length L (1 + e cos phi), see the deflection delta / (1 + e cos phi) of a film
    of length L; the mean over phi to second order, with F0 locally a power of delta. The disc is guided upright.
    """

    name: ClassVar[str] = "off_centre_disc"
    title: ClassVar[str] = "disc off the centre of the ring"
    reference: ClassVar[str] = (
        "A. E. Green, J. E. Adkins, Large Elastic Deformations, 2nd ed. (1970), ch. 4 (membranes)"
    )
    signature: ClassVar[str] = (
        "Slightly too stiff in the toe, where the curve is steep on a double logarithmic plot, alike on all legs; "
        "mostly absorbed by the modulus."
    )
    needs_clamp: ClassVar[bool] = True
    remembers: ClassVar[bool] = False
    scales_with_modulus: ClassVar[bool] = True
    odds: ClassVar[float] = 0.25  # a jig centres it, and the force sees the square of what is left
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter(
            "square", "-", "square of the eccentricity over the free length", HalfNormal(3e-3), (0.0, 0.1), 0.0
        ),
    )

    def carried(self, p: Array, force: Array, state: FilmState) -> Array:
        with np.errstate(all="ignore"):
            n = np.where(state.force != 0, state.slope * state.deflection / state.force, 0.0)
        return np.asarray(force * (1.0 + 0.25 * p[:, :1] * n * (n + 1.0)))
