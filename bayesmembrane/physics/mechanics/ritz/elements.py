"""Short polynomials side by side: their tables, where they lie, and how a solution moves from some to others."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.polynomial import legendre

from bayesmembrane.ground.compiling import compiled
from bayesmembrane.ground.parameters import Array

POINTS = 3  # Gauss points of an element beyond the number of its bubbles
SAMPLES = 8  # pieces of an element between which it is told how much the film bends
# Elements share what they gain to this power, and never less than this part of the mean in width.
SHARE, WIDEST = 1.0 / 10.0, 0.08

# Legendre's recurrence P_(i+1) = UP x P_i - DOWN P_(i-1), and the factor that makes a slope of unit norm.
_I = np.arange(1, 32)
UP, DOWN, NORM = (np.append(0.0, v) for v in ((2 * _I + 1) / (_I + 1), _I / (_I + 1), np.sqrt((2 * _I + 1) / 2)))


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


@compiled(error_model="numpy")
def _home(t, ends):  # type: ignore[no-untyped-def]
    """The element in which t lies."""
    e = 0
    while e < ends.size - 2 and t >= ends[e + 1]:
        e += 1
    return e


@compiled(error_model="numpy")
def _end(q, k, per, elements):  # type: ignore[no-untyped-def]
    """The two sums at end k of the elements: zero at the edges."""
    if k == 0 or k == elements:
        return 0.0, 0.0
    return q[2 * (k * per - 1)], q[2 * (k * per - 1) + 1]


@compiled(error_model="numpy")
def _slopes(t, e, q, ends, bubbles):  # type: ignore[no-untyped-def]
    """Slopes of the two sums at t in element e, from the unknowns q (2n,)."""
    per, elements = bubbles + 1, ends.size - 1
    half = 0.5 * (ends[e + 1] - ends[e])
    left, right = _end(q, e, per, elements), _end(q, e + 1, per, elements)
    a, b = 0.5 * (right[0] - left[0]), 0.5 * (right[1] - left[1])
    x = (t - ends[e]) / half - 1.0
    before, now, o = 1.0, x, 2 * e * per
    for i in range(1, per):
        a += NORM[i] * now * q[o]
        b += NORM[i] * now * q[o + 1]
        before, now, o = now, UP[i] * x * now - DOWN[i] * before, o + 2
    return a / half, b / half


@compiled(error_model="numpy")
def _values(t, e, q, ends, bubbles):  # type: ignore[no-untyped-def]
    """The two sums at t in element e."""
    per, elements = bubbles + 1, ends.size - 1
    left, right = _end(q, e, per, elements), _end(q, e + 1, per, elements)
    x = 2.0 * (t - ends[e]) / (ends[e + 1] - ends[e]) - 1.0
    a = 0.5 * ((1.0 - x) * left[0] + (1.0 + x) * right[0])
    b = 0.5 * ((1.0 - x) * left[1] + (1.0 + x) * right[1])
    before, now, o = 1.0, x, 2 * e * per
    for i in range(1, per):
        after = UP[i] * x * now - DOWN[i] * before
        part = NORM[i] * (after - before) / (2 * i + 1)
        a, b = a + part * q[o], b + part * q[o + 1]
        before, now, o = now, after, o + 2
    return a, b


@compiled(error_model="numpy")
def _density(q, ends, gain, d, bubbles, share, widest):  # type: ignore[no-untyped-def]
    """How much of the new elements belongs in each of `SAMPLES` pieces of every old one, summed up from 0."""
    # Loops, here and below: numba takes seconds to compile what is said of whole arrays.
    elements, span, most, whole = gain.size, ends[-1], 0.0, 0.0
    level, bend = np.empty(elements * SAMPLES + 1), np.empty(SAMPLES)
    for e in range(elements):
        most = max(most, gain[e])
    for e in range(elements):
        width = (ends[e + 1] - ends[e]) / SAMPLES
        total, u, w = 0.0, 0.0, 0.0
        falls, shrinks = np.exp(-ends[e]), np.exp(-width)
        for k in range(SAMPLES + 1):
            a, b = _slopes(ends[e] + k * width, e, q, ends, bubbles)
            b = falls * (d / span + b)
            if k > 0:
                bend[k - 1] = np.sqrt((a - u) ** 2 + (b - w) ** 2)
                total += bend[k - 1]
            u, w, falls = a, b, falls * shrinks
        weight = (max(gain[e], 1e-30 * most) / most) ** share if most > 0.0 else 1.0
        for k in range(SAMPLES):
            part = bend[k] / total if total > 0.0 else 1.0 / SAMPLES
            level[e * SAMPLES + k + 1] = weight * (0.5 / SAMPLES + 0.5 * part)
        whole += weight
    level[0] = 0.0
    for i in range(elements * SAMPLES):
        e = i // SAMPLES
        level[i + 1] += level[i] + widest * whole * (ends[e + 1] - ends[e]) / (SAMPLES * span)
    return level


@compiled(error_model="numpy")
def _place(ends, level, new):  # type: ignore[no-untyped-def]
    """New ends between which the ``level`` rises by the same amount."""
    wanted, i = new.size - 1, 0
    new[0], new[wanted] = 0.0, ends[-1]
    for k in range(1, wanted):
        goal = level[-1] * k / wanted
        while level[i + 1] < goal:
            i += 1
        e = i // SAMPLES
        width = (ends[e + 1] - ends[e]) / SAMPLES
        new[k] = ends[e] + width * (i - e * SAMPLES + (goal - level[i]) / (level[i + 1] - level[i]))


@compiled(error_model="numpy")
def _move(q, ends, bubbles, new, other, nodes, weights, rates, out):  # type: ignore[no-untyped-def]
    """The nearest in slope, element by element, of the solution q on ``new`` elements with ``other`` bubbles."""
    per = other + 1
    for e in range(new.size - 1):
        half, start = 0.5 * (new[e + 1] - new[e]), 2 * e * per
        if e > 0:
            out[start - 2], out[start - 1] = _values(new[e], _home(new[e], ends), q, ends, bubbles)
        for i in range(2 * other):
            out[start + i] = 0.0
        for g in range(nodes.size):
            t = new[e] + half * (1.0 + nodes[g])
            a, b = _slopes(t, _home(t, ends), q, ends, bubbles)
            for i in range(other):
                w = weights[g] * half * rates[i + 1, g]
                out[start + 2 * i] += w * a
                out[start + 2 * i + 1] += w * b


@compiled(error_model="numpy")
def _replace(q, ends, gains, d, bubbles, new, other, tables, share, widest, out):  # type: ignore[no-untyped-def]
    nodes, weights, _, rates = tables
    for k in range(q.shape[0]):
        _place(ends[k], _density(q[k], ends[k], gains[k], d[k], bubbles, share, widest), new[k])
        _move(q[k], ends[k], bubbles, new[k], other, nodes, weights, rates, out[k])


def replaced(
    q: Array, ends: Array, gains: Array, d: Array, bubbles: int, level: tuple[int, int]
) -> tuple[Array, Array]:
    """Ends (K, E'+1) of elements that suit K solutions, and the solutions on them (K, 2n').

    q (K, 2n) on elements with ``ends`` (K, E+1) and ``bubbles`` each, at scaled deflections d (K,)
    gains (K, E) : energy that each of them would still gain from more bubbles
    level : how many elements with how many bubbles are wanted
    """
    elements, other = level
    new, out = np.empty((len(q), elements + 1)), np.empty((len(q), unknowns(elements, other)))
    tables = basis(elements, other)[:4]
    # Rows one after the other, as numba would compile for each way in which they may lie.
    q, ends, gains, d = (np.ascontiguousarray(v) for v in (q, ends, gains, d))
    _replace(q, ends, gains, d, bubbles, new, other, tables, SHARE, WIDEST, out)
    return new, out
