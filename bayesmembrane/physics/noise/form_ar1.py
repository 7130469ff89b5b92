"""Noise that remembers, and smooth relative errors of the energy and of the laws of effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.linalg import solve_triangular

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.parameters import Array, Natural, Parameter
from bayesmembrane.physics.noise.ar1 import LN_LENGTH, AR1Likelihood, gaps_of
from bayesmembrane.physics.noise.base import NoiseLikelihood, root_of
from bayesmembrane.physics.noise.form import Form, FormLikelihood


@dataclass(frozen=True)
class FormAR1(Form):
    """Sigma of `Form` with tau^2 rho^|i - j| of readings i and j instead of tau^2 I, and rho = exp(-1 / length)."""

    name: ClassVar[str] = "form_ar1"
    title: ClassVar[str] = "noise that remembers by the reading, and smooth form errors"

    @property
    def coordinates(self) -> tuple[Parameter, ...]:
        return (*super().coordinates, LN_LENGTH)

    @property
    def natural_parameters(self) -> tuple[Natural, ...]:
        return (*super().natural_parameters, Natural("rho", "-", "correlation of neighbouring readings"))

    def natural(self, x: Array, scale: float) -> Array:
        return np.column_stack([super().natural(x[:, :-1], scale), np.exp(-np.exp(-x[:, -1]))])

    def bind(self, measurement: Measurement) -> FormLikelihood:
        return FormAR1Likelihood(measurement, self.laws)


class FormAR1Likelihood(FormLikelihood):
    """As `FormLikelihood`, with R. E. Kalman's filter before all else: still O(N r^2) a draw.

    Beside a covariance that the measurement states everything is done with the whole covariance, O(N^3) a draw.
    """

    def __init__(self, measurement: Measurement, laws: bool) -> None:
        super().__init__(measurement, laws)
        self.memory = AR1Likelihood(measurement, gaps_of(measurement, "readings"))

    def log_likelihood(self, residual: Array, x: Array) -> Array:
        if self.axes is None:
            return super().log_likelihood(residual, x)
        roots = root_of(np.stack([self._one(b, len(x)).covariance(x[b]) for b in range(len(x))]))
        z = np.linalg.solve(roots, residual[:, :, None])[:, :, 0]
        log_det = 2 * np.sum(np.log(np.diagonal(roots, axis1=1, axis2=2)), axis=1)
        return np.asarray(-0.5 * (np.sum(z * z, axis=1) + log_det + residual.shape[1] * np.log(2 * np.pi)))

    def pointwise(self, residual: Array, x: Array) -> Array:
        one = (self._one(b, len(x)) for b in range(len(x)))
        return np.concatenate([NoiseLikelihood.pointwise(o, residual[[b]], x[[b]]) for b, o in enumerate(one)])

    def covariance(self, x: Array) -> Array:
        white = super().covariance(x)
        tau = float(np.exp(x[0])) * self.scale
        return np.asarray(white + tau**2 * (np.exp(-np.exp(-x[-1]) * self.memory.distance) - np.eye(len(white))))

    def fresh(self, x: Array, rng: np.random.Generator) -> Array:
        stated = self.memory.draw(x[:, [0, -1]], rng)  # with the noise that the measurement states
        return stated + self._unsteady(x, rng)

    def _staying(self, x: Array) -> Array:
        return np.repeat(np.exp(-np.exp(-x[:, -1]))[:, None], self.own.size, axis=1)

    def _whitened(self, values: Array, x: Array, own: Array) -> Array:
        if self.axes is None:
            return super()._whitened(values, x, own)
        tau = float(np.exp(x[0])) * self.scale
        remembered = tau**2 * np.exp(-np.exp(-x[-1]) * self.memory.distance)
        root = root_of((np.diag(own) + self.axes.T @ remembered @ self.axes)[None])[0]
        return np.asarray(solve_triangular(root, values, lower=True))

    def _one(self, b: int, count: int) -> FormLikelihood:
        """The same for the curve of one draw of ``count``."""
        force, traces = self._curves(count)
        return self.at(force[[b]], traces[[b]])
