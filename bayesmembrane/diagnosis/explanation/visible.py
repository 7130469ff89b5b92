"""What counts as an effect that is there: one whose own trace could be seen, on whatever scale beyond that."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from math import inf, sqrt

import numpy as np

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.weighing import Weighing
from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS
from bayesmembrane.diagnosis.reference.noise import orthonormal
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.effects.base import Effect

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


def log_seen(search: Weighing, candidate: Candidate, given: Collection[str], without: dict[str, float]) -> float:
    """What ln Z gains where effects below what can be seen count as absent: the sum over its effects but those given.

    ``without`` : squares beyond noise of the fits without one effect, by its name, as far as there are any. A trace
    that is bent may be absorbed nearby though no fit without it comes near: where not even its expected size could be
    seen, the squares that it takes away say how large it is.
    """
    if not set(candidate.names) - set(given):
        return 0.0
    covariance, own = search.covariance(candidate), search.excess(candidate)
    whole, position = 0.0, candidate.hypothesis.material_size
    for effect in candidate.hypothesis.effects:
        if effect.name not in given:
            ratio = _ratio(search, candidate, effect, position, covariance)
            if ratio.expected < BELIEFS.visible:
                ratio = ratio.at_least(sqrt(max(without.get(effect.name, -inf) - own, 0.0)))
            whole += ratio.log_seen
        position += len(effect.coordinates)
    return whole


def _ratio(search: Weighing, candidate: Candidate, effect: Effect, position: int, covariance: Array) -> Ratio:
    """That of one effect of a candidate, whose coordinates begin at ``position``; of several sizes the largest."""
    white, own = search.noise.white(candidate.slopes), range(position, position + len(effect.coordinates))
    others = orthonormal(np.delete(white, list(own), axis=1))
    found = []
    for i, expected in zip(effect.sizes, search.expected_sizes(effect).tolist(), strict=True):
        slope, p = white[:, own[i]], effect.coordinates[i]
        length = float(np.linalg.norm(slope - others @ (others.T @ slope)))
        size, sd = abs(candidate.x[own[i]] - (p.null or 0.0)), sqrt(max(covariance[own[i], own[i]], 0.0))
        found.append(Ratio(float(size) * length, sd * length, expected * length, p.one_sided))
    return max(found, key=lambda r: r.mean)
