"""Noise that remembers: an autoregressive process of first order along the order of measurement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.compiling import compiled
from bayesmembrane.ground.parameters import Array, Natural, Normal, Parameter
from bayesmembrane.physics.noise.base import LN_SD, SD, Noise, NoiseLikelihood, conditional, force_scale, root_of

LN_LENGTH = Parameter(
    "ln_length",
    "-",
    "log of the correlation length, in median steps of the measurement",
    Normal(0.0, 1.5),
    (-5.0, 8.0),
)
SHORTEST = 1e-3
"""Points closer than this part of the median step are kept apart, so that two equal ones do not make Sigma singular."""


@dataclass(frozen=True)
class AR1(Noise):
    """Sigma_ij = Sigma_given_ij + tau^2 exp(-|s_i - s_j| / length), with rho = exp(-1/length).

    s counts median steps along the order of measurement: elapsed time, or without times the distance that the disc has
    travelled, over its median step; evenly spaced points have the correlation rho^|i - j|. The noise that remembers is
    always inferred: without it this model would be `White`.
    """

    name: ClassVar[str] = "ar1"
    title: ClassVar[str] = "noise that remembers, AR(1)"

    @property
    def coordinates(self) -> tuple[Parameter, ...]:
        return (LN_SD, LN_LENGTH)

    @property
    def natural_parameters(self) -> tuple[Natural, ...]:
        return (SD, Natural("rho", "-", "correlation of neighbours that are one median step apart"))

    def natural(self, x: Array, scale: float) -> Array:
        return np.stack([np.exp(x[:, 0]) * scale, np.exp(-np.exp(-x[:, 1]))], axis=1)

    def bind(self, measurement: Measurement) -> AR1Likelihood:
        return AR1Likelihood(measurement)


class AR1Likelihood(NoiseLikelihood):
    """O(N) by a Kalman filter where the points' own noise is independent, else one Cholesky factor for each draw.

    gap : (N - 1,) steps between neighbours by the noise's clock; else those of `AR1`
    """

    def __init__(self, measurement: Measurement, gap: Array | None = None) -> None:
        self.scale = force_scale(measurement)
        self.gap = gaps_of(measurement) if gap is None else gap
        self.given = measurement.covariance
        n = len(measurement)
        self.variance = np.zeros(n) if measurement.force_sd is None else measurement.force_sd**2
        place = np.concatenate([[0.0], np.cumsum(self.gap)])
        self.distance = np.abs(place[:, None] - place[None, :])

    def log_likelihood(self, residual: Array, x: Array) -> Array:
        tau = np.exp(x[:, 0]) * self.scale
        rate = np.exp(-x[:, 1])
        if self.given is None:
            r = np.ascontiguousarray(residual, dtype=float)
            return np.asarray(_filter(r, tau * tau, rate, self.gap, self.variance))
        sigma = self.given + (tau * tau)[:, None, None] * np.exp(-rate[:, None, None] * self.distance)
        root = root_of(sigma)
        z = np.linalg.solve(root, residual[:, :, None])[:, :, 0]
        log_det = np.sum(np.log(np.diagonal(root, axis1=1, axis2=2)), axis=1)
        return np.asarray(-0.5 * np.sum(z * z, axis=1) - log_det - 0.5 * self.variance.size * np.log(2 * np.pi))

    def pointwise(self, residual: Array, x: Array) -> Array:
        if self.given is not None or np.any(self.variance):
            return super().pointwise(residual, x)
        # Without noise of the points' own, u is a Markov chain: its precision has three diagonals.
        power = (np.exp(x[:, 0]) * self.scale)[:, None] ** 2
        phi = np.exp(-np.exp(-x[:, 1])[:, None] * self.gap)
        link = phi / (1 - phi**2)
        diagonal = np.ones_like(residual)
        diagonal[:, 1:] += phi * link
        diagonal[:, :-1] += phi * link
        weighted = diagonal * residual
        weighted[:, 1:] -= link * residual[:, :-1]
        weighted[:, :-1] -= link * residual[:, 1:]
        return conditional(weighted / power, diagonal / power)

    def draw(self, x: Array, rng: np.random.Generator) -> Array:
        if self.given is not None or np.any(self.variance):
            return super().draw(x, rng)
        phi = np.exp(-np.exp(-x[:, 1])[:, None] * self.gap)
        out = rng.standard_normal((len(x), self.variance.size))
        for i in range(1, self.variance.size):
            out[:, i] = phi[:, i - 1] * out[:, i - 1] + np.sqrt(1 - phi[:, i - 1] ** 2) * out[:, i]
        return out * (np.exp(x[:, 0]) * self.scale)[:, None]

    def sd(self, x: Array) -> Array:
        return np.asarray(np.sqrt(self.variance + (np.exp(x[:, :1]) * self.scale) ** 2))

    def covariance(self, x: Array) -> Array:
        tau = float(np.exp(x[0])) * self.scale
        given = np.diag(self.variance) if self.given is None else self.given
        return np.asarray(given + tau**2 * np.exp(-np.exp(-x[1]) * self.distance))


@compiled(error_model="numpy")
def _filter(residual, power, rate, gap, own):  # type: ignore[no-untyped-def]
    """State u with variance ``power`` and u_i = phi_i u_(i-1) + ..., observed as r_i = u_i + own noise."""
    out = np.empty(len(residual))
    for b in range(len(residual)):
        mean, variance, total = 0.0, power[b], 0.0
        for i in range(residual.shape[1]):
            if i > 0:
                f = np.exp(-rate[b] * gap[i - 1])
                mean, variance = f * mean, power[b] + f * f * (variance - power[b])
            s = variance + own[i]
            e = residual[b, i] - mean
            total -= 0.5 * (e * e / s + np.log(2 * np.pi * s))
            gain = variance / s
            mean, variance = mean + gain * e, variance * (1 - gain)
        out[b] = total
    return out


def gaps_of(measurement: Measurement, clock: str = "time") -> Array:
    """(N - 1,) steps between points relative to their median: of time, or else of the distance travelled.

    By the clock "readings" every step is 1.
    """
    if clock == "readings":
        return np.ones(max(len(measurement) - 1, 0))
    place = measurement.deflection if measurement.time is None else measurement.time
    gap = np.abs(np.diff(place))
    if gap.size == 0 or np.median(gap) == 0:
        return np.ones(gap.size)
    return np.asarray(np.maximum(gap / np.median(gap), SHORTEST))
