"""Coordinates in which a bent valley is nearly straight: its narrow directions less polynomials of its long ones."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.calibration.sampling.proposals.polynomials import monomials, terms_of
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.symmetric import eigh

LONG = 4
"""Directions at most that a valley may bend along."""
DEGREES = (2, 3, 4)
PER_TERM = 5  # distinct draws for each coefficient
FARTHEST = 3.5  # standard deviations of the draws beyond which a valley is taken to go on as it is there
WORTH = 0.3  # ln of the held-out volume by which draws must lie closer, for a bend to be worth it
RIDGE, FLAT = 1e-8, 1e-12


@dataclass(frozen=True, eq=False)
class Bend:
    """u_i = w_i - q_i(w_1, ..., w_j), j = min(i - 1, `LONG`), with w = inverse (z - centre).

    The w_i are principal components of unit variance, the longest first, so that what is narrow is told by what is
    long; q_i are polynomials, constant beyond `FARTHEST`. Each u_i is w_i less something of those before it: volumes
    change by |inverse| alone, wherever that is, and z follows from u.

    centre : (k,); root, inverse : (k, k) z = centre + root w
    coefficients : (k, T) of all monomials of the long directions, zero where q_i must not have one
    degree : of these monomials
    """

    centre: Array
    root: Array
    inverse: Array
    coefficients: Array
    degree: int

    def of(self, z: Array) -> Array:
        """u (B, k) of z (B, k)."""
        w = (z - self.centre) @ self.inverse.T
        return w - self._along(w) @ self.coefficients.T

    def back(self, u: Array) -> Array:
        """z (B, k) of u (B, k)."""
        w = u.copy()
        for i in range(1, self.long):  # each of the long ones is told by those before it
            w[:, i] += self._along(w) @ self.coefficients[i]
        w[:, self.long :] += self._along(w) @ self.coefficients[self.long :].T
        return self.centre + w @ self.root.T

    @property
    def long(self) -> int:
        """How many directions the others are told by."""
        return _long(self.centre.size)

    @cached_property
    def log_stretch(self) -> float:
        """ln |dz / du|"""
        return float(np.linalg.slogdet(self.root)[1])

    @cached_property
    def _terms(self) -> NDArray[np.intp]:
        return terms_of(self.long, self.degree)

    def _along(self, w: Array) -> Array:
        """(B, T)"""
        return monomials(np.clip(w[:, : self.long], -FARTHEST, FARTHEST), self._terms)


def straight(bend: Bend | None, z: Array) -> Array:
    """z (n, k) as it is told along a bend; as it is if there is none."""
    return z if bend is None else bend.of(z)


def bend_of(z: Array) -> Bend | None:
    """The bend of the valley of draws z (n, k): of the degree that held-out places ask for; None if they ask for none.

    Draws may be the same place many times: all of those are held out, or none. None, too, where they fill no volume, or
    next to none in some direction.
    """
    k = z.shape[1]
    # By one coordinate: places differ in all of them.
    place = np.unique(z[:, 0], return_inverse=True)[1]
    if k < 2 or np.max(place) < 4 * PER_TERM:
        return None
    centre = np.mean(z, axis=0)
    values, vectors = eigh(np.atleast_2d(np.cov(z.T)))
    if not np.all(values > FLAT * np.max(values)):
        return None
    root: Array = np.ascontiguousarray((vectors * np.sqrt(values))[:, ::-1], dtype=float)
    inverse: Array = np.asarray(np.linalg.inv(root), dtype=float)
    w = (z - centre) @ inverse.T
    held = np.random.default_rng(0).permutation(np.max(place) + 1)[place] % 3 == 2
    distinct = len(np.unique(place[~held]))
    choices = [(_volume(w[held]) - WORTH, 0)]
    for degree in DEGREES:
        if PER_TERM * len(terms_of(_long(k), degree)) > distinct:
            break
        tried = Bend(np.zeros(k), np.eye(k), np.eye(k), _coefficients(w[~held], degree), degree)
        choices.append((_volume(tried.of(w[held])), degree))
    volume, degree = min(choices)
    if not np.isfinite(volume):  # nine tenths of all are one place
        return None
    return Bend(centre, root, inverse, _coefficients(w, degree), degree) if degree else None


def _long(k: int) -> int:
    return min(LONG, k - 1)


def _volume(w: Array) -> float:
    """ln of it, of draws (n, k): by the spread of each coordinate, the middle nine tenths."""
    low, high = np.quantile(w, [0.05, 0.95], axis=0)
    return float(np.sum(np.log(high - low))) if np.all(high > low) else -np.inf


def _coefficients(w: Array, degree: int) -> Array:
    """(k, T) by least squares, of each coordinate among the monomials that it may have."""
    k, long = w.shape[1], _long(w.shape[1])
    terms = terms_of(long, degree)
    a = monomials(np.clip(w[:, :long], -FARTHEST, FARTHEST), terms)
    highest = np.max(np.where(terms == long, -1, terms), axis=1)  # the last variable of each monomial
    found = np.zeros((k, len(terms)))
    for i in range(1, k):
        some = highest < min(i, long)
        gram = a[:, some].T @ a[:, some]
        gram[np.diag_indices_from(gram)] += RIDGE * len(w)
        found[i, some] = np.linalg.solve(gram, a[:, some].T @ w[:, i])
    return found
