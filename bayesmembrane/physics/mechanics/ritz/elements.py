"""Short polynomials side by side: their tables, where they lie, and how a solution moves from some to others."""

from __future__ import annotations

from functools import cache
from typing import Any

import numba
import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from bayesmembrane.ground.parameters import Array

POINTS = 3  # Gauss points of an element beyond the number of its bubbles
SAMPLES = 8  # pieces of an element between which it is told how much the film bends
# Elements share what they gain to this power, and never less than this part of the mean in width.
SHARE, WIDEST = 1.0 / 10.0, 0.08


@cache
def basis(elements: int, bubbles: int) -> tuple[Any, ...]:
    """Tables of hats and integrated Legendre bubbles on -1 < x < 1, see `kernels`.

    Gauss nodes and weights (G,); value and rate (bubbles + 2, G + 2) at these and at -1 and 1; the next two bubbles
    (2, 2, G); and, of the banded matrix, low (2n,) and its width.
    """
    nodes, weights = legendre.leggauss(bubbles + POINTS)
    value, rate = functions(np.append(nodes, [-1.0, 1.0]), bubbles)
    extra = np.stack([v[bubbles + 1 : bubbles + 3] for v in functions(nodes, bubbles + 2)])
    per, n = bubbles + 1, unknowns(elements, bubbles) // 2
    low = np.repeat(2 * np.maximum(np.arange(n) // per * per - 1, 0), 2)
    width = int(np.max(np.arange(2 * n) - low)) + 1
    return nodes, weights, value, rate, np.ascontiguousarray(extra), low, width


def unknowns(elements: int, bubbles: int) -> int:
    """2n, how many numbers describe a film."""
    return 2 * (elements * (bubbles + 1) - 1)


def functions(x: Array, bubbles: int) -> tuple[Array, Array]:
    """Values and rates (bubbles + 2, M) at x (M,): left hat, N_i = int_-1^x P_i of unit slope norm, right hat."""
    value, rate = np.empty((bubbles + 2, x.size)), np.empty((bubbles + 2, x.size))
    value[0], rate[0] = 0.5 * (1 - x), -0.5
    value[-1], rate[-1] = 0.5 * (1 + x), 0.5
    for i in range(1, bubbles + 1):
        c = np.zeros(i + 1)
        c[i] = np.sqrt((2 * i + 1) / 2)
        rate[i] = legendre.legval(x, c)
        value[i] = legendre.legval(x, legendre.legint(c, lbnd=-1))
    return value, rate


def graded(ratio: float, elements: int) -> Array:
    """(E+1,) ends in t: shorter elements towards the edges, where soft films form boundary layers."""
    ends = np.log(ratio) * (1 - np.cos(np.pi * np.arange(elements + 1) / elements)) / 2
    return np.asarray(ends)


def evaluate(q: Array, ends: Array, bubbles: int, t: Array) -> tuple[Array, Array]:
    """sum_i q_i phi_i and its slope (2, M) at t (M,): of l2 and of h, from the unknowns q (2n,) of one film."""
    coefficients = np.zeros((2, q.size // 2 + 2))
    coefficients[:, 1:-1] = q.reshape(-1, 2).T
    home = np.clip(np.searchsorted(ends, t, side="right") - 1, 0, ends.size - 2)
    half = 0.5 * np.diff(ends)[home]
    value, rate = functions((t - ends[home]) / half - 1, bubbles)
    local = coefficients[:, home * (bubbles + 1) + np.arange(bubbles + 2)[:, None]]
    return np.sum(local * value, axis=1), np.sum(local * rate, axis=1) / half


@numba.njit(cache=True, error_model="numpy")
def _legendre(x, bubbles, value, rate):  # type: ignore[no-untyped-def]
    """`functions` at one x, into value and rate (bubbles + 2,)."""
    value[0], rate[0], value[bubbles + 1], rate[bubbles + 1] = 0.5 * (1 - x), -0.5, 0.5 * (1 + x), 0.5
    before, now = 1.0, x
    for i in range(1, bubbles + 1):
        after = ((2 * i + 1) * x * now - i * before) / (i + 1)
        norm = np.sqrt((2 * i + 1) / 2)
        rate[i] = norm * now
        value[i] = norm * (after - before) / (2 * i + 1)
        before, now = now, after


@numba.njit(cache=True, error_model="numpy")
def _at(t, q, ends, bubbles, value, rate, out):  # type: ignore[no-untyped-def]
    """out (4,) : sums of a and b and their slopes at t, from the unknowns q (2n,) on elements with these ends."""
    elements, per = ends.size - 1, bubbles + 1
    e = 0
    while e < elements - 1 and t >= ends[e + 1]:
        e += 1
    half = 0.5 * (ends[e + 1] - ends[e])
    _legendre((t - ends[e]) / half - 1.0, bubbles, value, rate)
    out[:] = 0.0
    for i in range(1 if e == 0 else 0, per if e == elements - 1 else per + 1):
        a, b = q[2 * (e * per - 1 + i)], q[2 * (e * per - 1 + i) + 1]
        out[0] += a * value[i]
        out[1] += b * value[i]
        out[2] += a * rate[i] / half
        out[3] += b * rate[i] / half


@numba.njit(cache=True, error_model="numpy")
def _place(q, ends, gain, d, bubbles, new, share, widest, value, rate, line):  # type: ignore[no-untyped-def]
    """New ends for one film: as much of its bending, weighed by what its old elements would gain, in each."""
    elements, span, count = gain.size, ends[-1], gain.size * SAMPLES
    level, most = np.zeros(count + 1), np.max(gain)
    bend = np.zeros(SAMPLES)
    for e in range(elements):
        width = (ends[e + 1] - ends[e]) / SAMPLES
        total, u, w = 0.0, 0.0, 0.0
        for k in range(SAMPLES + 1):
            t = ends[e] + k * width
            if k == SAMPLES:
                t -= 1e-9 * width
            _at(t, q, ends, bubbles, value, rate, line)
            along, up = line[2] + line[0], np.exp(-t) * (d / span + line[3])
            if k > 0:
                bend[k - 1] = np.hypot(along - u, up - w)
                total += bend[k - 1]
            u, w = along, up
        weight = (max(gain[e], 1e-30 * most) / most) ** share if most > 0.0 else 1.0
        for k in range(SAMPLES):
            part = bend[k] / total if total > 0.0 else 1.0 / SAMPLES
            level[e * SAMPLES + k + 1] = weight * (0.5 / SAMPLES + 0.5 * part)
    whole = np.sum(level)
    for e in range(elements):
        for k in range(SAMPLES):
            level[e * SAMPLES + k + 1] += widest * whole * (ends[e + 1] - ends[e]) / (SAMPLES * span)
    level = np.cumsum(level)
    wanted, i = new.size - 1, 0
    new[0], new[wanted] = 0.0, span
    for k in range(1, wanted):
        goal = level[count] * k / wanted
        while level[i + 1] < goal:
            i += 1
        e = i // SAMPLES
        width = (ends[e + 1] - ends[e]) / SAMPLES
        new[k] = ends[e] + width * (i - e * SAMPLES + (goal - level[i]) / (level[i + 1] - level[i]))


@numba.njit(cache=True, error_model="numpy")
def _move(q, ends, bubbles, new, other, nodes, weights, values, rates, value, rate, line, out):  # type: ignore[no-untyped-def]
    """The nearest in slope, element by element, of the solution q on ``new`` elements with ``other`` bubbles."""
    elements, per = new.size - 1, other + 1
    for e in range(elements):
        half, start = 0.5 * (new[e + 1] - new[e]), e * per
        if e > 0:
            _at(new[e], q, ends, bubbles, value, rate, line)
            out[2 * (start - 1)], out[2 * (start - 1) + 1] = line[0], line[1]
        out[2 * start : 2 * (start + other)] = 0.0
        for g in range(nodes.size):
            _at(new[e] + half * (1.0 + nodes[g]), q, ends, bubbles, value, rate, line)
            for i in range(other):
                w = weights[g] * half * rates[i + 1, g]
                out[2 * (start + i)] += w * line[2]
                out[2 * (start + i) + 1] += w * line[3]


@numba.njit(cache=True, error_model="numpy")
def _replace(q, ends, gains, d, bubbles, new, other, tables, share, widest, out):  # type: ignore[no-untyped-def]
    nodes, weights, values, rates = tables
    value, rate, line = np.empty(bubbles + 2), np.empty(bubbles + 2), np.empty(4)
    for k in range(q.shape[0]):
        _place(q[k], ends[k], gains[k], d[k], bubbles, new[k], share, widest, value, rate, line)
        _move(q[k], ends[k], bubbles, new[k], other, nodes, weights, values, rates, value, rate, line, out[k])


def replaced(q: Array, ends: Array, gains: Array, d: Array, bubbles: int, level: tuple[int, int]) -> tuple[Array, Array]:
    """Ends (K, E'+1) of elements that suit K solutions, and the solutions on them (K, 2n').

    q (K, 2n) on elements with ``ends`` (K, E+1) and ``bubbles`` each, at scaled deflections d (K,)
    gains (K, E) : energy that each of them would still gain from more bubbles
    level : how many elements with how many bubbles are wanted
    """
    elements, other = level
    new, out = np.empty((len(q), elements + 1)), np.empty((len(q), unknowns(elements, other)))
    tables = basis(elements, other)[:4]
    _replace(q, ends, gains, d, bubbles, new, other, tables, SHARE, WIDEST, out)
    return new, out
