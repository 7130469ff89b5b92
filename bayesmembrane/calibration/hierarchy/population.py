"""Partial pooling: the mean and the scatter of a population of specimens, and what the next specimen will be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bayesmembrane.calibration.hierarchy.specimens import LN_MODULUS, Specimens
from bayesmembrane.calibration.outcome import marginal
from bayesmembrane.calibration.sampling.convergence import effective_draws
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.showable import Showable
from bayesmembrane.ground.symmetric import eigh

if TYPE_CHECKING:
    from bayesmembrane.calibration.hierarchy.next_curve import NextCurve

WIDE = 0.25
"""Scale of the half-normal prior on the scatter of a coordinate, in standard deviations of the coordinate's prior:
0.5 for ln(modulus), so that specimens of one rubber may well differ by half."""
ROUNDS, TRIED, KEPT = 5, 4096, 4000
FROM_PRIOR, DEGREES = 0.1, 4  # part of the proposals that stay with the prior; degrees of freedom of the others
ENOUGH = 400.0  # effective draws at least


@dataclass(frozen=True, eq=False, repr=False)
class Population(Showable):
    """theta_j ~ N(mu, diag(tau)^2) behind specimens j.

    Attributes
    ----------
    specimens : what each says by itself
    mean, scatter : (D, q) draws of mu and tau
    following : (D, q) draws of theta of a specimen that nobody has tested
    own : (D, J, q) draws of theta_j, drawn towards the others as far as they are alike
    effective : how many independent draws these are worth
    next_curve : the force curve of the next specimen, where the population is one of runs (`NextCurve`)
    """

    specimens: Specimens
    mean: Array
    scatter: Array
    following: Array
    own: Array
    effective: float
    next_curve: NextCurve | None = None

    def summary(self) -> dict[str, Any]:
        """Plain values of the JSON answer of ``population``."""
        s = self.specimens
        parameters = {}
        for i, name in enumerate(s.names):
            parameters[name] = {
                "mean": marginal(self.mean[:, i]),
                "scatter": marginal(self.scatter[:, i]),
                "next": marginal(self.following[:, i]),
                "scatter_prior_scale": float(WIDE * s.spread[i]),
                "specimens": {
                    label: {
                        "alone": {"mean": float(s.values[j, i]), "sd": float(np.sqrt(s.covariances[j, i, i]))},
                        "pooled": marginal(self.own[:, j, i]),
                    }
                    for j, label in enumerate(s.labels)
                },
            }
        answer: dict[str, Any] = {
            "specimens": list(s.labels),
            "parameters": parameters,
            "effective_draws": self.effective,
            "skewed": list(s.skewed),
        }
        if LN_MODULUS in s.names:
            answer["modulus_MPa"] = self.modulus()
        if self.next_curve is not None:
            answer["next_curve"] = self.next_curve.summary()
        return answer

    def modulus(self) -> dict[str, Any]:
        """The shear modulus in MPa: of a middling specimen, of the next one, and the scatter between specimens."""
        i = self.specimens.names.index(LN_MODULUS)
        middle = 1e-6 * np.exp(self.mean[:, i])
        return {
            "mean": marginal(middle),
            "scatter": marginal(
                middle * np.sqrt(np.expm1(self.scatter[:, i] ** 2)) * np.exp(0.5 * self.scatter[:, i] ** 2)
            ),
            "next": marginal(1e-6 * np.exp(self.following[:, i])),
        }


def population(specimens: Specimens, seed: int = 0, draws: int = KEPT) -> Population:
    """p(mu, tau | z) with z_j ~ N(mu, diag(tau)^2 + S_j), mu ~ N(centre, spread^2), tau_i ~ half-normal(spread_i / 4).

    For a given tau all else is normal: mu is integrated out, and drawn afterwards, as the specimens' own values are.
    tau is drawn by importance sampling in ln tau from a t-distribution that is fitted to the weighted draws, round by
    round, beside one part of the prior; draws are then taken with their weights. No chain has to converge.
    A. Gelman, Bayesian Anal. 1 (2006) 515, on the prior of tau.

    Raises `SettingsError` if the draws are worth too little, as with contradictory numbers.
    """
    rng = np.random.default_rng([seed, 21])
    scale = WIDE * specimens.spread
    log_tau = np.log(np.abs(rng.standard_normal((TRIED, scale.size))) * scale)
    weights = _weights(specimens, log_tau, scale, None)
    for _ in range(ROUNDS):
        proposal = _fitted(log_tau, weights)
        log_tau = _proposed(proposal, scale, rng)
        weights = _weights(specimens, log_tau, scale, proposal)
    effective = effective_draws(weights)
    if effective < ENOUGH:
        raise SettingsError(
            f"the scatter of the specimens is known from {effective:.0f} effective draws only",
            remedy="pool fewer coordinates, or give more specimens",
        )
    tau = np.exp(log_tau[rng.choice(len(weights), size=draws, p=weights / np.sum(weights))])
    mean = _means(specimens, tau, rng)
    following = mean + tau * rng.standard_normal(tau.shape)
    return Population(specimens, mean, tau, following, _own(specimens, mean, tau, rng), effective)


# ---- given the scatter, all is normal --------------------------------------------------------------------------------


def _gathered(s: Specimens, tau: Array) -> tuple[Array, Array, Array]:
    """Precision (B, q, q) and right-hand side (B, q) of mu given tau (B, q), and ln p(z | tau) (B,)."""
    q = tau.shape[1]
    precision = np.tile(np.diag(s.spread**-2.0), (len(tau), 1, 1))
    right = np.tile(s.centre / s.spread**2, (len(tau), 1))
    log_p = np.full(len(tau), -0.5 * float(np.sum((s.centre / s.spread) ** 2)) - float(np.sum(np.log(s.spread))))
    wide = tau[:, :, None] ** 2 * np.eye(q)
    for z, covariance in zip(s.values, s.covariances, strict=True):
        total = wide + covariance
        inverse = np.linalg.inv(total)
        pull = inverse @ z
        precision += inverse
        right += pull
        log_p -= 0.5 * (pull @ z + np.linalg.slogdet(total)[1])
    log_p += 0.5 * np.einsum("bi,bi->b", right, np.linalg.solve(precision, right[:, :, None])[:, :, 0])
    log_p -= 0.5 * np.linalg.slogdet(precision)[1]
    return precision, right, log_p


def _means(s: Specimens, tau: Array, rng: np.random.Generator) -> Array:
    """Draws (B, q) of mu given tau."""
    precision, right, _ = _gathered(s, tau)
    centre = np.asarray(np.linalg.solve(precision, right[:, :, None])[:, :, 0])
    return _normal(centre, np.asarray(np.linalg.inv(precision)), rng)


def _own(s: Specimens, mean: Array, tau: Array, rng: np.random.Generator) -> Array:
    """Draws (B, J, q) of every theta_j given mu and tau: mu + K (z - mu) with K = T (T + S)^-1."""
    wide = tau[:, :, None] ** 2 * np.eye(tau.shape[1])
    found = []
    for z, covariance in zip(s.values, s.covariances, strict=True):
        gain = wide @ np.linalg.inv(wide + covariance)
        centre = mean + np.einsum("bij,bj->bi", gain, z - mean)
        found.append(_normal(centre, wide - gain @ wide, rng))
    return np.stack(found, axis=1)


def _normal(mean: Array, covariance: Array, rng: np.random.Generator) -> Array:
    """One draw of N(mean, covariance) for each row; the covariance may be singular."""
    values, vectors = eigh(0.5 * (covariance + np.swapaxes(covariance, 1, 2)))
    z = np.sqrt(np.maximum(values, 0.0)) * rng.standard_normal(mean.shape)
    return np.asarray(mean + np.einsum("bij,bj->bi", vectors, z))


# ---- the scatter -----------------------------------------------------------------------------------------------------


def _weights(s: Specimens, log_tau: Array, scale: Array, proposal: tuple[Array, Array] | None) -> Array:
    """(B,) p(tau | z) over the density from which ``log_tau`` (B, q) was drawn, the largest one."""
    from scipy import stats  # on demand: it takes a second

    prior = _log_prior(log_tau, scale)
    log_p = _gathered(s, np.exp(log_tau))[2]
    if proposal is None:
        drawn = prior
    else:
        near = np.atleast_1d(stats.multivariate_t(*proposal, df=DEGREES).logpdf(log_tau))
        drawn = np.logaddexp(np.log(FROM_PRIOR) + prior, np.log1p(-FROM_PRIOR) + near)
    log_w = prior + log_p - drawn
    return np.asarray(np.exp(log_w - np.max(log_w)))


def _log_prior(log_tau: Array, scale: Array) -> Array:
    """(B,) ln density of ln tau where tau_i is half-normal."""
    from scipy import stats

    density = stats.halfnorm(scale=scale).logpdf(np.exp(log_tau)) + log_tau
    return np.asarray(np.sum(density, axis=1))


def _fitted(log_tau: Array, weights: Array) -> tuple[Array, Array]:
    """(centre (q,), shape (q, q)) of what the weighted draws say, a little wider."""
    w = weights / np.sum(weights)
    centre = w @ log_tau
    apart = log_tau - centre
    shape = (apart * w[:, None]).T @ apart + 1e-6 * np.eye(len(centre))
    return centre, shape


def _proposed(proposal: tuple[Array, Array], scale: Array, rng: np.random.Generator) -> Array:
    from scipy import stats

    near = np.reshape(stats.multivariate_t(*proposal, df=DEGREES, seed=rng).rvs(TRIED), (TRIED, -1))
    far = np.log(np.abs(rng.standard_normal((TRIED, scale.size))) * scale)
    return np.where(rng.random((TRIED, 1)) < FROM_PRIOR, far, near)
