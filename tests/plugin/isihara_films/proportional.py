"""A load cell that errs by a share of what it reads, and never by less than a little."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.parameters import Array, Natural, Parameter
from bayesmembrane.physics.noise.base import LN_SD, SD, Noise, NoiseLikelihood, force_scale

LEAST = 0.2


@dataclass(frozen=True)
class Proportional(Noise):
    """Sigma = Sigma_given + diag(tau^2 (0.2 + 0.8 |y| / max|y|)^2), with tau = exp(ln_sd) max|y|."""

    name: ClassVar[str] = "proportional"
    title: ClassVar[str] = "noise in proportion to the force"

    @property
    def coordinates(self) -> tuple[Parameter, ...]:
        return (LN_SD,)

    @property
    def natural_parameters(self) -> tuple[Natural, ...]:
        return (SD,)

    def natural(self, x: Array, scale: float) -> Array:
        return np.exp(x) * scale

    def bind(self, measurement: Measurement) -> ProportionalLikelihood:
        return ProportionalLikelihood(measurement)


class ProportionalLikelihood(NoiseLikelihood):
    """A sum of squares where points are independent; one Cholesky factor for each draw where they are not."""

    def __init__(self, measurement: Measurement) -> None:
        self.scale = force_scale(measurement)
        self.share = LEAST + (1 - LEAST) * np.abs(measurement.force) / self.scale
        given = measurement.noise_covariance
        self.given = np.zeros((len(measurement),) * 2) if given is None else given
        self.independent = measurement.covariance is None

    def covariance(self, x: Array) -> Array:
        tau = float(np.exp(x[0])) * self.scale
        return np.asarray(self.given + np.diag((tau * self.share) ** 2))

    def log_likelihood(self, residual: Array, x: Array) -> Array:
        if self.independent:
            variance = np.diag(self.given) + (np.exp(x[:, :1]) * self.scale * self.share) ** 2
            return np.asarray(-0.5 * np.sum(residual**2 / variance + np.log(2 * np.pi * variance), axis=1))
        out = np.empty(len(x))
        for b, row in enumerate(x):
            root = np.linalg.cholesky(self.covariance(row))
            z = np.linalg.solve(root, residual[b])
            out[b] = -0.5 * z @ z - np.sum(np.log(np.diag(root))) - 0.5 * z.size * np.log(2 * np.pi)
        return out
