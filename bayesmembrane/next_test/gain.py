"""What a further test is worth: how much it shortens a posterior, or how seldom explanations stay confused."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

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
    own = [g.T @ g for _, g in foretold]
    single, out = [_log_det(gram) for gram in own], []
    for a, b in combinations(range(len(foretold)), 2):
        (mean_a, columns_a), (mean_b, columns_b) = foretold[a], foretold[b]
        cross, apart = columns_a.T @ columns_b, mean_a - mean_b
        gram = 0.5 * np.block([[own[a], cross], [cross.T, own[b]]])
        along = np.concatenate([columns_a.T @ apart, columns_b.T @ apart]) / np.sqrt(2)
        square = apart @ apart - along @ np.linalg.solve(np.eye(along.size) + gram, along)
        out.append(-max(float(square), 0.0) / 8 + (single[a] + single[b]) / 4 - _log_det(gram) / 2)
    return np.minimum(out, 0.0)


def _log_det(gram: Array) -> float:
    """ln |1 + G G^T| of G^T G."""
    return float(np.linalg.slogdet(np.eye(len(gram)) + gram)[1])
