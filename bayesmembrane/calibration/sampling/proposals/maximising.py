"""Expectation maximisation of a mixture of t-distributions, compiled.

With d_j(x) = |R_j^-1 (x - m_j)|^2, k coordinates and nu degrees of freedom, in turn
    s_j(x) ~ w_j |R_j|^-1 (1 + d_j / nu)^-(nu + k) / 2,  sum_j s_j = 1,   v_j = s_j (nu + k) / (nu + d_j),
    w_j = mean s_j,   m_j = sum v_j x / sum v_j,   R_j R_j^T = sum v_j (x - m_j)(x - m_j)^T / sum s_j + ridge
(D. Peel, G. J. McLachlan, Stat. Comput. 10 (2000) 339). Draws lie side by side, so that one instruction takes several.
"""

from __future__ import annotations

from math import lgamma

import numpy as np

from bayesmembrane.ground.compiling import compiled
from bayesmembrane.ground.parameters import Array

RIDGE, PULL = 1e-6, 1e-3  # of the draws' variance; the latter for a component that holds one draw only
LEAST = 1e-300
Components = tuple[Array, Array, Array]
"""Weights w (K,), means m (K, k) and lower triangular roots R (K, k, k)."""

_sums = compiled(error_model="numpy", fastmath={"reassoc", "contract"})


@compiled(error_model="numpy")
def maximised(x: Array, share: Array, degrees: int, rounds: int, enough: float) -> Components:
    """The components for whitened draws x (k, n), from shares (K, n), which are overwritten.

    At most so many ``rounds``; one that gains less than ``enough`` of the mean ln density is the last.
    """
    tail = np.ones_like(share)
    found: Components = _fitted(x, share, tail)
    before = -np.inf
    for _ in range(rounds):
        now = _shared(x, found, degrees, share, tail)
        if now < before + enough:
            break
        before = now
        found = _fitted(x, share, tail)
    return found


@_sums
def _fitted(x: Array, share: Array, tail: Array) -> Components:
    """The components for shares s (K, n) and s times what the tails leave of them; overwrites the latter with v."""
    (k, n), count = x.shape, len(share)
    weights, means, roots = np.empty(count), np.empty((count, k)), np.zeros((count, k, k))
    away, v = np.empty((k, n)), np.empty(n)
    for j in range(count):
        size, total = 0.0, 0.0
        for b in range(n):
            v[b] = share[j, b] * tail[j, b]
            size += share[j, b]
            total += v[b]
        size, total = max(size, 1e-12), max(total, 1e-12)
        weights[j] = size / n
        for i in range(k):
            pull = 0.0
            for b in range(n):
                pull += v[b] * x[i, b]
            means[j, i] = pull / total
            for b in range(n):
                away[i, b] = x[i, b] - means[j, i]
        for i in range(k):
            for m in range(i + 1):
                spread = 0.0
                for b in range(n):
                    spread += v[b] * away[i, b] * away[m, b]
                roots[j, i, m] = spread / size
            roots[j, i, i] += RIDGE + PULL * k / size
        _root(roots[j])
    return weights, means, roots


@compiled(error_model="numpy")
def _root(a: Array) -> None:
    """Overwrite the lower triangle of a positive matrix (k, k) with its Cholesky root."""
    for i in range(len(a)):
        for m in range(i + 1):
            left = a[i, m]
            for o in range(m):
                left -= a[i, o] * a[m, o]
            a[i, m] = np.sqrt(left) if m == i else left / a[m, m]


@_sums
def _shared(x: Array, found: Components, degrees: int, share: Array, tail: Array) -> float:
    """Fill ``share`` and ``tail`` (K, n) with s and (nu + k) / (nu + d); returns the mean ln density of the draws."""
    weights, means, roots = found
    (k, n), nu = x.shape, float(degrees)
    y, total = np.empty((k, n)), np.zeros(n)
    norm = lgamma(0.5 * (nu + k)) - lgamma(0.5 * nu) - 0.5 * k * np.log(np.pi * nu)
    for j in range(len(weights)):
        level, left, density = weights[j] * np.exp(norm), tail[j], share[j]
        for b in range(n):
            left[b] = 0.0
        for i in range(k):
            level /= roots[j, i, i]
            for b in range(n):
                y[i, b] = x[i, b] - means[j, i]
            for m in range(i):
                for b in range(n):
                    y[i, b] -= roots[j, i, m] * y[m, b]
            inverse = 1.0 / roots[j, i, i]
            for b in range(n):
                y[i, b] *= inverse
                left[b] += y[i, b] * y[i, b]
        for b in range(n):
            left[b] = nu / (nu + left[b])
        _power(left, degrees + k, level, density)
        for b in range(n):
            total[b] += density[b]
            left[b] *= (nu + k) / nu
    mean: float = 0.0
    for b in range(n):
        total[b] = max(total[b], LEAST)
        mean += np.log(total[b]) / n
    for j in range(len(weights)):
        for b in range(n):
            share[j, b] /= total[b]
    return mean


@compiled(error_model="numpy")
def _power(x: Array, halves: int, level: float, out: Array) -> None:
    """Fill ``out`` (n,) with level x^(halves / 2), by products: logarithms and exponentials take ten times as long."""
    base, left = x.copy(), halves // 2
    for b in range(len(x)):
        out[b] = level * np.sqrt(x[b]) if halves % 2 else level
    while left > 0:
        if left % 2:
            for b in range(len(x)):
                out[b] *= base[b]
        for b in range(len(x)):
            base[b] *= base[b]
        left //= 2
