"""What several effects remember alike: growth with the history of the deflection, and relaxation along the path."""

from __future__ import annotations

import numpy as np

from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.compiling import compiled, for_kernel
from bayesmembrane.ground.parameters import Array, HalfNormal, LogNormal, Uniform
from bayesmembrane.physics.effects.base import EffectParameter

EXPONENT = EffectParameter(
    "exponent", "-", "power of the deflection with which it grows", LogNormal(2.0, 0.5), (0.4, 12.0)
)
SATURATION = EffectParameter(
    "saturation", "-", "how far it has saturated at the end of the range, 0: not at all", HalfNormal(2.0), (0.0, 100.0)
)
REPEATED = EffectParameter(
    "repeated",
    "-",
    "part that grows with every loading, and not only beyond the previous maximum",
    Uniform(0.0, 1.0),
    (0.0, 1.0),
)
CREEPS = EffectParameter(
    "creeps", "-", "part of that which grows with time under load, in holds too", Uniform(0.0, 1.0), (0.0, 1.0)
)
JUMP = EffectParameter("jump", "-", "part of it that comes at once", Uniform(0.0, 1.0), (0.0, 1.0))
SECOND = EffectParameter(
    "second", "-", "part of that which comes in a second event", HalfNormal(0.3), (0.0, 1.0), begin=0.0
)
TOGETHER = 8
"""Films that are relaxed side by side."""
STILL = 1e-7
"""Of the full range: a smaller step is none, and the mean of a power over it the power itself."""


def growth(
    exponent: Array,
    repeated: Array,
    deflection: Array,
    path: Motion,
    saturation: Array | float = 0.0,
    creeps: Array | float = 0.0,
) -> Array:
    """G (B, N) = (1 - c) H + c (a + 1) [(1 - q) sum over loading steps of (x / D)^a dx / D + q int (x / D)^a v dt / D],
    never falling; with H = (1 + s) (m / D)^a / (1 + s (m / D)^a).

    m is the largest deflection so far, D the full range of the test, v the `pace` of its first loading, a ``exponent``,
    c ``repeated``, s ``saturation`` and q ``creeps``, each (B, 1): a power if s = 0, a threshold or a quick rise that
    comes to its end if not. A first loading up to D at one speed ends at G = 1 for any of them; the second part goes on
    growing when it is repeated, and the last one while the film is stretched, be it held.
    """
    x = np.maximum(deflection, 0.0) / path.full_range
    load = for_kernel(x**exponent)
    x = for_kernel(x if x.shape == load.shape else np.broadcast_to(x, load.shape))
    each = [for_kernel(np.broadcast_to(v, (len(load), 1))[:, 0]) for v in (exponent, repeated, saturation, creeps)]
    gap, pace, out = np.diff(path.clock, prepend=0.0), path.pace / path.full_range, np.empty(load.shape)
    _grown(x, load, *each, gap, pace, out)
    return out


@compiled(error_model="numpy")
def _grown(x, load, exponent, repeated, saturation, creeps, gap, pace, out):  # type: ignore[no-untyped-def]
    """`growth` of x and load = x^exponent (B, N), with shapes (B,), ``gap`` (N,) of the clock and the pace over D."""
    for b in range(x.shape[0]):
        power, total, whole, at = 0.0, 0.0, 0.0, 0.0
        s, c, q = saturation[b], repeated[b], creeps[b]
        for n in range(x.shape[1]):
            power = max(power, load[b, n])
            first = (1.0 + s) * power / (1.0 + s * power)
            before, whole = whole, x[b, n] * load[b, n]
            step, moved, at = whole - before, x[b, n] - at, x[b, n]
            again = max(step, 0.0)
            if q > 0.0:
                mean = (exponent[b] + 1.0) * load[b, n] if abs(moved) < STILL else step / moved
                again = (1.0 - q) * again + q * (mean * gap[n] * pace)
            total += again
            out[b, n] = (1.0 - c) * first + c * total


def relaxing(values: Array, gap: Array, times: Array, shares: Array | None = None) -> Array:
    """(B, N) sum over T ``times`` (B, T), with their ``shares`` (B, T) or with equal ones, of h, which relaxes to zero
    and is moved by ``values`` (B, N): h_n = e_n h_(n-1) + s_n (v_n - v_(n-1)), from zero.

    Exact for values that move evenly over each ``gap`` (N,) of time, with g the gap in relaxation times: e = exp(-g)
    and s = (1 - e) / g. The values come from zero to the first one over its own gap. What relaxes with the way has
    gaps and lengths of that instead.
    """
    out = np.empty(values.shape)
    shares = np.full(times.shape, 1 / times.shape[1]) if shares is None else np.ascontiguousarray(shares, dtype=float)
    _relax(values, np.ascontiguousarray(gap, dtype=float), np.ascontiguousarray(times, dtype=float), shares, out)
    return out


@compiled(error_model="numpy")
def _relax(values, gap, times, shares, out):  # type: ignore[no-untyped-def]
    """Films side by side, for what relaxes waits for itself; `TOGETHER` of them, which a processor's cache holds.

    Exponentials are most of the work where the clock is uneven: films that are alike in a time share them.
    """
    rows, points = values.shape
    like = np.empty(TOGETHER, np.int64)
    steps, total = np.empty((points, TOGETHER)), np.empty((points, TOGETHER))
    e, s, h, share = np.empty(TOGETHER), np.empty(TOGETHER), np.empty(TOGETHER), np.empty(TOGETHER)
    for first in range(0, rows, TOGETHER):
        many = min(TOGETHER, rows - first)
        for w in range(TOGETHER):
            b, before = min(first + w, rows - 1), 0.0
            for n in range(points):
                steps[n, w] = values[b, n] - before
                before = values[b, n]
        total[:] = 0.0
        for t in range(times.shape[1]):
            last = -1.0
            for w in range(TOGETHER):
                e[w], s[w], h[w], share[w] = 1.0, 1.0, 0.0, shares[min(first + w, rows - 1), t]
            for w in range(many):
                like[w] = w
                for other in range(w):
                    if times[first + other, t] == times[first + w, t]:
                        like[w] = other
                        break
            for n in range(points):
                if gap[n] != last:  # of an even clock one exponential is enough
                    last = gap[n]
                    for w in range(many):
                        g = last / times[first + w, t]
                        if like[w] < w:
                            e[w], s[w] = e[like[w]], s[like[w]]
                        elif g > 1e-6:
                            e[w] = np.exp(-g)
                            s[w] = (1.0 - e[w]) / g
                        else:
                            e[w] = 1.0 - g
                            s[w] = 1.0 - 0.5 * g
                step, whole = steps[n], total[n]
                for w in range(TOGETHER):
                    h[w] = e[w] * h[w] + s[w] * step[w]
                    whole[w] += share[w] * h[w]
        for w in range(many):
            for n in range(points):
                out[first + w, n] = total[n, w]
