"""Modulus and noise given the curve of a film of unit modulus: their integral, and draws with a known density."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from bayesmembrane.calibration.sampling.proposals.marginal import LEAST, integrated, of_modulus
from bayesmembrane.ground.parameters import Array, Normal

NODES, FEW_NODES = 32, 16
"""Of a density of ln_gd or ln_sd, and of an integral over ln_sd alone, which needs fewer."""
PRIOR_SHARE = 0.02
"""Weight of each prior beside the conditional that is drawn from: it bounds what is left to be weighed."""
TINY = 1e-15  # of a probability


@dataclass(frozen=True, eq=False)
class Residuals:
    """y - Gd f of B curves f, by groups of readings that are weighed alike, as `marginal` has them.

    variance, count, yy : (G,) of each group N^2, how many readings, and sum of y^2
    ya, aa : (B, G) sums of y f and of f^2
    scale : N, tau = scale exp(ln_sd)
    modulus, noise : priors of ln_gd and ln_sd
    """

    variance: Array
    count: Array
    yy: Array
    ya: Array
    aa: Array
    scale: float
    modulus: Normal
    noise: Normal

    def log_likelihood(self) -> Array:
        """(B,) ln p(y | f), modulus and noise integrated out."""
        return self._integrated(FEW_NODES)[0]

    def given(self) -> GivenShape:
        """Modulus and noise given f."""
        return GivenShape(PiecewiseLinear(*self._integrated(NODES)[1:]), self)

    def modulus_at(self, ln_sd: Array) -> PiecewiseLinear:
        """p(ln_gd | ln_sd, f) of each ln_sd (B,)."""
        tau = self.scale * np.exp(ln_sd)
        weight = 1 / np.maximum(self.variance + (tau * tau)[:, None], LEAST)
        pull, stiff = np.sum(self.ya * weight, axis=1), np.sum(self.aa * weight, axis=1)
        return PiecewiseLinear(*of_modulus(pull, stiff, self.modulus.mean, self.modulus.sd, NODES))

    def _integrated(self, nodes: int) -> tuple[Array, Array, Array, Array]:
        priors = np.array([self.modulus.mean, self.modulus.sd, self.noise.mean, self.noise.sd, self.scale])
        found: tuple[Array, Array, Array, Array] = integrated(
            (self.variance, self.count, self.yy), self.ya, self.aa, priors, nodes
        )
        return found


@dataclass(frozen=True, eq=False)
class PiecewiseLinear:
    """B densities of one number each, linear between n equally spaced nodes, and zero beyond them.

    first, step : (B,) the first node, and how far apart they are
    density : (B, n) at the nodes, normalised
    """

    first: Array
    step: Array
    density: Array

    def at(self, x: Array) -> Array:
        """(B,) the densities at x (B,)."""
        last = self.density.shape[1] - 1
        place = (x - self.first) / self.step
        inside = (place >= 0) & (place <= last)
        at, rows = np.clip(np.where(inside, place, 0.0).astype(int), 0, last - 1), np.arange(len(place))
        low, high = self.density[rows, at], self.density[rows, at + 1]
        return np.where(inside, low + (place - at) * (high - low), 0.0)

    def quantile(self, u: Array) -> Array:
        """Where they have u (B,) of their mass below."""
        density, step, rows = self.density, self.step, np.arange(len(u))
        mass = np.cumsum(0.5 * (density[:, 1:] + density[:, :-1]) * step[:, None], axis=1)
        u = u * mass[:, -1]
        at = np.minimum(np.sum(mass < u[:, None], axis=1), mass.shape[1] - 1)
        left = u - np.where(at > 0, mass[rows, at - 1], 0.0)
        low = density[rows, at]
        rise = (density[rows, at + 1] - low) / step
        # low s + rise s^2 / 2 = left, in the form that does not cancel.
        root = low + np.sqrt(np.maximum(low * low + 2 * rise * left, 0.0))
        s = np.where(root > 0, 2 * left / np.maximum(root, LEAST), 0.0)
        return np.asarray(self.first + step * at + np.clip(s, 0.0, step))


@dataclass(frozen=True, eq=False)
class GivenShape:
    """q(ln_gd, ln_sd | f) = q(ln_sd | f) q(ln_gd | ln_sd, f) of B curves, close to the conditional posterior.

    Both are linear between nodes where the posterior is, and have a part `PRIOR_SHARE` of the prior beside that.
    """

    noise: PiecewiseLinear
    residuals: Residuals

    def drawn(self, u: Array) -> tuple[Array, Array]:
        """(ln_gd, ln_sd) (B,) by inversion of uniform numbers u (B, 2)."""
        ln_sd = _quantile(self.noise, self.residuals.noise, u[:, 0])
        return _quantile(self.residuals.modulus_at(ln_sd), self.residuals.modulus, u[:, 1]), ln_sd

    def log_density(self, ln_gd: Array, ln_sd: Array) -> Array:
        """ln q(ln_gd, ln_sd), (B,)."""
        noise = _log_density(self.noise, self.residuals.noise, ln_sd)
        return noise + _log_density(self.residuals.modulus_at(ln_sd), self.residuals.modulus, ln_gd)


def _quantile(near: PiecewiseLinear, prior: Normal, u: Array) -> Array:
    """Quantiles at u (B,) of ``prior``, with the weight `PRIOR_SHARE`, beside ``near``."""
    part = (u - PRIOR_SHARE) / (1 - PRIOR_SHARE)
    wide = prior.mean + prior.sd * ndtri(np.clip(u / PRIOR_SHARE, TINY, 1 - TINY))
    return np.where(part < 0, wide, near.quantile(np.clip(part, TINY, 1 - TINY)))


def _log_density(near: PiecewiseLinear, prior: Normal, x: Array) -> Array:
    """ln of the density that `_quantile` inverts, at x (B,)."""
    wide = np.exp(prior.log_density(x))
    with np.errstate(divide="ignore"):
        return np.asarray(np.log((1 - PRIOR_SHARE) * near.at(x) + PRIOR_SHARE * wide))
