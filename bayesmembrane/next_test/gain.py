"""What a further test is worth: how much it shortens a posterior, or how far apart it puts two explanations."""

from __future__ import annotations

import numpy as np

from bayesmembrane.ground.parameters import Array

ADAPTS = 1e-9  # of the largest singular value: directions weaker than that cannot adapt


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


def separation(difference: Array, slopes: Array, sd: float) -> float:
    """|d - J t| / sd, least over t: what is left of a difference (M,) where an explanation with slopes (M, k) adapts.

    Infinity where that cannot be told. Raises `numpy.linalg.LinAlgError` where no t is found.
    """
    if not (np.all(np.isfinite(difference)) and np.all(np.isfinite(slopes))):
        return np.inf
    scale = np.maximum(np.linalg.norm(slopes, axis=0), 1e-300)
    fit = np.linalg.lstsq(slopes / scale, difference, rcond=ADAPTS)[0]
    return float(np.linalg.norm(difference - slopes / scale @ fit)) / sd
