"""A film that is pulled faster resists more."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.data.motion import NOMINAL_SPEED, Motion
from bayesmembrane.ground.parameters import Array, HalfNormal, Normal, Uniform
from bayesmembrane.physics.effects.base import EffectParameter, Memory

SMALLEST = 0.03
"""Of the full range: below this deflection what it resists is the same part of the force as there."""

MOST = 10.0
"""Times as large as at rest the force of a film may be."""


@dataclass(frozen=True)
class Rate(Memory):
    """F = F0 max(0, 1 + s (k(v) - 1) r^-lean) / k(1 mm/s),    k(v) = (1 + v / (e^log_slow 1 mm/s))^exponent,

    with the speed v of the disc, the part r of the full range at which it is, and s = 1 while it goes on and
    1 - 2 reversed while it comes back. The material's constants are those on the way at 1 mm/s. Far above the slow
    speed this is a power of the speed, far below it a viscosity, and at rest it is gone. Chains that have no time to
    rearrange are stiffer on both ways (reversed = 0); what a fluid between them resists has the sign of the motion
    (1), and is a larger part of the force where that is small (lean = 1 of a strip), up to `MOST` times all of it.
    """

    name: ClassVar[str] = "rate"
    title: ClassVar[str] = "stiffening with speed"
    reference: ClassVar[str] = (
        "G. Cowper, P. Symonds, Brown University TR 28 (1957); L. Mullins, J. Rubber Res. 16 (1947) 275; H. Eyring, J. "
        "Chem. Phys. 4 (1936) 283"
    )
    signature: ClassVar[str] = (
        "Parts of the test that run faster lie higher, on loading and unloading alike, or loops are wider there; it is "
        "gone as soon as the disc rests. At one speed the material absorbs what is alike on both ways."
    )
    needs_time: ClassVar[bool] = True
    scales_with_modulus: ClassVar[bool] = True
    rank: ClassVar[int] = 1
    of_the_material = True
    constant = True
    needs_speeds: ClassVar[bool] = True
    # Far above the slow speed a loop is hardly wider where the disc is faster: only a hold shows that it is gone.
    twins_at_one_speed: ClassVar[tuple[str, ...]] = ("viscoelastic",)
    twins_at_any_speed: ClassVar[tuple[str, ...]] = ("hysteresis", "friction")
    mistaken: ClassVar[float] = 0.01
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("exponent", "-", "power of the speed", HalfNormal(0.05), (0.0, 0.5), 0.0),
        EffectParameter(
            "log_slow",
            "-",
            "ln of the speed, in mm/s, below which it is nearly as at rest",
            Normal(-1.5, 1.45),
            (-6.0, 5.0),
        ),
        EffectParameter(
            "reversed", "-", "part of it that changes its sign on the way back", Uniform(0.0, 1.0), (0.0, 1.0)
        ),
        EffectParameter(
            "lean",
            "-",
            "power of the deflection by which it is a smaller part of the force",
            Normal(0.5, 0.45),
            (-1.0, 2.0),
        ),
    )

    @property
    def starts(self) -> list[dict[str, float]]:
        """Of a test that comes back either sign is a valley of its own."""
        return [{"reversed": 0.05, "lean": 0.0}, {"reversed": 0.95, "lean": 0.8}]

    def remember(self, p: Array, force: Array, path: Motion) -> Array:
        exponent, log_slow, reversed_, lean = (p[:, i : i + 1] for i in range(4))
        speed = path.moving_speed / NOMINAL_SPEED
        faster = np.expm1(exponent * np.log1p(speed * np.exp(-log_slow)))
        sense = np.where(path.leg > 0, 1.0, 1 - 2 * reversed_)
        part = np.maximum(np.abs(path.deflection) / path.full_range, SMALLEST)
        factor = np.clip(1 + sense * faster * part**-lean, 0.0, MOST)
        return np.asarray(force * factor * np.exp(-exponent * np.log1p(np.exp(-log_slow))))
