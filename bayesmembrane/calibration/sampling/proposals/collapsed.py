"""The posterior of the shape of a curve alone: modulus and noise are integrated out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.calibration.posterior import Evaluation, Outcome, Posterior
from bayesmembrane.calibration.sampling.proposals.bend import Bend
from bayesmembrane.calibration.sampling.proposals.conditional import Residuals
from bayesmembrane.calibration.sampling.proposals.scores import Scores
from bayesmembrane.ground.parameters import Array, Normal
from bayesmembrane.physics.forward import AT_ONCE
from bayesmembrane.physics.noise.base import NoiseSpectrum

GROUPS = 16
"""Distinct variances of readings, for each coordinate that is left, beyond which integrating costs more than it saves:
with 60 Gent took 1.2 s of a processor instead of 0.8, with 10 and 2 coordinates more Yeoh 2.0 instead of 3.3."""


@dataclass(frozen=True, eq=False)
class Collapsed:
    """p(s | y) = int int p(ln_gd, s, ln_sd | y) d ln_gd d ln_sd of the coordinates s (k - 2,) between the two.

    They are told by normal scores (`Scores`), with a ``bend`` by those straightened. Forces are proportional to the
    modulus, F = Gd f(s), with effects that leave them so, too, and whether a film is convex does not hang on it.
    """

    posterior: Posterior
    spectrum: NoiseSpectrum
    bend: Bend | None = None

    @property
    def size(self) -> int:
        """k - 2, how many coordinates are left."""
        return self.posterior.size - 2

    @property
    def readings(self) -> int:
        return self.posterior.readings

    def evaluate(self, s: Array) -> Evaluation:
        """Of shapes s (B, k - 2): prior, likelihood with modulus and noise integrated out, and curves for Gd = 1.

        Films whose forces are too large to be squared weigh nothing.
        """
        found = self.posterior.evaluate(self.whole(s))
        ok = np.isfinite(found.log_posterior)
        force, log_likelihood = found.force / np.exp(self.modulus.mean), np.full(len(s), -np.inf)
        with np.errstate(over="ignore", invalid="ignore"):
            log_likelihood[ok] = self.residuals(force[ok]).log_likelihood()
        ok &= np.isfinite(log_likelihood)
        log_likelihood[~ok] = -np.inf
        return Evaluation(np.where(ok, self.log_prior(s), -np.inf), log_likelihood, found.outcome, force)

    def remember(self, x: Array, force: Array) -> None:
        """Curves (B, N) for Gd = 1 of films x (B, k) that are possible, for `at`; as long as they are not too many."""
        known = self.posterior.unit_curves
        if (len(known) + len(x)) * self.readings <= AT_ONCE:
            known.update(zip(_shapes(x), force, strict=True))

    def remembered(self, x: Array) -> tuple[Array, NDArray[np.bool_]]:
        """(curves for Gd = 1 of films x (B, k), nan where they are not remembered, True for those)."""
        kept = [self.posterior.unit_curves.get(key) for key in _shapes(x)]
        new, force = np.array([f is None for f in kept], dtype=bool), np.full((len(x), self.readings), np.nan)
        if not np.all(new):
            force[~new] = np.stack([f for f in kept if f is not None])
        return force, new

    def at(self, x: Array) -> Evaluation:
        """As `Posterior.evaluate` of x (B, k), from curves for Gd = 1: those that are remembered are not solved again.

        The same to round-off whether they are. Films that are not possible have no likelihood.
        """
        force, new = self.remembered(x)
        outcome = np.full(len(x), Outcome.OK, dtype=np.int8)
        log_prior, log_likelihood = self.posterior.prior.log_density(x), np.full(len(x), -np.inf)
        if np.any(new):
            unit = x[new]
            unit[:, 0], unit[:, -1] = self.modulus.mean, self.noise.mean
            found = self.posterior.evaluate(unit)
            force[new], outcome[new] = found.force / np.exp(self.modulus.mean), found.outcome
            log_prior[new] = np.where(np.isfinite(found.log_prior), log_prior[new], -np.inf)
        force *= np.exp(x[:, :1])
        ok = outcome == Outcome.OK
        log_likelihood[ok] = self.posterior.likelihood_given(force[ok], x[ok])
        return Evaluation(log_prior, log_likelihood, outcome, force)

    def given(self, curves: Array, s: Array) -> Array:
        """(B,) ln p0(s) + ln p(y | s) if s (B, k - 2) had the ``curves`` (B, N) for Gd = 1."""
        total = self.log_prior(s) + self.residuals(curves).log_likelihood()
        return np.asarray(np.where(np.isnan(total), -np.inf, total))

    def log_prior(self, s: Array) -> Array:
        """ln p0(s), (B,)."""
        return self.scores.log_prior(s)

    def part(self, x: Array) -> Array:
        """(B, k - 2) the shapes s of x (B, k)."""
        return self.scores.of(x[:, 1:-1])

    def whole(self, s: Array) -> Array:
        """(B, k) all coordinates of shapes s (B, k - 2), modulus and noise at the medians of their priors."""
        x = np.empty((len(s), self.posterior.size))
        x[:, 0], x[:, 1:-1], x[:, -1] = self.modulus.mean, self.scores.back(s), self.noise.mean
        return x

    @cached_property
    def scores(self) -> Scores:
        """Of the coordinates between modulus and noise."""
        return Scores(tuple(p.prior for p in self.posterior.hypothesis.parameters[1:-1]), self.bend)

    def bent(self, bend: Bend | None) -> Collapsed:
        """The same in the coordinates of a bend of the scores."""
        return replace(self, bend=bend)

    def residuals(self, curves: Array) -> Residuals:
        """Of ``curves`` (B, N) for Gd = 1."""
        axes, (one, variance, count) = self.spectrum.axes, self._groups
        f, y = (curves, self.posterior.measured) if axes is None else (curves @ axes, self.posterior.measured @ axes)
        sums = ((f * y) @ one, (f * f) @ one)
        return Residuals(variance, count, (y * y) @ one, *sums, self.spectrum.scale, self.modulus, self.noise)

    @cached_property
    def _groups(self) -> tuple[Array, Array, Array]:
        """Which readings are weighed alike (N, G), and of each group (G,) variance and number of readings."""
        variance, group = _alike(self.spectrum.variance, self.posterior.readings)
        one = np.zeros((group.size, variance.size))
        one[np.arange(group.size), group] = 1.0
        # A long curve is told by fewer numbers than it has readings, and all of those are weighed alike.
        count = np.sum(one, axis=0) if variance.size > 1 else np.array([float(len(self.posterior.measurement))])
        return one, variance, count

    @cached_property
    def modulus(self) -> Normal:
        """The prior of ln_gd."""
        prior = self.posterior.hypothesis.parameters[0].prior
        assert isinstance(prior, Normal)
        return prior

    @cached_property
    def noise(self) -> Normal:
        """The prior of ln_sd."""
        prior = self.posterior.hypothesis.parameters[-1].prior
        assert isinstance(prior, Normal)
        return prior


def collapsed(posterior: object) -> Collapsed | None:
    """The posterior of the shape alone, of energy and effects; None where forces are not proportional to a modulus that
    is sampled, noise is more than one size, or no coordinate would be left.
    """
    if not isinstance(posterior, Posterior):
        return None
    claim, spectrum = posterior.hypothesis, posterior.noise.spectrum
    left = posterior.size - 2
    if spectrum is None or left < 1 or not posterior.forward.rig.reads_force:
        return None
    if not all(e.scales_with_modulus for e in claim.effects):
        return None
    if not all(type(p.prior) is Normal for p in (claim.parameters[0], claim.parameters[-1])):
        return None
    few = _alike(spectrum.variance, posterior.readings)[0].size <= GROUPS * left
    return Collapsed(posterior, spectrum) if few else None


def _shapes(x: Array) -> list[bytes]:
    """What tells the shapes of films x (B, k) apart: their coordinates, digit by digit."""
    return [row.tobytes() for row in np.ascontiguousarray(x[:, 1:-1])]


def _alike(variance: Array, readings: int) -> tuple[Array, NDArray[np.intp]]:
    """Distinct values (G,) of a variance (N,) or (1,) of all, and which of them each of N readings has (N,)."""
    distinct, group = np.unique(variance, return_inverse=True)
    return distinct, np.broadcast_to(group, (readings,))
