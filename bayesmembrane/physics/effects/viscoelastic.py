"""The film relaxes: quasi-linear viscoelasticity with a Prony series."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.compiling import compiled, for_kernel
from bayesmembrane.ground.parameters import Array, HalfNormal, LogNormal, Normal, Uniform
from bayesmembrane.physics.effects._history import relaxing
from bayesmembrane.physics.effects.base import EffectParameter, Memory

TERMS = 12
"""Nearly two to a decade at the largest width."""


@dataclass(frozen=True)
class Viscoelastic(Memory):
    """F(t) = F_e(t) - strength w(t)^m int (1 - sum_i g_i exp(-(t - s) / time_i)) d(F_e w^-m)(s), sum_i g_i = 1.

    Twelve times are evenly spread in log time within ``decades`` decades around ``time``: one relaxation time if it is
    zero, a broad spectrum if not. Their weights are g_i ~ time_i^-tilt: a box of times if the ``tilt`` is zero, a wedge
    if not, which is a power law of time, as tapes and filled rubbers follow. F_e is the instantaneous force. Without
    times the clock is the distance travelled at 1 mm/s.

    w = 1 + |x| / D, with x the deflection and D the full range of the test, and m is the ``measure``: which stress
    relaxes linearly. Theories differ in that: nominal stress is m = 0 (Fung), and with w near the stretch second
    Piola-Kirchhoff stress is m = 1 (Simo), true stress m = -1. Nine loops of acrylic tape, fitted by least squares,
    have m = -1 to -4, and are followed 1.1 to 2.5 times as closely as with m = 0. Where tests go to other ranges, w is
    each one's own, and m the same.

    After a fast return F is negative, and counts ``withstood``: a thin film is slack then (0), one that is stiff or
    sticks to the disc withstands some of it, a block all (1).
    """

    name: ClassVar[str] = "viscoelastic"
    title: ClassVar[str] = "viscoelastic relaxation"
    reference: ClassVar[str] = (
        "Y. C. Fung, Biomechanics: Mechanical Properties of Living Tissues, 2nd ed. (1993), 7.6; "
        "J. C. Simo, Comput. Methods Appl. Mech. Eng. 60 (1987) 153, for another measure of stress; A. V. Tobolsky, "
        "Properties and Structure of Polymers (1960), for boxes and wedges"
    )
    signature: ClassVar[str] = (
        "Unloading below loading in every cycle, with a gap that depends on time and speed and closes at rest; force "
        "falls in holds and recovers at zero."
    )
    of_the_material = True
    constant = True
    needs_return: ClassVar[bool] = True
    scales_with_modulus: ClassVar[bool] = True
    shows_at_rest: ClassVar[bool] = True
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter(
            "strength", "-", "part of the instantaneous force that relaxes", HalfNormal(0.3), (0.0, 0.99), 0.0
        ),
        EffectParameter("time", "s", "middle relaxation time", LogNormal(30.0, 1.5), (0.05, 2e4)),
        EffectParameter("decades", "-", "width of the spectrum of times", HalfNormal(2.1), (0.0, 7.0)),
        EffectParameter("withstood", "-", "part of a push that does not make it slack", Uniform(0.0, 1.0), (0.0, 1.0)),
        EffectParameter(
            "measure", "-", "power of w = 1 + |x| / D in the stress that relaxes", Normal(0.0, 1.5), (-5.0, 5.0)
        ),
        EffectParameter(
            "tilt", "-", "power of 1 / time in the weight of a relaxation time", Normal(0.0, 0.3), (-1.0, 1.5)
        ),
    )

    @property
    def starts(self) -> list[dict[str, float]]:
        """A broad spectrum is not found from one time alone."""
        return [{"time": 10.0, "decades": 2.5}, {"time": 100.0, "decades": 2.5}, {"decades": 5.0, "tilt": 0.3}]

    def remember(self, p: Array, force: Array, path: Motion) -> Array:
        gap = np.diff(path.clock, prepend=0.0)
        weight = (1 + np.abs(path.deflection) / path.full_range) ** p[:, 4:5]
        places = (np.arange(TERMS) + 0.5) / TERMS - 0.5
        spread = 10.0 ** (places * p[:, 2:3])
        share = spread ** -p[:, 5:6]
        share /= np.sum(share, axis=1, keepdims=True)
        kept = relaxing(force / weight, gap, p[:, 1:2] * spread, share)
        out = np.empty(kept.shape)
        _remembered(for_kernel(force), weight, kept, for_kernel(p[:, 0]), for_kernel(p[:, 3]), out)
        return out


@compiled(error_model="numpy")
def _remembered(force, weight, kept, strength, withstood, out):  # type: ignore[no-untyped-def]
    """F - strength (F - w kept) of F, w, kept (B, N), what of it pushes counting as ``withstood`` (B,)."""
    for b in range(out.shape[0]):
        for n in range(out.shape[1]):
            f = force[b, n]
            relaxed, least = f - strength[b] * (f - weight[b, n] * kept[b, n]), min(f, 0.0)
            push = relaxed - least
            out[b, n] = relaxed if push >= 0.0 else least + withstood[b] * push
