"""What counts as an effect that is there: one whose own trace could be seen, on whatever scale beyond that."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from math import log, sqrt

import numpy as np

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.weighing import Weighing
from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS
from bayesmembrane.diagnosis.reference.noise import orthonormal
from bayesmembrane.diagnosis.thresholds import TINY
from bayesmembrane.ground.parameters import Array

DEVIATES = np.linspace(-6.0, 6.0, 961)
"""At which a likelihood is integrated."""
SHARPEST = 1e-9
"""Standard deviation of a ratio, at least."""
LEAST = 1e-11
"""Part of its evidence that a set keeps whatever the likelihood of a ratio says: a normal one has no tails."""


@dataclass(frozen=True)
class Ratio:
    """The signal-to-noise ratio of an effect's own trace, which is free of what the material and others can absorb.

    mean, sd : of its likelihood, taken as normal; the mean is negative where it speaks for a sign that is not allowed
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

    def log_part(self, counts: float) -> float:
        """ln int q(r) L(r)^c dr, its part in a weight to which its likelihood L contributes a part c = ``counts``.

        L(r) = exp(-(r - m)^2 / (2 s^2)) of the ratio r. What could not be seen, below r0 = `Beliefs.visible`, counts as
        absent, and what could is as probable on every scale up to the expected R, with the tail of Cauchy's law beyond:
        q(r) = min(1 / r, R / r^2) / (1 + ln(R / r0)) from r0 on, half of that for either sign. An R below r0 is taken
        to be r0.
        """
        usual = max(self.expected, BELIEFS.visible)

        def q(r: Array) -> Array:
            there = np.maximum(r, BELIEFS.visible)
            own = np.minimum(1 / there, usual / there**2) / (1 + np.log(usual / BELIEFS.visible))
            return np.asarray(own * (r >= BELIEFS.visible))

        return self._log_integral(q, self.sd / sqrt(counts))

    def log_seen(self, counts: float) -> float:
        """ln int q(r) L(r)^c dr - c ln int p(r) L(r) dr: what a weight of c ln Z gains where the prior is q, not p.

        Fits are weighed with p(r) = 2 / (pi R (1 + (r / R)^2)): they may be of no size. A part c = ``counts`` of the
        likelihood speaks for or against an effect, but its prior whole: else a set whose sizes cost much before the
        data would gain more by q than its likelihood does. With c = 1 it is ln E[q(r) / p(r)] over the posterior.
        """
        usual = max(self.expected, BELIEFS.visible)
        before = counts * self._log_integral(lambda r: 2 / (np.pi * usual * (1 + (r / usual) ** 2)), self.sd)
        return max(self.log_part(counts), before + log(LEAST)) - before

    def _log_integral(self, density: Callable[[Array], Array], sd: float) -> float:
        """ln int density(|r|) exp(-(r - m)^2 / (2 sd^2)) dr, half the density for either sign."""
        sd = max(sd, SHARPEST)
        r = self.mean + sd * DEVIATES
        weight = np.where(r < 0, 0.0, 1.0) if self.one_sided else np.full(r.size, 0.5)
        whole = np.sum(weight * density(np.abs(r)) * np.exp(-0.5 * DEVIATES**2)) * (DEVIATES[1] - DEVIATES[0])
        return float(np.log(max(float(whole) * sd, TINY)))


def log_seen(
    search: Weighing, candidate: Candidate, given: Collection[str], takes: Mapping[str, float], counts: float
) -> float:
    """What a weight of ``counts`` ln Z gains where effects below what can be seen count as absent.

    The sum over the effects of a candidate but those given.
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
            sizes = candidate.x[own] - [effect.coordinates[i].null or 0.0 for i in effect.sizes]
            ratio = own_ratio(
                freed(white[:, own], others),
                sizes,
                covariance[np.ix_(own, own)],
                search.expected_sizes(effect),
                effect.size.one_sided,
            )
            if ratio.expected < BELIEFS.visible:
                ratio = ratio.at_least(sqrt(max(takes.get(effect.name, 0.0), 0.0)))
            whole += ratio.log_seen(counts)
        position += len(effect.coordinates)
    return whole


def own_ratio(own: Array, sizes: Array, covariance: Array, expected: Array, one_sided: bool) -> Ratio:
    """Of the whole trace of an effect with traces ``own`` (N, m) of its ``sizes`` (m,), one in each of several tests.

    covariance : (m, m) of the sizes; expected : (m,) before the data
    """
    signs = np.where(sizes < 0, -1.0, 1.0)
    along = own @ (sizes if np.any(sizes) else expected)
    length = float(np.linalg.norm(along))
    turn = own.T @ along / max(length, TINY)
    return Ratio(
        length if np.any(sizes) else 0.0,
        sqrt(max(float(turn @ covariance @ turn), 0.0)),
        float(np.linalg.norm(own @ (signs * expected))),
        one_sided,
    )


def freed(white: Array, others: Array) -> Array:
    """Columns (N, m), freed of noise, less what ``others`` (N, p) can take of them."""
    basis = orthonormal(others)
    return np.asarray(white - basis @ (basis.T @ white))
