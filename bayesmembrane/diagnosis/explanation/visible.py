"""What counts as an effect that is there: one whose own trace could be seen, on whatever scale beyond that."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from math import sqrt

import numpy as np

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.weighing import Weighing
from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS
from bayesmembrane.diagnosis.reference.noise import orthonormal
from bayesmembrane.ground.parameters import Array

DEVIATES = np.linspace(-6.0, 6.0, 241)
"""At which the posterior of a ratio is integrated."""
LEAST = 1e-11
"""Part of its evidence that a set keeps whatever the posterior of a ratio says: a normal one has no tails."""


@dataclass(frozen=True)
class Ratio:
    """The signal-to-noise ratio of an effect's own trace, which is free of what the material and others can absorb.

    mean, sd : of its posterior; 0 or more
    expected : that of the size which is expected before the data
    one_sided : the size has one sign only
    """

    mean: float
    sd: float
    expected: float
    one_sided: bool

    def at_least(self, mean: float) -> Ratio:
        """The same trace where a size has a larger ratio than it seems to have from nearby."""
        times = mean / self.mean if mean > self.mean > 0 else 1.0
        sd = min(self.sd * times, max(self.sd, 1.0))
        return Ratio(self.mean * times, sd, self.expected * times, self.one_sided)

    @property
    def log_seen(self) -> float:
        """ln E[q(r) / p(r)] over the posterior of the ratio r: what ln Z gains where its prior is q instead of p.

        Fits are weighed with p(r) = 2 / (pi R (1 + (r / R)^2)), R being what is expected: they may be of no size. What
        could not be seen, below r0 = `Beliefs.visible`, counts as absent, and what could is as probable on every scale
        up to R, with the same tail beyond: q(r) = min(1 / r, R / r^2) / (1 + ln(R / r0)) from r0 on. An R below r0 is
        taken to be r0.
        """
        r = np.abs(self.mean + self.sd * DEVIATES)
        weight = np.exp(-0.5 * DEVIATES**2)
        if self.one_sided:
            weight[self.mean + self.sd * DEVIATES < 0] = 0.0
        usual, there = max(self.expected, BELIEFS.visible), np.maximum(r, BELIEFS.visible)
        q = np.minimum(1 / there, usual / there**2) / (1 + np.log(usual / BELIEFS.visible)) * (r >= BELIEFS.visible)
        p = 2 / (np.pi * usual * (1 + (r / usual) ** 2))
        return float(np.log(max(float(np.sum(weight * q / p) / np.sum(weight)), LEAST)))


def log_seen(search: Weighing, candidate: Candidate, given: Collection[str], takes: Mapping[str, float]) -> float:
    """What ln Z gains where effects below what can be seen count as absent: the sum over its effects but those given.

    ``takes`` : {effect: squares that it takes away beside the fit without it}, as far as there is one. A trace that is
    bent may be absorbed nearby though no fit without it comes near: where not even its expected size could be seen,
    these say how large it is.
    """
    if not set(candidate.names) - set(given):
        return 0.0
    covariance, white = search.covariance(candidate), search.noise.white(candidate.slopes)
    whole, position = 0.0, candidate.hypothesis.material_size
    for effect in candidate.hypothesis.effects:
        if effect.name not in given:
            others = np.delete(white, range(position, position + len(effect.coordinates)), axis=1)
            own = [position + i for i in effect.sizes]
            lengths = own_lengths(white[:, own], others)
            sizes = np.abs(candidate.x[own] - [effect.coordinates[i].null or 0.0 for i in effect.sizes])
            sds, expected = np.sqrt(np.maximum(np.diagonal(covariance)[own], 0.0)), search.expected_sizes(effect)
            first = int(np.argmax(sizes * lengths))  # of several sizes the one that is seen best
            mean, sd, usual = (float(v[first] * lengths[first]) for v in (sizes, sds, expected))
            ratio = Ratio(mean, sd, usual, effect.coordinates[effect.sizes[first]].one_sided)
            if ratio.expected < BELIEFS.visible:
                ratio = ratio.at_least(sqrt(max(takes.get(effect.name, 0.0), 0.0)))
            whole += ratio.log_seen
        position += len(effect.coordinates)
    return whole


def own_lengths(white: Array, others: Array) -> Array:
    """(m,) of columns (N, m), freed of noise, what is left once ``others`` (N, p) have taken what they can."""
    basis = orthonormal(others)
    return np.asarray(np.linalg.norm(white - basis @ (basis.T @ white), axis=0))
