"""The posterior of a long curve, asked at few deflections: what a draw weighs is what all its readings say.

    |y - B f|^2 = |c - R f|^2,    [B y] = Q [R c],

with f the forces of a film at n nodes, B (N, n) from there to the N readings (`physics.nodes`), and Q (N, n + 1)
orthonormal. The readings are asked for once, to find R and c; a draw costs n forces and n^2 products however many they
are, and no digits: nothing is subtracted that is not a residual.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.calibration.posterior import Along, Evaluation, Posterior, outcome_of
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.nodes import NODES
from bayesmembrane.physics.noise.base import NoiseLikelihood


class FewPosterior(Posterior):
    """A `Posterior` whose curves are told by coordinates (B, n + 1) along axes that hold the measured one, too.

    Densities are those of `Posterior` to 1e-6 of one near the best film, and to 1e-8 of them anywhere.
    """

    @property
    def readings(self) -> int:
        """n + 1: of so many numbers is a curve."""
        return NODES + 1

    @cached_property
    def measured(self) -> Array:
        """(n + 1,) N: c, the last of it what no curve through the nodes has of the measured one."""
        return self._factor[:, -1]

    def evaluate(self, x: ArrayLike) -> Evaluation:
        """As `Posterior.evaluate`, with the coordinates of the curves in place of their forces."""
        assert self.nodes is not None
        x = np.atleast_2d(np.asarray(x, dtype=float))
        mode = self.hypothesis.convexity
        found = self.nodes.few(x, reached=mode.looks_beyond, spare=mode.spare)
        inside, ok = self.prior.inside(found), found.ok
        curves, log_likelihood = np.full((len(x), self.readings), np.nan), np.full(len(x), -np.inf)
        if np.any(ok):
            curves[ok] = found.force[ok] @ self._factor[:, :-1].T
            with np.errstate(over="ignore", invalid="ignore"):
                value = self._told.likelihood_given(curves[ok], x[ok])
            log_likelihood[ok] = np.where(np.isnan(value), -np.inf, value)
        log_prior = np.where(inside, self.prior.log_density(x), -np.inf)
        return Evaluation(log_prior, log_likelihood, outcome_of(found.status, inside), curves)

    def given(self, curves: Array, x: Array) -> Array:
        return self._told.given(curves, x)

    def likelihood_given(self, curves: Array, x: Array) -> Array:
        return self._told.likelihood_given(curves, x)

    def along(self, axes: Array) -> Along:
        """`given` for curves in the span of orthonormal ``axes`` (R, n + 1) of coordinates."""
        return Along(self, axes @ self.measured, self._told.noise)

    @cached_property
    def _factor(self) -> Array:
        """(n + 1, n + 1): [R c]."""
        assert self.nodes is not None
        return np.asarray(np.linalg.qr(np.column_stack([self.nodes.spline, self.measurement.force]), mode="r"))

    @cached_property
    def _told(self) -> Along:
        noise = _alike(self)
        assert noise is not None
        return Along(self, self.measured, noise)


def weighing(posterior: Posterior) -> Posterior:
    """The same posterior as a walk asks for it: at the nodes of a long curve whose noise weighs all readings alike."""
    if posterior.nodes is None or _alike(posterior) is None:
        return posterior
    return FewPosterior(posterior.hypothesis, posterior.measurement, posterior.solve)


def _alike(posterior: Posterior) -> NoiseLikelihood | None:
    return posterior.noise.along(np.empty((0, len(posterior.measurement))))
