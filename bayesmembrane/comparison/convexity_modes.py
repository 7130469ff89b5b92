"""ln Z under every convexity mode, by importance sampling around the draws of one of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from bayesmembrane.calibration.posterior import Outcomes, Posterior
from bayesmembrane.calibration.prior import Mass
from bayesmembrane.calibration.sampling.convergence import effective_draws
from bayesmembrane.calibration.sampling.proposals.collapsed import Collapsed, collapsed
from bayesmembrane.calibration.sampling.proposals.filling import joined
from bayesmembrane.calibration.sampling.proposals.mixture import Mixture, around
from bayesmembrane.calibration.starts import Tried
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.plain import plain
from bayesmembrane.physics.convexity import FREE, MODES, ConvexityMode

WITHIN = "within the range fitted"
ROUNDS, EACH, MOST = 3, 600, 5
"""Proposals that are tried for a mode, draws of each, and how many times as many of all together there are at most."""
CLOSE, ENOUGH = 0.5, 500.0
"""Part of its draws that a proposal is worth when it is as good as it need be, and what all draws are to be worth."""
DRAWN, STARTS = 1000, 128  # draws of the own mode, and candidates, that the first proposal is fitted to
LEAST_ESS, LARGEST_SHARE = 100.0, 0.1  # of the weights that a number may stand on
WIDEST_MASS = 0.3  # standard error of ln mass


class Missing(Enum):
    """Why there is no evidence under a convexity mode."""

    PRIOR = "too few films of the prior meet it"
    DRAWS = "too few draws meet it"
    NONE = "no film near the data meets it"


@dataclass(frozen=True)
class ByMode:
    """ln Z under one convexity mode.

    Attributes
    ----------
    mode : its name
    log_evidence, sd : with the prior renormalised by its mass; None where it cannot be said
    mass, mass_sd : part of the prior that meets it
    ess : how many draws the weights are worth
    missing : None, or why there is no number
    """

    mode: str
    log_evidence: float | None
    sd: float | None
    mass: float
    mass_sd: float
    ess: float
    missing: Missing | None

    def summary(self) -> dict[str, Any]:
        """The numbers as plain values."""
        return dict(plain({n: getattr(self, n) for n in ("mode", "log_evidence", "sd", "mass", "mass_sd", "ess")}))


def by_convexity(
    posterior: Posterior,
    draws: Array,
    own_evidence: tuple[float, float],
    masses: Mapping[str, Mass],
    tried_first: Array,
    seed: int = 0,
) -> tuple[ByMode, ...]:
    """ln Z_m = ln Z_own + ln(sum_b w_b 1_m(x_b) / sum_b w_b 1_own(x_b)) - ln mass_m, w = p0 L / g, x_b from g.

    Parameters
    ----------
    draws : (B, k) of ``posterior``, whose own mode is that of its hypothesis
    own_evidence : ln Z of the same and its standard error, not yet divided by the mass
    masses : of every mode, from `JointPrior.masses`; and of `WITHIN`, if the own mode is also to be judged as if it
        looked no farther than the points that are fitted
    tried_first : (M, k) `candidates` of the posterior

    g is a mixture of proposals, each of t-distributions: one for no convexity, at first fitted to the draws and to
    ``tried_first``, then to its own weighted draws (O. Cappé et al., Stat. Comput. 18 (2008) 447) until they are worth
    half their number; one for the draws; and one for each mode that is met by few of all these. What g has not found
    does not count: weights that rest on few draws give a reason and no number.
    """
    rng = np.random.default_rng([seed, 6])
    own = posterior.hypothesis.convexity
    target = _Target.of(posterior, own if WITHIN in masses else None)
    drawn = target.part(draws[rng.choice(len(draws), min(DRAWN, len(draws)), replace=False)])
    tried = Tried.of(target.free, tried_first, Outcomes())
    starts = target.part(tried.starts(rng, 1, STARTS)[0]) if len(tried.possible.x) else drawn[:0]
    near = around(drawn, rng)
    made = [_adapted(target, around(np.concatenate([drawn, starts]), rng), FREE.name, rng)]
    made.append((near, _weigh(target, near, EACH, rng)))
    for mode in masses:
        most = max((found for _, found in made), key=lambda found: found.ess(mode))
        if target.size + 2 <= most.ess(mode) < LEAST_ESS:
            made.append(_adapted(target, around(most.resampled(mode, EACH, rng), rng), mode, rng))
    useful = [g for g, found in made if found.ess(FREE.name) > 0.0]
    every = _weighed(target, joined([(g, 1) for g in useful or [near]]), masses, rng)
    return tuple(_row((own.name, *own_evidence), mode, every, mass) for mode, mass in masses.items())


@dataclass(frozen=True, eq=False)
class _Target:
    """A posterior without convexity prior, and the mode that is also to be seen within the range fitted.

    Of the ``shape`` alone where modulus and noise can be integrated out, for no mode hangs on them.
    """

    free: Posterior
    within: ConvexityMode | None
    shape: Collapsed | None

    @classmethod
    def of(cls, posterior: Posterior, within: ConvexityMode | None) -> _Target:
        """That of a ``posterior``, whatever its own mode."""
        free = replace(posterior, hypothesis=replace(posterior.hypothesis, convexity=FREE))
        return cls(free, within, collapsed(free))

    @property
    def size(self) -> int:
        return self.free.size if self.shape is None else self.shape.size

    def part(self, x: Array) -> Array:
        """The coordinates that are drawn, of all (B, k)."""
        return x if self.shape is None else self.shape.part(x)

    def solved(self, x: Array) -> tuple[Array, Mapping[str, NDArray[np.bool_]]]:
        """ln p (B,) of no convexity at x (B, m), and which modes they meet; no film without a curve meets one."""
        whole = x if self.shape is None else self.shape.whole(x)
        near = self.free.forward(whole, reached=False)
        ok, lp = near.ok, np.full(len(x), -np.inf)
        inside = {n: np.zeros(len(x), dtype=bool) for n in MODES}
        if np.any(ok):
            with np.errstate(over="ignore", invalid="ignore"):
                lp[ok] = self._density(whole[ok], x[ok], near.force[ok])
            for n, met in self.free.prior.inside_each(self.free.forward, whole[ok]).items():
                inside[n][ok] = met
        if self.within is not None:
            inside[WITHIN] = ok & self.free.prior.inside(near, self.within)
        return np.where(np.isnan(lp), -np.inf, lp), inside

    def _density(self, whole: Array, x: Array, force: Array) -> Array:
        if self.shape is not None:
            return self.shape.given(force / np.exp(whole[:, :1]), x)
        noise = self.free.noise_at(whole, force)
        residual = self.free.measurement.force - force
        log_likelihood = noise.log_likelihood(residual, self.free.hypothesis.noise_coordinates(whole))
        return self.free.prior.log_density(whole) + log_likelihood


@dataclass(frozen=True, eq=False)
class _Weighted:
    """x (B, k) from a mixture, ln of their weights under no convexity (B,), and which modes they meet."""

    x: Array
    log_weight: Array
    inside: Mapping[str, NDArray[np.bool_]]

    def log_weights(self, mode: str) -> Array:
        return np.where(self.inside[mode], self.log_weight, -np.inf)

    def ess(self, mode: str) -> float:
        """What the draws that meet a mode are worth; 0 where none has a weight."""
        w = self.relative(mode)
        return effective_draws(w) if np.any(w) else 0.0

    def relative(self, mode: str) -> Array:
        """Weights (B,), the largest of no convexity being one; none where all are zero."""
        top = np.max(self.log_weight)
        return np.asarray(np.exp(self.log_weights(mode) - (top if np.isfinite(top) else 0.0)))

    def log_mean(self, mode: str) -> float:
        """ln of the mean weight: the integral of p0 L 1_mode."""
        return float(logsumexp(self.log_weights(mode)) - np.log(len(self.x)))

    def and_more(self, more: _Weighted) -> _Weighted:
        """With further draws of the same mixture."""
        inside = {mode: np.concatenate([met, more.inside[mode]]) for mode, met in self.inside.items()}
        return _Weighted(np.concatenate([self.x, more.x]), np.concatenate([self.log_weight, more.log_weight]), inside)

    def resampled(self, mode: str, count: int, rng: np.random.Generator) -> Array:
        w = self.relative(mode)
        # Cut at the root of their number, so that no single draw draws the proposal to itself.
        w = np.minimum(w, np.sqrt(len(w)) * np.mean(w))
        return self.x[rng.choice(len(w), count, p=w / np.sum(w))]


def _weigh(target: _Target, g: Mixture, count: int, rng: np.random.Generator) -> _Weighted:
    x = g.draw(rng, count)
    lp, inside = target.solved(x)
    return _Weighted(x, lp - g.log_density(x), inside)


def _adapted(target: _Target, g: Mixture, mode: str, rng: np.random.Generator) -> tuple[Mixture, _Weighted]:
    """Of a proposal and up to `ROUNDS` - 1 that are fitted to what the one before found of ``mode`` the one whose draws
    are worth most there, and these.
    """
    best = g, _weigh(target, g, EACH, rng)
    found = best[1]
    for _ in range(ROUNDS - 1):
        if not target.size + 2 <= found.ess(mode) < CLOSE * EACH:
            break
        g = around(found.resampled(mode, EACH, rng), rng)
        found = _weigh(target, g, EACH, rng)
        best = max(best, (g, found), key=lambda tried: tried[1].ess(mode))
    return best


def _weighed(target: _Target, g: Mixture, masses: Mapping[str, Mass], rng: np.random.Generator) -> _Weighted:
    """Draws of ``g`` until those that meet each mode are worth enough, or there are `MOST` times `EACH`; modes whose
    mass is not known, and those that no draw of the first met, are not waited for.
    """
    found = _weigh(target, g, EACH, rng)
    awaited = [m for m, mass in masses.items() if mass.sd <= WIDEST_MASS * mass.value and found.ess(m) > 0.0]
    for _ in range(MOST - 1):
        if min((found.ess(mode) for mode in awaited), default=ENOUGH) >= ENOUGH:
            break
        found = found.and_more(_weigh(target, g, EACH, rng))
    return found


def _row(own: tuple[str, float, float], mode: str, found: _Weighted, mass: Mass) -> ByMode:
    """ln Z of ``mode`` from that of the ``own`` one (its name, ln Z and error); ``found`` has draws of both."""
    own_mode, log_evidence, sd = own
    ess = found.ess(mode)
    if mode == own_mode:
        total = float(np.hypot(sd, mass.sd / mass.value))
        return ByMode(mode, log_evidence - float(np.log(mass.value)), total, mass.value, mass.sd, ess, None)
    if mass.sd > WIDEST_MASS * mass.value:
        return ByMode(mode, None, None, mass.value, mass.sd, ess, Missing.PRIOR)
    a, b = found.relative(mode), found.relative(own_mode)
    few = ess < LEAST_ESS or np.max(a) > LARGEST_SHARE * np.sum(a)
    if few or found.ess(own_mode) < LEAST_ESS:
        missing = Missing.DRAWS if np.any(found.inside[mode]) else Missing.NONE
        return ByMode(mode, None, None, mass.value, mass.sd, ess, missing)
    value = log_evidence + found.log_mean(mode) - found.log_mean(own_mode) - float(np.log(mass.value))
    pull = a / np.mean(a) - b / np.mean(b)
    error = float(np.std(pull) / np.sqrt(len(pull)))
    total = float(np.sqrt(error**2 + sd**2 + (mass.sd / mass.value) ** 2))
    return ByMode(mode, value, total, mass.value, mass.sd, ess, None)
