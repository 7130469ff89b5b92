"""What counts as an effect that is there: one whose own trace could be seen, on whatever scale beyond that."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from math import log, sqrt

import numpy as np
from scipy.special import logsumexp

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.weighing import Weighing
from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS
from bayesmembrane.diagnosis.explanation.unfitted import Key
from bayesmembrane.diagnosis.reference.noise import free_of
from bayesmembrane.diagnosis.thresholds import GROWTH, TINY
from bayesmembrane.ground.parameters import Array

DEVIATES = np.linspace(-6.0, 6.0, 241)
"""At which a likelihood is integrated, in its standard deviations."""
SCALES = np.geomspace(1e-2, 1e2, 81)
"""At which a prior is, in parts of what is expected."""
SHARPEST = 1e-9
"""Standard deviation of a ratio, and what is expected of it, at least."""
LOOSE = 0.1
"""Part of what is known of a size that the data say, at least: all else is the prior."""
LEAST = 1e-11
"""Part of its weight that a set keeps whatever the likelihood of a ratio says: a normal one has no tails."""


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

    @property
    def resolved(self) -> Ratio:
        """The same in units of its standard deviation, where that is less than one.

        What is left of a trace by all that others could absorb is less than what shows, where the priors of the others
        keep them from absorbing it.
        """
        times = 1 / min(max(self.sd, SHARPEST), 1.0)
        return Ratio(self.mean * times, self.sd * times, self.expected * times, self.one_sided)

    def without_prior(self, usual: float) -> Ratio:
        """1 / s0^2 = 1 / s^2 - 1 / R^2 and m0 = m s0^2 / s^2: the likelihood of a posterior with s < 1.

        R = ``usual`` is the standard deviation of the prior about where the ratio is: with Cauchy's tails it is wider
        there than about nothing.
        """
        if self.sd >= 1:
            return self
        certain = max(1 - (self.sd / max(usual, SHARPEST)) ** 2, LOOSE)
        return Ratio(self.mean / certain, self.sd / sqrt(certain), self.expected, self.one_sided)

    def log_part(self, counts: float) -> float:
        """ln int q(r) L(r)^c dr, its part in a weight to which its likelihood L contributes a part c = ``counts``.

        L(r) = exp(-(r - m)^2 / (2 s^2)) of the ratio r. What could not be seen, below r0 = `Beliefs.visible`, counts as
        absent, and what could is as probable on every scale up to the expected R, with the tail of Cauchy's law beyond:
        q(r) = min(1 / r, R / r^2) / (1 + ln(R / r0)) from r0 on, half of that for either sign. Where R is below r0,
        it is R / r^2: a part R / r0 of such effects is large enough to be there at all.
        """
        faintest, usual = BELIEFS.visible, max(self.expected, BELIEFS.visible)

        def log_q(r: Array) -> Array:
            there = np.maximum(r, faintest)
            own = np.log(np.minimum(1 / there, usual / there**2) / (1 + log(usual / faintest)))
            return np.where(r >= faintest, own + log(max(self.expected, SHARPEST) / usual), -np.inf)

        places = np.concatenate([[faintest * (1 - 1e-9), faintest], usual * SCALES])
        return self._log_integral(log_q, places, self.sd / sqrt(counts))

    def log_before(self, counts: float) -> float:
        """ln int p(r) L(r)^c dr, its part in ln Z: fits are weighed with p(r) = 2 / (pi R (1 + (r / R)^2))."""
        usual = max(self.expected, SHARPEST)
        constant, sd = log(2 / (np.pi * usual)), self.sd / sqrt(counts)
        return self._log_integral(lambda r: constant - np.log1p((r / usual) ** 2), usual * SCALES, sd)

    def log_seen(self, counts: float, squares: float = 0.0) -> float:
        """ln int q(r) L(r)^c dr - ln int p(r) L(r)^c dr: what a weight gains where the prior is q, and not p.

        Of the likelihood a part c = ``counts`` speaks for or against an effect, as in `Weighing.log_tempered`.
        ``squares`` : that the effect takes away beside the fit without it. A trace that is bent may be absorbed nearby
        though no fit without it comes near: where not even its expected size could be seen, these say how large it is.
        """
        before = self.log_before(counts)
        seen = self.at_least(sqrt(max(squares, 0.0))) if self.expected < BELIEFS.visible else self
        return max(seen.log_part(counts), before + log(LEAST)) - before

    def _log_integral(self, log_density: Callable[[Array], Array], places: Array, sd: float) -> float:
        """ln int density(|r|) exp(-(r - m)^2 / (2 sd^2)) dr, half the density for either sign, by trapezoids."""
        sd = max(sd, SHARPEST)
        near = np.concatenate([self.mean + sd * DEVIATES, sd * (DEVIATES - DEVIATES[0])])
        r = np.unique(np.concatenate([[0.0], near[near > 0], places]))
        log_likelihood = -0.5 * ((r - self.mean) / sd) ** 2
        if not self.one_sided:
            log_likelihood = np.logaddexp(log_likelihood, -0.5 * ((r + self.mean) / sd) ** 2) - log(2)
        step = np.diff(r)
        share = 0.5 * (np.append(step, 0.0) + np.insert(step, 0, 0.0))
        return float(logsumexp(log_density(r) + log_likelihood, b=share))


def all_seen(
    search: Weighing,
    found: Mapping[Key, Candidate],
    weights: Mapping[Key, float],
    given: Collection[str],
    counts: float,
) -> dict[Key, float]:
    """`log_seen` of each hypothesis but for the effects ``given``; ``weights`` are those without it.

    One that is far behind has no share in the sum, and is left as it is.
    """
    first, squares, out = max(weights.values()), dict[frozenset[str], float](), {}
    excess = {key: search.excess(c) for key, c in found.items()}
    for (_, names), own in excess.items():
        squares[names] = min(squares.get(names, np.inf), own)
    for key, c in found.items():
        names, near = key[1], first - weights[key] < GROWTH.share_reach
        takes = {e: squares[names - {e}] - excess[key] for e in names if names - {e} in squares}
        out[key] = log_seen(search, c, given, takes, counts) if near else 0.0
    return out


def log_seen(
    search: Weighing, candidate: Candidate, given: Collection[str], takes: Mapping[str, float], counts: float
) -> float:
    """What a weight gains where effects below what can be seen count as absent, with a part ``counts`` of likelihoods.

    The sum over the effects of a candidate but those given.
    ``takes`` : {effect: squares that it takes away beside the fit without it}, as far as there is one.
    """
    if not set(candidate.names) - set(given):
        return 0.0
    covariance, white = search.covariance(candidate), search.noise.white(candidate.slopes)
    unbound, steep = _unbound(search, candidate), search.steepness(candidate)
    whole, position = 0.0, candidate.hypothesis.material_size
    for effect in candidate.hypothesis.effects:
        if effect.name not in given:
            others = np.delete(white, range(position, position + len(effect.coordinates)), axis=1)
            own, one_sided = [position + i for i in effect.sizes], effect.size.one_sided
            null = np.array([effect.coordinates[i].null or 0.0 for i in effect.sizes])
            sizes = candidate.x[own] - null
            if one_sided:  # where one is at its end the likelihood may speak for the other sign
                sizes = np.where(sizes == 0, np.minimum(unbound[own] - null, 0.0), sizes)
            ratio = own_ratio(
                free_of(others, white[:, own]),
                sizes,
                covariance[np.ix_(own, own)],
                search.expected_sizes(effect),
                one_sided,
                steep[own],
            )
            whole += ratio.log_seen(counts, takes.get(effect.name, 0.0))
        position += len(effect.coordinates)
    return whole


def _unbound(search: Weighing, candidate: Candidate) -> Array:
    """(k,) the coordinates that the linear model would have if nothing stopped it."""
    mean, _ = search.linear(candidate).first(candidate.theta, candidate.x.size)
    return candidate.x + (mean - search.coefficients_at(candidate)) * search.steepness(candidate)


def own_ratio(own: Array, sizes: Array, covariance: Array, expected: Array, one_sided: bool, local: Array) -> Ratio:
    """Of the whole trace of an effect with traces ``own`` (N, m) of its ``sizes`` (m,), one in each of several tests.

    covariance : (m, m) of the sizes; expected : (m,) before the data; local : (m,) standard deviations of their priors
    about where they are. The priors of m sizes are in ln Z, and that of the whole trace is exchanged for another one:
    the others count as ln Z does.
    """
    usual = own @ (expected if one_sided else np.copysign(expected, sizes))
    along = own @ sizes if np.any(sizes) else usual
    length = float(np.linalg.norm(along))
    turn = own.T @ along / max(length, TINY)
    sd = sqrt(max(float(turn @ covariance @ turn), 0.0))
    mean = 0.0 if not np.any(sizes) else -length if one_sided and along @ usual < 0 else length
    found = Ratio(mean, sd, float(np.linalg.norm(usual)), one_sided)
    return found.without_prior(float(np.linalg.norm(turn * local))).resolved
