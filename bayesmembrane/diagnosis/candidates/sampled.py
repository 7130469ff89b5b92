"""ln Z of a hypothesis by importance sampling: how far its linear model is off, and how sure that is.

`evidence` takes a hypothesis as linear about its fit. Here its curves are solved at draws u_i of a t-distribution q
about the posterior of the linear model,

    Z(theta) = (1 / n) sum_i N(y - F(u_i); 0, s^2 S + form error) p(u_i) / q(u_i),

with the sizes theta of noise and form error, and the traces, that the fit shows, and with the true priors p(u) within
their bounds. The difference from the linear model's own ln Z(theta) is the error of being linear. T. Kloek, H. K. van
Dijk, Econometrica 46 (1978) 1.

Of n draws the n' = (sum w)^2 / sum w^2 that count lie where q is large, and tails of the posterior are found by none:
where their part e = n' / n is small, estimates are low. `SAMPLED.unseen` says by how much.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import gammaln

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.evidence import Linear
from bayesmembrane.diagnosis.candidates.standard import Standard
from bayesmembrane.diagnosis.candidates.weighing import Weighing
from bayesmembrane.diagnosis.thresholds import SAMPLED, Drawing
from bayesmembrane.ground.parameters import Array


@dataclass(frozen=True)
class ByDraws:
    """What draws say of a linear evidence.

    found : ln Z less that of the linear model, as the draws have it
    sd : standard error of it by the draws alone
    counting : draws that count, n' = (sum w)^2 / sum w^2
    drawn : n
    """

    found: float
    sd: float
    counting: float
    drawn: int

    @property
    def unseen(self) -> float:
        """What such draws miss of ln Z."""
        part = self.counting / self.drawn
        return SAMPLED.unseen * max(float(np.log(SAMPLED.all_seen / part)), 0.0) if part > 0 else 0.0

    @property
    def difference(self) -> float:
        """ln Z less that of the linear model."""
        return self.found + self.unseen

    @property
    def good(self) -> bool:
        """Whether it says more than the linear model does."""
        return self.counting >= SAMPLED.least


def checked(search: Weighing, candidate: Candidate, drawing: Drawing = SAMPLED.first) -> Candidate:
    """The candidate with ln Z by importance sampling; with that of the linear model where too few draws count.

    Its draws are its own: what was checked before, and which energy was asked about, changes nothing.
    """
    rng = np.random.default_rng([search.seed, *candidate.label.encode()])
    found = sampled(search, candidate, rng, drawing)
    more = found.difference if found.good else 0.0
    return replace(candidate, log_evidence=candidate.log_evidence - candidate.by_draws + more, by_draws=more)


def sampled(
    search: Weighing, candidate: Candidate, rng: np.random.Generator, drawing: Drawing = SAMPLED.first
) -> ByDraws:
    """How far the evidence of ``candidate`` is off for being linear.

    Every round of draws is from a t-distribution about what the draws before say of the posterior, and all of them
    count, each over the mixture of all that was drawn from (J.-M. Cornuet et al., Scand. J. Stat. 39 (2012) 798).
    """
    target = _TruePosterior(search, candidate)
    proposals = [_Proposal.about(target.mean, target.covariance)]
    u, density = np.empty((0, candidate.x.size)), np.empty(0)
    for number in range(drawing.most_rounds):
        new = proposals[-1].drawn(SAMPLED.draws, rng)
        u, density = np.concatenate([u, new]), np.concatenate([density, target.log_density(new)])
        q = np.logaddexp.reduce([p.log_density(u) for p in proposals], axis=0) - np.log(len(proposals))
        weights = density - q
        effective = _effective(weights)
        if effective >= (drawing.enough if number < drawing.early else drawing.enough_later):
            break
        if effective:
            proposals.append(_fitted(u, weights, target.covariance))
        else:  # no film where the linear model sees one: closer to the fit
            proposals.append(_Proposal.about(target.fit, 0.1 ** len(proposals) * target.covariance))
    if not effective:
        return ByDraws(-np.inf, np.inf, 0.0, weights.size)
    log_z = float(np.logaddexp.reduce(weights) - np.log(weights.size))
    sd = float(np.sqrt(max(1 / effective - 1 / weights.size, 0.0)))
    return ByDraws(log_z - target.linear, sd, effective, weights.size)


@dataclass(frozen=True, eq=False)
class _Proposal:
    """A t-distribution of `SAMPLED.freedom` degrees of freedom: its mean (k,) and the root (k, k) of its scale."""

    mean: Array
    root: Array

    @classmethod
    def about(cls, mean: Array, covariance: Array) -> _Proposal:
        return cls(mean, np.asarray(np.linalg.cholesky(covariance + SAMPLED.round_off * np.diag(np.diag(covariance)))))

    def drawn(self, count: int, rng: np.random.Generator) -> Array:
        """(count, k)."""
        z = rng.standard_normal((count, self.mean.size))
        z *= np.sqrt(SAMPLED.freedom / rng.chisquare(SAMPLED.freedom, (count, 1)))
        return np.asarray(self.mean + z @ self.root.T)

    def log_density(self, u: Array) -> Array:
        """(n,) at u (n, k)."""
        k, nu = self.mean.size, SAMPLED.freedom
        back = solve_triangular(self.root, (u - self.mean).T, lower=True)
        constant = gammaln((nu + k) / 2) - gammaln(nu / 2) - 0.5 * k * np.log(nu * np.pi)
        constant -= np.sum(np.log(np.diag(self.root)))
        return np.asarray(constant - 0.5 * (nu + k) * np.log1p(np.sum(back * back, axis=0) / nu))


def _fitted(u: Array, log_weights: Array, known: Array) -> _Proposal:
    """About draws u (n, k), their weights flattened until enough of them count to know a covariance; a little of the
    one that is ``known`` (k, k) is added.
    """
    power, least = 1.0, SAMPLED.to_fit * u.shape[1]
    while _effective(power * log_weights) < least and power > SAMPLED.flattest:
        power *= SAMPLED.flatter
    w = np.exp(power * (log_weights - np.max(log_weights)))
    w /= np.sum(w)
    mean = w @ u
    off = u - mean
    return _Proposal.about(mean, (off.T * w) @ off + SAMPLED.kept * known)


def _effective(log_weights: Array) -> float:
    """(sum w)^2 / sum w^2; 0 where nothing has a weight."""
    top = np.max(log_weights)
    if not np.isfinite(top):
        return 0.0
    w = np.exp(log_weights - top)
    return float(np.sum(w) ** 2 / np.sum(w * w))


class _TruePosterior:
    """The posterior of a hypothesis at the sizes of noise and form error that its fit shows, in the coordinates u of
    `Standard`, not normalised.
    """

    def __init__(self, search: Weighing, candidate: Candidate) -> None:
        self.search, self.candidate = search, candidate
        self.axes: Standard = search.axes(candidate.hypothesis)
        model, theta = search.linear(candidate), candidate.theta
        k = candidate.x.size
        u = self.axes.to_u(candidate.x)
        spread = self.axes.local(u)
        mean, covariance = model.first(theta, k)
        self.fit, self.mean = u, mean * spread
        self.covariance = covariance * np.outer(spread, spread)
        self.rest = Linear(np.zeros(len(model.data)), model.blocks[1:], model.ln_scale_sd)
        self.constant = self.rest.log_density(theta).value
        self.linear = model.log_density(theta).value + search.log_corrected(candidate, model, theta)

    def log_density(self, u: Array) -> Array:
        """(n,) at u (n, k)."""
        out = np.full(len(u), -np.inf)
        low, high = self.axes.ends
        inside = np.flatnonzero(np.all((u >= low) & (u <= high), axis=1))
        if not inside.size:
            return out
        r = self.search.misfits(self.candidate.hypothesis, self.axes.to_x(u[inside]))
        reached = np.all(np.isfinite(r), axis=1)
        white = self.search.noise.white(r[reached].T)
        squares = np.sum(white * self.rest.freed(self.candidate.theta, white), axis=0)
        kept = inside[reached]
        out[kept] = self.constant - 0.5 * squares + self.axes.log_prior(u[kept])
        return out
