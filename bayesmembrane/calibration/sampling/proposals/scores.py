"""Coordinates told by their normal scores: without long tails and edges, and normal where only the prior speaks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bayesmembrane.calibration.sampling.proposals.bend import Bend, straight
from bayesmembrane.ground.parameters import Array, Normal, Prior

ROUND_OFF = 1e-9  # of a score that was bent and is told back


@dataclass(frozen=True, eq=False)
class Scores:
    """z_i with P(Z <= z_i) = P(X_i <= x_i), Z ~ N(0, 1), where the prior of x_i is not normal; else z_i = x_i.

    A time that may lie in any of six decades, a part that ends at one, a size that begins at zero: what walks there or
    follows it by a mixture of smooth densities has an easier way in z. With a ``bend``, u of z is meant wherever z is.
    """

    priors: tuple[Prior, ...]
    bend: Bend | None = None

    def bent(self, bend: Bend | None) -> Scores:
        """The same with this bend, or with none."""
        return replace(self, bend=bend)

    @property
    def plain(self) -> bool:
        """Whether z is x."""
        return not self._told and self.bend is None

    def plain_from(self, first: int) -> bool:
        """Whether z_i is x_i of all coordinates from ``first`` on."""
        return self.bend is None and all(i < first for i, _ in self._told)

    def of(self, x: Array) -> Array:
        """z (B, k) of x (B, k); at an end of the support the farthest that a double tells."""
        z = x
        if self._told:
            z = x.copy()
            for i, prior in self._told:
                z[:, i] = np.clip(prior.scores(x[:, i]), *prior.TOLD)
        return straight(self.bend, z)

    def back(self, z: Array) -> Array:
        """x (B, k) of z (B, k)."""
        z = z if self.bend is None else self.bend.back(z)
        if not self._told:
            return z
        x = z.copy()
        for i, prior in self._told:
            x[:, i] = prior.from_scores(np.clip(z[:, i], *prior.TOLD))
        return x

    def log_stretch(self, z: Array) -> Array:
        """ln |dx / dz|, (B,), at z (B, k); -inf where a double does not tell scores apart."""
        total = np.full(len(z), 0.0 if self.bend is None else self.bend.log_stretch)
        z = z if self.bend is None else self.bend.back(z)
        for i, prior in self._told:
            low, high = prior.TOLD
            value = prior.log_density(prior.from_scores(np.clip(z[:, i], low, high)))
            total -= 0.5 * (z[:, i] ** 2 + np.log(2 * np.pi)) + value
            total[(z[:, i] < low - ROUND_OFF) | (z[:, i] > high + ROUND_OFF)] = -np.inf
        return total

    def log_prior(self, z: Array) -> Array:
        """ln p0(z), (B,): all scores are normal."""
        mean, sd, low, high = self._normals
        level = -float(np.sum(np.log(sd * np.sqrt(2 * np.pi))))
        if self.bend is not None:
            z, level = self.bend.back(z), level + self.bend.log_stretch
        d = (z - mean) / sd
        value = level - 0.5 * np.einsum("bi,bi->b", d, d)
        return np.where(np.all((z >= low - ROUND_OFF) & (z <= high + ROUND_OFF), axis=1), value, -np.inf)

    @cached_property
    def _told(self) -> list[tuple[int, Prior]]:
        return [(i, p) for i, p in enumerate(self.priors) if type(p) is not Normal]

    @cached_property
    def _normals(self) -> tuple[Array, Array, Array, Array]:
        """Mean, deviation, least and largest value of every score, (k,) each."""
        of = [(p.mean, p.sd, -np.inf, np.inf) if type(p) is Normal else (0.0, 1.0, *p.TOLD) for p in self.priors]
        mean, sd, low, high = np.array(of, dtype=float).reshape(-1, 4).T
        return mean, sd, low, high
