"""Whether the misfit of the posterior looks like its own noise: what a chi-square, blind to order, cannot see."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.data.thinning import MOST
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.symmetric import eigh
from bayesmembrane.physics.noise.base import Noise, NoiseLikelihood

CURVES = 200
"""Draws whose curves tell what the parameters can do, and of long curves all draws that are asked."""


@dataclass(frozen=True)
class Alike:
    """How alike neighbouring residuals are.

    Attributes
    ----------
    noise : name of the model that was asked
    lag_1 : mean over the draws of the correlation of neighbours along the path
    expected : the same of what the noise model draws itself
    p_value : how often the latter is at least as large; small where the misfit is smooth
    """

    noise: str
    lag_1: float
    expected: float
    p_value: float

    def summary(self) -> dict[str, Any]:
        return asdict(self)


def alike(
    noise: Noise, bound: NoiseLikelihood, residual: Array, x: Array, free: int, rng: np.random.Generator
) -> Alike:
    """Lag-1 correlation of the residuals (B, N) of B posterior draws, beside that of as many draws of their noise.

    bound : ``noise``, at the curves of the draws; x (B, k) are its coordinates
    free : parameters of the curve

    What those can do, the ``free`` first principal directions of the draws' curves, is taken out of both, so that
    y - F(x) is left with what the noise leaves of itself whatever x is. Each p-value is then uniform where model and
    prior are right (V. E. Johnson, Bayesian Anal. 2 (2007) 719, of pivotal quantities), and their mean over the draws
    below any p at most twice as often as p (X.-L. Meng, Ann. Stat. 22 (1994) 1142).
    """
    some = residual[np.linspace(0, len(residual) - 1, min(len(residual), CURVES)).astype(int)]
    known = directions(some - np.mean(some, axis=0), min(free, residual.shape[1] - 1))
    sd = bound.sd(x)
    found, drawn = (lag_1((r - r @ known.T @ known) / sd) for r in (residual, bound.draw(x, rng)))
    p = (1 + np.count_nonzero(drawn >= found)) / (1 + len(found))
    return Alike(noise.name, float(np.mean(found)), float(np.mean(drawn)), float(p))


def asked(draws: int, readings: int) -> NDArray[np.intp]:
    """Which of so many draws `alike` is to be given: all, but for `CURVES` of them where a draw has many readings."""
    return np.linspace(0, draws - 1, min(draws, CURVES) if readings > MOST else draws).astype(np.intp)


def directions(rows: Array, count: int) -> Array:
    """(m, N) orthonormal, at most ``count``: the first principal directions of ``rows`` (B, N).

    Of long rows A from the eigenvectors U of A A^T: A^T U is orthogonal but for round-off, which a QR takes away.
    """
    if rows.shape[1] <= MOST:
        return np.asarray(np.linalg.svd(rows, full_matrices=False)[2][:count])
    _, u = eigh(rows @ rows.T)
    return np.asarray(np.linalg.qr(rows.T @ u[:, ::-1][:, :count])[0].T)


def lag_1(z: Array) -> Array:
    """(B,) sum z_i z_(i+1) / sum z_i^2 of rows z (B, N); 0 of a row of zeros."""
    square = np.sum(z * z, axis=1)
    return np.asarray(np.sum(z[:, 1:] * z[:, :-1], axis=1) / np.where(square > 0, square, 1.0))
