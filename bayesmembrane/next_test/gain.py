"""What a further test is worth: how much it shortens a posterior, or how seldom explanations stay confused."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, pairwise

import numpy as np

from bayesmembrane.ground.parameters import Array


def longest_axis(precision: Array, scale: Array) -> Array:
    """(B,) root of the largest eigenvalue of T precision^-1 T, T = diag(``scale``), (B, k, k) and (B, k).

    The least eigenvalue of the inverse is found more exactly.
    """
    scaled = precision / scale[:, :, None] / scale[:, None, :]
    least = np.linalg.eigvalsh(scaled)[:, 0]
    return np.asarray(1 / np.sqrt(np.maximum(least, 1e-300)))


def information(slopes: Array) -> Array:
    """Fisher information sum_m s_m s_m^T (B, k, k) of slopes over the noise (B, M, k)."""
    with np.errstate(all="ignore"):
        return np.asarray(np.einsum("bmk,bml->bkl", slopes, slopes))


def confused(foretold: Sequence[tuple[Array, Array]]) -> Array:
    """ln BC of every two of P predictions N(m, 1 + G G^T), m (M,) and G (M, r), in the order of `combinations`:

        ln BC_ab = -d^T S^-1 d / 8 + (ln |S_a| + ln |S_b|) / 4 - ln |S| / 2,    d = m_a - m_b, S = (S_a + S_b) / 2.

    0: they say the same. A. Bhattacharyya, Bull. Calcutta Math. Soc. 35 (1943) 99. By the products of all columns, so
    that a pair costs what its columns do, however many readings there are.
    """
    every = np.column_stack([np.column_stack([m - foretold[0][0], g]) for m, g in foretold])
    products = every.T @ every
    ends = np.cumsum([0, *(g.shape[1] + 1 for _, g in foretold)])
    means, columns = ends[:-1], [np.arange(a + 1, b) for a, b in pairwise(ends)]
    single = [_log_det(products[np.ix_(c, c)]) for c in columns]
    out = []
    for a, b in combinations(range(len(foretold)), 2):
        both = np.concatenate([columns[a], columns[b]])
        gram = 0.5 * products[np.ix_(both, both)]
        along = (products[both, means[a]] - products[both, means[b]]) / np.sqrt(2)
        whole = products[means[a], means[a]] + products[means[b], means[b]] - 2 * products[means[a], means[b]]
        square = whole - along @ np.linalg.solve(np.eye(both.size) + gram, along)
        out.append(-max(float(square), 0.0) / 8 + (single[a] + single[b]) / 4 - _log_det(gram) / 2)
    return np.minimum(out, 0.0)


def _log_det(gram: Array) -> float:
    """ln |1 + G G^T| of G^T G."""
    return float(np.linalg.slogdet(np.eye(len(gram)) + gram)[1])
