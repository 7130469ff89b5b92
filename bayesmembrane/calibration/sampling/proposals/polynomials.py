"""Monomials of several variables."""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.ground.compiling import compiled
from bayesmembrane.ground.parameters import Array


def terms_of(k: int, degree: int) -> NDArray[np.intp]:
    """(T, degree) all monomials up to ``degree`` in k variables, by the indices of their factors; k stands for one."""
    return np.array(list(combinations_with_replacement(range(k + 1), degree)), dtype=np.intp)


def monomials(z: Array, terms: NDArray[np.intp]) -> Array:
    """Products of the columns of z (B, k) named in ``terms`` (T, degree), shape (B, T)."""
    factors = np.ones((z.shape[1] + 1, len(z)))
    factors[:-1] = z.T
    return np.asarray(_products(factors, terms).T)


@compiled()
def _products(factors: Array, terms: NDArray[np.intp]) -> Array:
    """(T, B) products of those rows of ``factors`` (k + 1, B) that are named in ``terms`` (T, degree).

    A walk on an emulator does little else; draws lie side by side so that one instruction takes several.
    """
    count, degree = terms.shape
    draws = factors.shape[1]
    out = np.empty((count, draws))
    for t in range(count):
        first = terms[t, 0]
        for b in range(draws):
            out[t, b] = factors[first, b]
        for d in range(1, degree):
            row = terms[t, d]
            for b in range(draws):
                out[t, b] *= factors[row, b]
    return out
