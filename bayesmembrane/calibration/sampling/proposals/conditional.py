"""Modulus and noise given the curve of a film of unit modulus: their integral, and draws with a known density."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from bayesmembrane.calibration.sampling.proposals.marginal import LEAST, integrated, peaks
from bayesmembrane.ground.parameters import Array, Normal

NODES, FEW_NODES = 32, 16
"""Of the density of ln_sd, and of its integral alone, which needs fewer."""
PRIOR_SHARE = 0.02
"""Weight of each prior beside the conditional that is drawn from: it bounds what is left to be weighed."""

Inverse = Callable[[Array], Array]
"""u (B,) in (0, 1) -> quantiles (B,)."""


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

    def given(self) -> Given:
        """Modulus and noise given f."""
        return Given(*self._integrated(NODES)[1:], self)

    def modulus_at(self, ln_sd: Array) -> tuple[Array, Array]:
        """Where ln p(ln_gd | ln_sd, f) is largest, and the standard deviation of the normal that has its bend; (B,)."""
        tau = self.scale * np.exp(ln_sd)
        weight = 1 / np.maximum(self.variance + (tau * tau)[:, None], LEAST)
        pull, stiff = np.sum(self.ya * weight, axis=1), np.sum(self.aa * weight, axis=1)
        t, bend = peaks(pull, stiff, self.modulus.mean, self.modulus.sd)
        return t, 1 / np.sqrt(bend)

    def _integrated(self, nodes: int) -> tuple[Array, Array, Array, Array]:
        priors = np.array([self.modulus.mean, self.modulus.sd, self.noise.mean, self.noise.sd, self.scale])
        found: tuple[Array, Array, Array, Array] = integrated(
            (self.variance, self.count, self.yy), self.ya, self.aa, priors, nodes
        )
        return found


@dataclass(frozen=True, eq=False)
class Given:
    """q(ln_gd, ln_sd | f) = q(ln_sd | f) q(ln_gd | ln_sd, f) of B curves, close to the conditional posterior.

    The first is linear between equally spaced nodes, the second a normal around the largest value; both have a part
    `PRIOR_SHARE` of the prior beside them.

    first, step : (B,) the first node of ln_sd, and how far apart they are
    density : (B, NODES) at the nodes, normalised
    residuals : of the curves
    """

    first: Array
    step: Array
    density: Array
    residuals: Residuals

    def drawn(self, u: Array) -> tuple[Array, Array]:
        """(ln_gd, ln_sd) (B,) by inversion of uniform numbers u (B, 2)."""
        r = self.residuals
        ln_sd = _beside(r.noise, u[:, 0], self._inverted)
        centre, sd = r.modulus_at(ln_sd)
        return _beside(r.modulus, u[:, 1], lambda part: centre + sd * ndtri(part)), ln_sd

    def log_density(self, ln_gd: Array, ln_sd: Array) -> Array:
        """ln q(ln_gd, ln_sd), (B,)."""
        r = self.residuals
        centre, sd = r.modulus_at(ln_sd)
        z = (ln_gd - centre) / sd
        with np.errstate(divide="ignore"):
            noise = _mixed(r.noise, ln_sd, np.log(self._near(ln_sd)))
        return noise + _mixed(r.modulus, ln_gd, -0.5 * z * z - np.log(sd * np.sqrt(2 * np.pi)))

    def _near(self, ln_sd: Array) -> Array:
        """(B,) the piecewise linear density at ln_sd."""
        place = (ln_sd - self.first) / self.step
        at, rows = np.clip(place.astype(int), 0, NODES - 2), np.arange(len(place))
        low, high = self.density[rows, at], self.density[rows, at + 1]
        return np.where((place >= 0) & (place <= NODES - 1), low + (place - at) * (high - low), 0.0)

    def _inverted(self, u: Array) -> Array:
        """Where the piecewise linear density has u (B,) of its mass below."""
        density, step, rows = self.density, self.step, np.arange(len(u))
        mass = np.cumsum(0.5 * (density[:, 1:] + density[:, :-1]) * step[:, None], axis=1)
        u = u * mass[:, -1]
        at = np.minimum(np.sum(mass < u[:, None], axis=1), NODES - 2)
        left = u - np.where(at > 0, mass[rows, at - 1], 0.0)
        low = density[rows, at]
        rise = (density[rows, at + 1] - low) / step
        # low s + rise s^2 / 2 = left, in the form that does not cancel.
        root = low + np.sqrt(np.maximum(low * low + 2 * rise * left, 0.0))
        s = np.where(root > 0, 2 * left / np.maximum(root, LEAST), 0.0)
        return np.asarray(self.first + step * at + np.clip(s, 0.0, step))


def _beside(prior: Normal, u: Array, inverse: Inverse) -> Array:
    """Quantiles at u (B,) of ``prior`` with the weight `PRIOR_SHARE` and of what has the ``inverse`` with the rest."""
    part = (u - PRIOR_SHARE) / (1 - PRIOR_SHARE)
    wide = prior.mean + prior.sd * ndtri(np.minimum(u / PRIOR_SHARE, 1 - 1e-16))
    return np.where(part < 0, wide, inverse(np.clip(part, 1e-16, 1 - 1e-16)))


def _mixed(prior: Normal, x: Array, log_near: Array) -> Array:
    """ln of the density whose quantiles are `_beside`, at x (B,)."""
    wide = np.log(PRIOR_SHARE) + prior.log_density(x)
    return np.asarray(np.logaddexp(np.log1p(-PRIOR_SHARE) + log_near, wide))
