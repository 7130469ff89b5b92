"""What is left, kept without a name: a Gaussian process along the path, for the predictive bands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.whitening import OwnNoise
from bayesmembrane.ground.parameters import Array

LENGTHS = (0.001, 0.002, 0.004, 0.01, 0.03, 0.1, 0.3)  # of the way: where the search for a correlation length starts
AMPLITUDES = (0.3, 1.0, 5.0)  # of the noise
BOUNDS = ((-12.0, 6.0), (np.log(5e-4), np.log(3.0)))
SIMPLEX = np.array([[0.0, 0.0], [0.4, 0.0], [0.0, 0.4]])  # its default is next to nothing around zero


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """d ~ GP(0, a^2 exp(-(s - s')^2 / (2 l^2))) along the way s of the disc.

    mean, sd : (N,) N, given the residual
    amplitude : a in N
    length : l in m of way
    """

    mean: Array
    sd: Array
    amplitude: float
    length: float

    @property
    def sentence(self) -> str:
        """Its size and scale in words."""
        return (
            f"What is left is kept without a name: about {1e3 * self.amplitude:.3g} mN, varying over "
            f"{1e3 * self.length:.3g} mm of the disc's way."
        )


def discrepancy(measurement: Measurement, residual: Array, noise: OwnNoise) -> Discrepancy:
    """The process whose amplitude and length are most likely for ``residual`` (N,) N under the measurement's own noise.

    C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for Machine Learning (2006), eq. 2.25, 2.26 and 5.8.
    """
    place = measurement.path.deflection
    way = np.cumsum(np.abs(np.diff(place, prepend=place[0])))[measurement.on_path]
    span = float(np.ptp(way)) or 1.0
    s = (way - way.min()) / span
    square = (s[:, None] - s[None, :]) ** 2
    own = noise.root @ noise.root.T if noise.root is not None else _ar1(noise)

    def kernel(theta: Array) -> Array:
        amplitude, length = noise.sd * np.exp(theta[0]), np.exp(theta[1])
        return np.asarray(amplitude**2 * np.exp(-0.5 * square / length**2))

    def cost(theta: Array) -> float:
        try:
            c, lower = cho_factor(kernel(theta) + own, lower=True)
        except np.linalg.LinAlgError:
            return 1e300
        alpha = cho_solve((c, lower), residual)
        return float(0.5 * residual @ alpha + np.sum(np.log(np.diag(c))))

    starts = [np.array([np.log(a), np.log(v)]) for a in AMPLITUDES for v in LENGTHS]
    first = min(starts, key=cost)
    best = minimize(
        cost,
        first,
        method="Nelder-Mead",
        bounds=BOUNDS,
        options={"maxfev": 60, "xatol": 0.02, "initial_simplex": first + SIMPLEX},
    ).x
    k = kernel(best)
    factor = cho_factor(k + own, lower=True)
    mean = k @ cho_solve(factor, residual)
    variance = np.diag(k) - np.einsum("ij,ji->i", k, cho_solve(factor, k))
    return Discrepancy(
        np.asarray(mean),
        np.sqrt(np.maximum(variance, 0.0)),
        float(noise.sd * np.exp(best[0])),
        float(span * np.exp(best[1])),
    )


def _ar1(noise: OwnNoise) -> Array:
    """(N, N) N^2 covariance of inferred noise."""
    n = noise.gaps.size + 1
    if noise.rho <= 0:
        return np.asarray(noise.sd**2 * np.eye(n))
    place = np.concatenate([[0.0], np.cumsum(noise.gaps)])
    return np.asarray(noise.sd**2 * noise.rho ** np.abs(place[:, None] - place[None, :]))
