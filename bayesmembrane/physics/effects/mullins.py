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

    With w = width (D / m)^fading and H(m) = 1 - exp(-(m / D)^power / width), where m is the largest deflection so far
    and D the full range of the test. (delta / m)^power stands for the stored energy relative to its maximum W_m: the
    reference's erf((W_m - W) / (a + b W_m)) with b = 0 is fading = power, with a = 0 it is fading = 0. Unloading runs
    below loading, and reloading rejoins at m. ``damage`` is the part of continuum damage, 1 - exp(-W_m / c), which
    softens first loading, too (J. C. Simo, Comput. Methods Appl. Mech. Eng. 60 (1987) 153).
    """

    name: ClassVar[str] = "mullins"
    title: ClassVar[str] = "Mullins softening"
    reference: ClassVar[str] = "R. W. Ogden, D. G. Roxburgh, Proc. R. Soc. A 455 (1999) 2861"
    signature: ClassVar[str] = (
        "Unloading and reloading below the previous maximum are softer than first loading and coincide with each "
        "other; the curve rejoins first loading where the previous maximum is passed."
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
    )

    @property
    def starts(self) -> list[dict[str, float]]:
        return [{"damage": 0.05}, {"damage": 0.95}]

    def carried(self, p: Array, force: Array, state: FilmState) -> Array:
        given = [for_kernel(np.atleast_2d(v)) for v in (p, state.deflection, state.reached)]
        lost = np.empty((len(p), given[1].shape[1]))
        _lost(*given, state.path.full_range, lost)
        return np.asarray(force * np.maximum(1.0 - p[:, :1] * lost, 0.0))


@compiled(error_model="numpy")
def _lost(p, deflection, reached, full, out):  # type: ignore[no-untyped-def]
    """(B, N) what stands in brackets: most readings reach no further, and of three powers one is new at each."""
    for b in range(out.shape[0]):
        width, fading, power, damage = p[b, 1], p[b, 2], p[b, 3], p[b, 4]
        i, before, wide, ever = b if deflection.shape[0] > 1 else 0, -1.0, 1.0, 0.0
        back_whole, ever_whole = math.erf(1.0 / width), np.expm1(-1.0 / width)
        for n in range(out.shape[1]):
            m, x = reached[i, n], deflection[i, n]
            if m != before:
                before = m
                wide = width * (full / max(m, 1e-6 * full)) ** fading
                ever = np.expm1(-((m / full) ** power) / width) / ever_whole
            part = (x / m if x > 0.0 else 0.0) if m > 0.0 else 1.0
            back = math.erf((1.0 - part**power) / wide) / back_whole if part < 1.0 else 0.0
            out[b, n] = (1.0 - damage) * back + damage * ever
