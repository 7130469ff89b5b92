"""What is left, kept without a name: a Gaussian process along the path, for the predictive bands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from celerite2 import GaussianProcess
from celerite2.driver import LinAlgError
from celerite2.terms import Matern32Term, Term
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.optimize import minimize

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.reference.noise import OwnNoise, forgotten
from bayesmembrane.diagnosis.thresholds import DISCREPANCY
from bayesmembrane.ground.parameters import Array

FAR = 500.0


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """d ~ GP(0, a^2 (1 + u) e^-u), u = |s - s'| / l, along the way s of the disc.

    mean, sd : (N,) N, given the residual
    amplitude : a in N
    length : l in m of way
    """

    mean: Array
    sd: Array
    amplitude: float
    length: float


def discrepancy(measurement: Measurement, residual: Array, noise: OwnNoise) -> Discrepancy:
    """The process whose amplitude and length are most likely for ``residual`` (N,) N under the measurement's own noise.

    C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for Machine Learning (2006), eq. 2.25, 2.26 and 5.8; the
    Matern kernel of index 3/2, eq. 4.17. The way never falls, whatever the disc does; where it stands still, readings
    share one place, and their noise keeps the covariance positive. Time and memory grow with N, but with N^3 and N^2
    where the measurement states a covariance.
    """
    place = measurement.path.deflection
    way = np.cumsum(np.abs(np.diff(place, prepend=place[0])))[measurement.on_path]
    span = float(np.ptp(way)) or 1.0
    s = (way - way.min()) / span
    given: _Markov | _Dense = _Markov(s, residual, noise) if noise.root is None else _Dense(s, residual, noise)
    theta = _most_likely(given)
    mean, sd = given.conditional(theta)
    return Discrepancy(mean, sd, float(noise.sd * np.exp(theta[0])), float(span * np.exp(theta[1])))


def _most_likely(given: _Markov | _Dense) -> Array:
    """ln of (amplitude over the noise's sd, length over the way)."""
    limits = DISCREPANCY
    trials = [np.array([np.log(a), np.log(v)]) for a in limits.amplitudes for v in limits.lengths]
    first = min(trials, key=given.cost)
    found = minimize(
        given.cost,
        first,
        method="Nelder-Mead",
        bounds=(
            (limits.least_ln_amplitude, limits.largest_ln_amplitude),
            (np.log(limits.least_length), np.log(limits.largest_length)),
        ),
        options={
            "maxfev": limits.evaluations,
            "xatol": limits.tolerance,
            # The default is next to nothing around zero.
            "initial_simplex": first + limits.first_step * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]),
        },
    )
    return np.asarray(found.x)


def _kernel(theta: Array, noise: OwnNoise) -> Matern32Term:
    """The process along the way, as a sum of exponentials that celerite solves in linear time."""
    return Matern32Term(sigma=noise.sd * np.exp(theta[0]), rho=np.sqrt(3) * np.exp(theta[1]))


def _interpolated(way: Array, at: Array, variance: Array) -> Array:
    """(N,) standard deviation, from the variances at some of the points."""
    return np.interp(way, way[at], np.sqrt(np.maximum(variance, 0.0)))


def _some(way: Array) -> Array:
    """Numbers of the points at which the band is computed."""
    return np.unique(np.linspace(0, way.size - 1, min(way.size, DISCREPANCY.band_points)).round().astype(int))


@dataclass(frozen=True, eq=False)
class _Markov:
    """A residual (N,) whose noise is white, or AR(1) by a clock of its own: all in time and memory of order N.

    With S = L L^T the covariance of the noise and L^-1 of two diagonals, L^-1 (K + S) L^-T = L^-1 K L^-T + 1 is of
    the form that celerite solves (D. Foreman-Mackey et al., Astron. J. 154 (2017) 220), see `_FreedOfNoise`.
    """

    way: Array
    residual: Array
    noise: OwnNoise

    def cost(self, theta: Array) -> float:
        """-ln of the likelihood, up to a constant."""
        try:
            return float(-self._process(theta).log_likelihood(self.noise.white(self.residual)))
        except LinAlgError:
            return np.inf

    def conditional(self, theta: Array) -> tuple[Array, Array]:
        """(mean, standard deviation) of the process: K (K + S)^-1 r, and K - K (K + S)^-1 K on its diagonal."""
        kernel, process = _kernel(theta, self.noise), self._process(theta)
        solved = _transposed_white(self.noise, process.apply_inverse(self.noise.white(self.residual)))
        mean = kernel.dot(self.way, np.zeros(self.way.size), solved)
        at = _some(self.way)
        seen = self.noise.white(kernel.get_value(self.way[:, None] - self.way[at]))
        taken = np.einsum("ij,ij->j", seen, process.apply_inverse(seen))
        return np.asarray(mean), _interpolated(self.way, at, float(kernel.get_value(0.0)[0]) - taken)

    def _process(self, theta: Array) -> GaussianProcess:
        process = GaussianProcess(_FreedOfNoise(_kernel(theta, self.noise), self.noise))
        # Far apart, neighbours know nothing of each other: e^-500 is nothing, and e^500 is still a number.
        steps = np.minimum(np.diff(self.way), FAR * np.exp(theta[1]))
        process.compute(np.concatenate([[0.0], np.cumsum(steps)]), diag=np.ones(self.way.size))
        return process


