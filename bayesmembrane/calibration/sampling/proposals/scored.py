"""A posterior told by normal scores: whatever proposes has no long tails and no edges to follow."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bayesmembrane.calibration.posterior import Along, Evaluation, Given, Posterior
from bayesmembrane.calibration.sampling.proposals.bend import Bend
from bayesmembrane.calibration.sampling.proposals.scores import Scores
from bayesmembrane.ground.parameters import Array


def scores_of(posterior: object) -> Scores:
    """Of the coordinates of a posterior; what has no prior is taken as it is."""
    prior = getattr(posterior, "prior", None)
    return Scores(() if prior is None else tuple(p.prior for p in prior.hypothesis.parameters))


@dataclass(frozen=True, eq=False)
class Scored:
    """p(z | y) = p(x | y) |dx / dz| of the ``posterior`` of x."""

    posterior: Posterior
    scores: Scores

    @property
    def size(self) -> int:
        """k, the number of coordinates."""
        return self.posterior.size

    @property
    def readings(self) -> int:
        return self.posterior.readings

    def bent(self, bend: Bend | None) -> Scored:
        """The same in the coordinates of a bend of the scores."""
        return replace(self, scores=self.scores.bent(bend))

    def whole(self, z: Array) -> Array:
        """x (B, k) of z (B, k)."""
        return self.scores.back(z)

    def evaluate(self, z: Array) -> Evaluation:
        """As `Posterior.evaluate`, of z (B, k)."""
        found = self.posterior.evaluate(self.scores.back(z))
        return replace(found, log_prior=found.log_prior + self.scores.log_stretch(z))

    def given(self, curves: Array, z: Array) -> Array:
        """As `Posterior.given`, of z (B, k)."""
        return _given(self.posterior, self.scores, curves, z)


@dataclass(frozen=True, eq=False)
class ScoredAlong:
    """`Scored.given` of curves told along some axes."""

    along: Along
    scores: Scores

    def given(self, curves: Array, z: Array) -> Array:
        """As `Along.given`, of z (B, k)."""
        return _given(self.along, self.scores, curves, z)


def _given(posterior: Given, scores: Scores, curves: Array, z: Array) -> Array:
    """ln p(z) + ln p(y | z): a walk on an emulator asks for little else, and is spared what scores mean, if it can be.

    Likelihoods of one test's curves ask for the noise's coordinates alone, which come last, and are their own scores
    where their priors are normal.
    """
    if isinstance(posterior, Posterior | Along) and scores.plain_from(posterior.curve_size):
        return np.asarray(scores.log_prior(z) + posterior.likelihood_given(curves, z))
    return posterior.given(curves, scores.back(z)) + scores.log_stretch(z)
