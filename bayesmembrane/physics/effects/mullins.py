"""Softening of the film below the largest deflection that it has seen."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.ground.compiling import compiled, for_kernel
from bayesmembrane.ground.parameters import Array, HalfNormal, LogNormal, Uniform
from bayesmembrane.physics.effects.base import Carried, EffectParameter, FilmState


@dataclass(frozen=True)
class Mullins(Carried):
    """F = F0 (1 - softening [(1 - damage) erf((1 - (delta / m)^power) / w) / erf(1 / width) + damage H(m) / H(D)]).

    With w = width (D / m)^fading, H(m) = 1 - exp(-[(1 - repeated) (m / D)^power + repeated A] / width) and H(D) that of
    a first loading to D, where m is the largest deflection so far, D the full range of the test and A the sum so far of
    all changes, up and down, of (delta / D)^power; a way back that is shorter than the jitter of the readings is none.
    (delta / m)^power stands for the stored energy relative to its maximum W_m: the reference's erf((W_m - W) /
    (a + b W_m)) with b = 0 is fading = power, with a = 0 it is fading = 0. Unloading runs below loading, and reloading
    rejoins at m, but for what is repeated. ``damage`` is the part of continuum damage, 1 - exp(-W_m / c), which softens
    first loading, too (J. C. Simo, Comput. Methods Appl. Mech. Eng. 60 (1987) 153); what is ``repeated`` of it goes on
    in every cycle (C. Miehe, Eur. J. Mech. A 14 (1995) 697). Where the square bracket is more than 1, as after many
    cycles, what is kept falls off exponentially instead, with the same slope: never below nothing.
    """

    name: ClassVar[str] = "mullins"
    title: ClassVar[str] = "Mullins softening"
    reference: ClassVar[str] = "R. W. Ogden, D. G. Roxburgh, Proc. R. Soc. A 455 (1999) 2861"
    signature: ClassVar[str] = (
        "Unloading and reloading below the previous maximum are softer than first loading and coincide with each "
        "other, or nearly so; the curve rejoins first loading where the previous maximum is passed."
    )
    of_the_material = True
    needs_return: ClassVar[bool] = True
    scales_with_modulus: ClassVar[bool] = True
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter(
            "softening",
            "-",
            "part of the force that is lost on return to zero from the full range",
            HalfNormal(0.2),
            (0.0, 0.95),
            0.0,
        ),
        EffectParameter(
            "width",
            "-",
            "drop in energy over which it is lost, relative to the maximum",
            LogNormal(0.5, 1.0),
            (0.01, 20.0),
        ),
        EffectParameter(
            "fading", "-", "power with which this drop is larger after a smaller maximum", HalfNormal(1.5), (0.0, 8.0)
        ),
        EffectParameter(
            "power", "-", "power of the deflection with which the energy grows", LogNormal(2.0, 0.4), (0.5, 8.0)
        ),
        EffectParameter(
            "damage", "-", "part that first loading loses, too, as it goes on", Uniform(0.0, 1.0), (0.0, 1.0)
        ),
        EffectParameter(
            "repeated",
            "-",
            "part of that which goes on in every cycle, up and down, and not only beyond the previous maximum",
            HalfNormal(0.3),
            (0.0, 1.0),
            begin=0.0,
        ),
    )

    @property
    def starts(self) -> list[dict[str, float]]:
        return [{"damage": 0.05}, {"damage": 0.95}, {"damage": 0.5, "repeated": 0.5}]

    def carried(self, p: Array, force: Array, state: FilmState) -> Array:
        given = [for_kernel(np.atleast_2d(v)) for v in (p, state.deflection, state.reached)]
        lost = np.empty((len(p), given[1].shape[1]))
        _lost(*given, state.path.full_range, state.path.jitter, lost)
        softening, beyond = p[:, :1], np.maximum(lost - 1.0, 0.0)
        kept = (1.0 - softening * np.minimum(lost, 1.0)) * np.exp(-softening / (1.0 - softening) * beyond)
        return np.asarray(force * kept)


@compiled(error_model="numpy")
def _lost(p, deflection, reached, full, jitter, out):  # type: ignore[no-untyped-def]
    """(B, N) what stands in brackets: most readings reach no further, and of three powers one is new at each.

    Energies are in parts of that at the full range; ``way`` is how far they have gone, up and down, which is counted
    wherever the deflection is farther than the ``jitter`` from where it was counted last.
    """
    for b in range(out.shape[0]):
        width, fading, power, damage, repeated = p[b, 1], p[b, 2], p[b, 3], p[b, 4], p[b, 5]
        i, before, wide, most, ever = b if deflection.shape[0] > 1 else 0, -1.0, 1.0, 0.0, 0.0
        last, energy_there, way = 0.0, 0.0, 0.0
        back_whole, ever_whole = math.erf(1.0 / width), np.expm1(-1.0 / width)
        for n in range(out.shape[1]):
            m, x = reached[i, n], deflection[i, n]
            farther = m != before
            if farther:
                before = m
                wide = width * (full / max(m, 1e-6 * full)) ** fading
                most = (m / full) ** power
            part = (x / m if x > 0.0 else 0.0) if m > 0.0 else 1.0
            of_most = part**power if part < 1.0 else 1.0
            if repeated > 0.0 and (x == m or abs(x - last) >= jitter):
                energy = of_most * most
                last, way, energy_there = x, way + abs(energy - energy_there), energy
            if farther or repeated > 0.0:
                ever = np.expm1(-((1.0 - repeated) * most + repeated * way) / width) / ever_whole
            back = math.erf((1.0 - of_most) / wide) / back_whole if part < 1.0 else 0.0
            out[b, n] = (1.0 - damage) * back + damage * ever
