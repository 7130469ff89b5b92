"""Eigenvalues of symmetric matrices, also where the quick algorithm does not find them."""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh as slow_eigh

from bayesmembrane.ground.parameters import Array


def eigh(a: Array) -> tuple[Array, Array]:
    """(values (..., m) rising, vectors (..., m, m)) of a = V diag(w) V^T, of symmetric a (..., m, m).

    NumPy divides and conquers, which OpenBLAS's LAPACK may give up though all is in order (a covariance of 49
    coefficients, of condition 1e8); QR's iterations are slower and found those. Raises `LinAlgError`
    where a number is not finite.
    """
    try:
        values, vectors = np.linalg.eigh(a)
        return values, vectors
    except np.linalg.LinAlgError:
        if not np.all(np.isfinite(a)):
            raise
    one_by_one = [slow_eigh(one, driver="ev") for one in np.reshape(a, (-1, *a.shape[-2:]))]
    values, vectors = (np.array(part) for part in zip(*one_by_one, strict=True))
    return values.reshape(a.shape[:-1]), vectors.reshape(a.shape)


def normal_draws(covariance: Array, count: int, rng: np.random.Generator) -> Array:
    """(count, m) of N(0, covariance (m, m)), which may be singular, and negative by round-off."""
    values, vectors = eigh(covariance)
    return np.asarray(rng.standard_normal((count, values.size)) @ (vectors * np.sqrt(np.maximum(values, 0.0))).T)
