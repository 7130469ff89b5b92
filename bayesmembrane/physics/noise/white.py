"""White noise: every point errs on its own, by the same amount, on top of what the measurement states."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array, Natural, Parameter
from bayesmembrane.ground.symmetric import eigh
from bayesmembrane.physics.noise.base import LN_SD, SD, Noise, NoiseLikelihood, NoiseSpectrum, conditional, force_scale


@dataclass(frozen=True)
class White(Noise):
    """Sigma = Sigma_given + tau^2 I, with tau = exp(ln_sd) max|y|; without ``extra``, Sigma = Sigma_given."""

    extra: bool = True

    name: ClassVar[str] = "white"
    title: ClassVar[str] = "white noise"

    @property
    def coordinates(self) -> tuple[Parameter, ...]:
        return (LN_SD,) if self.extra else ()

    @property
    def natural_parameters(self) -> tuple[Natural, ...]:
        return (SD,) if self.extra else ()

    def natural(self, x: Array, scale: float) -> Array:
        return np.exp(x) * scale

    @property
    def inferred(self) -> bool:
        return self.extra

    @classmethod
    def stated_only(cls) -> White:
        return cls(extra=False)

    def bind(self, measurement: Measurement) -> WhiteLikelihood:
        if not self.extra and measurement.force_sd is None:
            raise SettingsError(
                "without the extra noise term there is no noise at all, since the measurement states none",
                remedy="give force_sd_N in the specimen file, or let the noise be inferred",
            )
        return WhiteLikelihood(measurement, self.extra)


class WhiteLikelihood(NoiseLikelihood):
    """With Sigma_given = Q diag(w) Q^T, found once, a draw costs O(N^2): Sigma = Q diag(w + tau^2) Q^T.

    Independent points need no Q.
    """

    def __init__(self, measurement: Measurement, extra: bool) -> None:
        self.scale, self.extra = force_scale(measurement), extra
        self.axes: Array | None = None
        self.size = len(measurement)
        self.variance = np.zeros(self.size)
        if measurement.covariance is not None:
            self.variance, self.axes = eigh(measurement.covariance)
        elif measurement.force_sd is not None:
            self.variance = measurement.force_sd**2
        if self.axes is None and np.ptp(self.variance) == 0:
            self.variance = self.variance[:1]  # one number is that of all readings

    @property
    def spectrum(self) -> NoiseSpectrum | None:
        return NoiseSpectrum(self.axes, self.variance, self.scale) if self.extra else None

    def along(self, axes: Array) -> NoiseLikelihood | None:
        if self.axes is not None or self.variance.size > 1:
            return None
        return _Alike(self)

    def log_likelihood(self, residual: Array, x: Array) -> Array:
        r = residual if self.axes is None else residual @ self.axes
        variance = self._total(x)
        terms = r * r
        terms /= variance  # in place: of many draws of a long curve these are the largest arrays there are
        terms += np.log(2 * np.pi * variance)
        return np.asarray(-0.5 * np.sum(terms, axis=1))

    def covariance(self, x: Array) -> Array:
        variance = np.broadcast_to(self._total(x[None, :])[0], self.size)
        return np.diag(variance) if self.axes is None else (self.axes * variance) @ self.axes.T

    def pointwise(self, residual: Array, x: Array) -> Array:
        variance = self._total(x)
        if self.axes is None:
            return conditional(residual / variance, 1 / variance)
        pull = (residual @ self.axes / variance) @ self.axes.T
        return conditional(pull, 1 / variance @ (self.axes**2).T)

    def draw(self, x: Array, rng: np.random.Generator) -> Array:
        z = rng.standard_normal((len(x), self.size)) * np.sqrt(self._total(x))
        return z if self.axes is None else np.asarray(z @ self.axes.T)

    def sd(self, x: Array) -> Array:
        variance = self._total(x)
        if self.axes is None:
            return np.broadcast_to(np.sqrt(variance), (len(x), self.size))
        return np.sqrt(variance @ (self.axes**2).T)

    def _total(self, x: Array) -> Array:
        """Variances (B, N) along the axes, or (B, 1) of all readings; never below what a double can hold."""
        tau = np.exp(x[:, :1]) * self.scale if self.extra else np.zeros((len(x), 1))
        return np.maximum(self.variance + tau * tau, 1e-300)


class _Alike(NoiseLikelihood):
    """White noise of one size for all N readings, of residuals told by R coordinates: a rotation changes no square."""

    def __init__(self, whole: WhiteLikelihood) -> None:
        self.whole = whole

    def log_likelihood(self, residual: Array, x: Array) -> Array:
        variance = self._variance(x)
        square = np.einsum("br,br->b", residual, residual)
        return np.asarray(-0.5 * (square / variance + self.whole.size * np.log(2 * np.pi * variance)))

    def covariance(self, x: Array) -> Array:
        return np.asarray(self._variance(x[None, :])[0] * np.eye(self.whole.size))

    def _variance(self, x: Array) -> Array:
        tau = np.exp(x[:, 0]) * self.whole.scale if self.whole.extra else np.zeros(len(x))
        return np.asarray(np.maximum(self.whole.variance[0] + tau * tau, 1e-300))