def _transposed_white(noise: OwnNoise, values: Array) -> Array:
    """L^-T v of values (N,), with S = L L^T."""
    phi = forgotten(noise.rho, noise.gaps)
    scaled = np.array(values)
    scaled[1:] /= np.sqrt(1 - phi**2)
    scaled[:-1] -= phi * scaled[1:]
    return np.asarray(scaled / noise.each)


class _FreedOfNoise(Term):  # type: ignore[misc]
    """A kernel K as residuals show it that were freed of AR(1) noise: L^-1 K L^-T.

    Below its diagonal K_ij = U_i . e^(-c (x_i - x_j)) V_j. L^-1 divides rows by the standard deviation, takes phi_i of
    row i - 1 from row i, and divides that by g_i = sqrt(1 - phi_i^2); so that U_i becomes
    (U_i - phi_i e^(c (x_i - x_(i-1))) U_(i-1)) / g_i, and V_j the same with e^(-c ...).
    """

    def __init__(self, kernel: Term, noise: OwnNoise) -> None:
        self.kernel = kernel
        self.phi = forgotten(noise.rho, noise.gaps)[:, None]
        self.scale = noise.each[:, None]

    def get_celerite_matrices(self, x: Array, diag: Array, **_: Any) -> tuple[Array, Array, Array, Array]:
        """(c, diagonal, U, V) at places x (N,) with ``diag`` (N,) added to the diagonal."""
        c, a, u, v = self.kernel.get_celerite_matrices(x, np.zeros(x.size))
        a, u, v = a / self.scale[:, 0] ** 2, u / self.scale, v / self.scale
        phi, step = self.phi, c * np.diff(x)[:, None]
        near = np.sum(u[1:] * np.exp(-step) * v[:-1], axis=1, keepdims=True)  # K_(i, i-1)
        own = np.sqrt(1 - phi**2)
        freed_u, freed_v, freed_a = u.copy(), v.copy(), a.copy()
        freed_u[1:] = (u[1:] - phi * np.exp(step) * u[:-1]) / own
        freed_v[1:] = (v[1:] - phi * np.exp(-step) * v[:-1]) / own
        freed_a[1:] = ((a[1:, None] - 2 * phi * near + phi**2 * a[:-1, None]) / own**2)[:, 0]
        return c, freed_a + diag, freed_u, freed_v


@dataclass(frozen=True, eq=False)
class _Dense:
    """A residual (N,) whose noise has a covariance that the measurement states."""

    way: Array
    residual: Array
    noise: OwnNoise

    def cost(self, theta: Array) -> float:
        """-ln of the likelihood, up to a constant."""
        factor, _ = self._factor(theta)
        z = solve_triangular(factor, self.residual, lower=True)
        return float(0.5 * z @ z + np.sum(np.log(np.diag(factor))))

    def conditional(self, theta: Array) -> tuple[Array, Array]:
        """(mean, standard deviation) of the process."""
        factor, k = self._factor(theta)
        solved = cho_solve((factor, True), np.column_stack([self.residual, k]))
        variance = np.diag(k) - np.einsum("ij,ji->i", k, solved[:, 1:])
        return np.asarray(k @ solved[:, 0]), np.sqrt(np.maximum(variance, 0.0))

    def _factor(self, theta: Array) -> tuple[Array, Array]:
        """(Cholesky factor of K + S, K)."""
        assert self.noise.root is not None
        k = _kernel(theta, self.noise).get_value(self.way[:, None] - self.way[None, :])
        return np.tril(cho_factor(k + self.noise.root @ self.noise.root.T, lower=True)[0]), k
