"""Relaxation that stress quickens, followed from step to step: of a flow time runs by what is left to relax."""

from __future__ import annotations

import numpy as np

from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.compiling import compiled, for_kernel
from bayesmembrane.ground.parameters import Array

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


def flowing(stress: Array, path: Motion, times: Array, share: Array, quickens: Array) -> Array:
    """(B, N) `relaxing` where time counts exp(``quickens`` (|q| - `USUAL`)), with q what of the ``stress`` (B, N) has
    not yet relaxed.

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
        waits = gap[n] > 0.0 and (way[n] == 0.0 or speed < SLOW * fastest)
        parts = np.ceil(max(way[n] * STEPS, 1.0)) if gap[n] > 0.0 else 1.0
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
