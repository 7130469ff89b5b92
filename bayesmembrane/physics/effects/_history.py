"""What several effects remember alike: growth with the history of the deflection, and relaxation along the path."""

from __future__ import annotations

import numpy as np

from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.compiling import compiled
from bayesmembrane.ground.parameters import Array, HalfNormal, LogNormal, Uniform
from bayesmembrane.physics.effects.base import EffectParameter, running_max

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
    load = x**exponent
    power = running_max(load)
    first = (1 + saturation) * power / (1 + saturation * power)
    if not np.any(repeated > 0):
        return first
    step = np.diff(x * load, axis=-1, prepend=0.0)
    again = np.maximum(step, 0.0)
    if np.any(np.asarray(creeps) > 0):
        moved = np.diff(x, axis=-1, prepend=0.0)
        still = np.abs(moved) < STILL
        mean = np.where(still, (exponent + 1) * load, step / np.where(still, 1.0, moved))
        held = mean * np.diff(path.clock, prepend=0.0) * (path.pace / path.full_range)
        again = (1 - creeps) * again + creeps * held
    return np.asarray((1 - repeated) * first + repeated * np.cumsum(again, axis=-1))


def relaxing(values: Array, gap: Array, times: Array, shares: Array | None = None) -> Array:
    """(B, N) sum over T ``times`` (B, T), with their ``shares`` (B, T) or with equal ones, of h, which relaxes to zero
    and is moved by ``values`` (B, N): h_n = e_n h_(n-1) + s_n (v_n - v_(n-1)), from zero.

    Exact for values that move evenly over each ``gap`` (N,) of time, with g the gap in relaxation times: e = exp(-g)
    and s = (1 - e) / g. The values come from zero to the first one over its own gap. What relaxes with the way has
    gaps and lengths of that instead.
    """
    out = np.zeros_like(values)
    shares = np.full(times.shape, 1 / times.shape[1]) if shares is None else np.ascontiguousarray(shares, dtype=float)
    _relax(values, np.ascontiguousarray(gap, dtype=float), np.ascontiguousarray(times, dtype=float), shares, out)
    return out


@compiled(error_model="numpy")
def _relax(values, gap, times, shares, out):  # type: ignore[no-untyped-def]
    for b in range(values.shape[0]):
        for t in range(times.shape[1]):
            h, before, last, e, s = 0.0, 0.0, -1.0, 1.0, 1.0
            for n in range(values.shape[1]):
                if gap[n] != last:  # of an even clock one exponential is enough
                    last = gap[n]
                    g = last / times[b, t]
                    if g > 1e-6:
                        e = np.exp(-g)
                        s = (1.0 - e) / g
                    else:
                        e = 1.0 - g
                        s = 1.0 - 0.5 * g
                h = e * h + s * (values[b, n] - before)
                before = values[b, n]
                out[b, n] += shares[b, t] * h
