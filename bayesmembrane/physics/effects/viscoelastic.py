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
from bayesmembrane.physics.reach import SOURCE

TERMS = 12
"""Nearly two to a decade at the largest width."""
USUAL = 0.15
"""Of the largest stress: where what has not yet relaxed is this, it relaxes in the times that are told."""
MOST = 40.0
"""The largest power of e by which it relaxes more quickly, and to which anything relaxes in a step."""
STEPS = 40
"""To the full range, at least, in which a flow is followed."""
SLOW = 0.05
"""Of the fastest before: slower than that the disc waits."""
HALVED = 10
"""Parts of the first wait after a way: the last is half of it, the one before a quarter."""
ROUNDS = 3
"""In which what is left at the end of a step is found."""


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

    Stress quickens it: time counts exp(``quickens`` (|q| - 0.15)), with q the stress that has not yet relaxed, over
    that of the test's largest measured force at its full range; where tests go to other forces q is each one's own, as
    w is. Networks flow like that (Eyring; Bergstrom and Boyce have a power of the stress), and loops of a film that
    does narrow less where it is slower.

    After a fast return F is negative, and counts ``withstood``: a thin film is slack then (0), one that is stiff or
    sticks to the disc withstands some of it, a block all (1).
    """

    name: ClassVar[str] = "viscoelastic"
    title: ClassVar[str] = "viscoelastic relaxation"
    reference: ClassVar[str] = (
        "Y. C. Fung, Biomechanics: Mechanical Properties of Living Tissues, 2nd ed. (1993), 7.6; "
        "J. C. Simo, Comput. Methods Appl. Mech. Eng. 60 (1987) 153, for another measure of stress; A. V. Tobolsky, "
        "Properties and Structure of Polymers (1960), for boxes and wedges; J. S. Bergstrom, M. C. Boyce, J. Mech. "
        "Phys. Solids 46 (1998) 931, and H. Eyring, J. Chem. Phys. 4 (1936) 283, for flow that stress quickens"
    )
    signature: ClassVar[str] = (
        "Unloading below loading in every cycle, with a gap that depends on time and speed and closes at rest; force "
        "falls in holds and recovers at zero."
    )
    of_the_material = True
    constant = True
    needs_return: ClassVar[bool] = True
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
        EffectParameter(
            "quickens",
            "-",
            "ln of how much more quickly it relaxes under the largest stress than under none",
            HalfNormal(10.0),
            (0.0, 40.0),
            begin=0.0,
        ),
    )

    @property
    def starts(self) -> list[dict[str, float]]:
        """A broad spectrum is not found from one time alone, nor a flow from what relaxes linearly."""
        broad = [{"time": 10.0, "decades": 2.5}, {"time": 100.0, "decades": 2.5}, {"decades": 5.0, "tilt": 0.3}]
        return [*broad, {"time": 3.0, "decades": 2.0, "quickens": 15.0}]

    def remember(self, p: Array, force: Array, path: Motion) -> Array:
        gap = np.diff(path.clock, prepend=0.0)
        weight = (1 + np.abs(path.deflection) / path.full_range) ** p[:, 4:5]
        places = (np.arange(TERMS) + 0.5) / TERMS - 0.5
        spread = 10.0 ** (places * p[:, 2:3])
        share = spread ** -p[:, 5:6]
        share /= np.sum(share, axis=1, keepdims=True)
        stress, times = force / weight, p[:, 1:2] * spread
        if np.any(p[:, 6]):
            reach = self.reach or SOURCE
            largest = (reach.whole_force or reach.force) * 2.0 ** -p[:, 4:5]
            kept = largest * flowing(stress / largest, path, times, share, p[:, 6])
        else:
            kept = relaxing(stress, gap, times, share)
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


def flowing(stress: Array, path: Motion, times: Array, share: Array, quickens: Array) -> Array:
    """`relaxing` where time counts exp(``quickens`` (|q| - `USUAL`)), with q what of the ``stress`` (B, N) has not yet
    relaxed.

    Over a step this is taken at the mean of q at its two ends, the second by `ROUNDS` of Newton's method. A long way
    has `STEPS` to the full range, a wait is parted as its time grows: most is gone soon. With stresses up to 1, 12
    readings a way and ``quickens`` up to 30 what is left is within 1.5 % of an integrator with error control.
    """
    gap, way = np.diff(path.clock, prepend=0.0), np.abs(np.diff(path.deflection, prepend=0.0)) / path.full_range
    first, waits = _steps(gap, way)
    out = np.empty(stress.shape)
    _flow(*(for_kernel(v) for v in (stress, times, share, quickens)), first, waits, out)
    return out


@compiled(error_model="numpy")
def _steps(gap, way):  # type: ignore[no-untyped-def]
    """((N + 1,) where the steps of each reading begin, (M,) s how long each takes), of gaps (N,) s and ways (N,)."""
    first, rested = np.zeros(gap.size + 1, np.int64), np.zeros(gap.size)
    fastest, still = 0.0, 0.0
    for n in range(gap.size):
        speed = way[n] / gap[n] if gap[n] > 0.0 else np.inf
        waits = way[n] == 0.0 or speed < SLOW * fastest
        parts = np.ceil(max(way[n] * STEPS, 1.0))
        if waits:
            growth = np.log2((still + gap[n]) / still) if still > 0.0 else float(HALVED)
            parts = max(parts, np.ceil(min(growth, float(HALVED))))
        elif gap[n] > 0.0:
            fastest = max(fastest, speed)
        rested[n] = still if waits else -1.0
        still = still + gap[n] if waits else 0.0
        first[n + 1] = first[n] + int(parts)
    out = np.empty(first[-1])
    for n in range(gap.size):
        parts, before = first[n + 1] - first[n], 0.0
        for k in range(parts):
            if rested[n] > 0.0:
                end = rested[n] * ((rested[n] + gap[n]) / rested[n]) ** ((k + 1) / parts) - rested[n]
            elif rested[n] == 0.0:
                end = gap[n] * 0.5 ** (parts - 1 - k)
            else:
                end = gap[n] * (k + 1) / parts
            out[first[n] + k] = end - before
            before = end
    return first, out


@compiled(error_model="numpy", fastmath={"reassoc", "contract"})
def _flow(stress, times, share, quick, first, waits, out):  # type: ignore[no-untyped-def]
    """`flowing` of films one after the other: each time waits for what is left of the others.

    The times of a film stand side by side in a processor's lanes, for which exp(-g) is a polynomial in g / 64, squared
    six times: to 1e-9 of 1, and no more of its e^-40 is counted.
    """
    rows, points = stress.shape
    terms = times.shape[1]
    h, new, rate = np.empty(terms), np.empty(terms), np.empty(terms)
    some, steeper = np.empty(terms), np.empty(terms)
    for b in range(rows):
        for t in range(terms):
            h[t], rate[t] = 0.0, 1.0 / times[b, t]
        left, before, steep = 0.0, 0.0, 0.5 * quick[b]
        for n in range(points):
            some_waits = waits[first[n] : first[n + 1]]
            moved, gap = stress[b, n] - before, np.sum(some_waits)
            before = stress[b, n]
            for wait in some_waits:
                step, begun = (moved * wait / gap if gap > 0.0 else moved), abs(left)
                for _ in range(ROUNDS):
                    passed = wait * np.exp(min(steep * (begun + abs(left) - 2 * USUAL), MOST))
                    for t in range(terms):
                        whole = passed * rate[t]
                        g = min(whole, MOST)
                        x = g / 64
                        e = 1.0 - x * (1.0 - x * (1 / 2 - x * (1 / 6 - x * (1 / 24 - x * (1 / 120)))))
                        e *= e
                        e *= e
                        e *= e
                        e *= e
                        e *= e
                        e *= e
                        s = (1.0 - e) / whole if whole > 1e-5 else 1.0 - 0.5 * whole
                        kept = e * h[t]
                        new[t] = kept + s * step
                        some[t] = share[b, t] * new[t]
                        steeper[t] = share[b, t] * (g * kept + (s - e) * step)
                    found, slope = 0.0, 0.0
                    for t in range(terms):
                        found += some[t]
                        slope += steeper[t]
                    slope *= steep if left > 0.0 else -steep
                    left += (found - left) / max(1.0 + slope, 1.0)
                left = found
                for t in range(terms):
                    h[t] = new[t]
            out[b, n] = left
