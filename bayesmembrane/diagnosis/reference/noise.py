"""The measurement's own noise, and what residuals and slopes are once freed of it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.thresholds import NOISE
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.noise.ar1 import gaps_of


@dataclass(frozen=True, eq=False)
class OwnNoise:
    """e ~ N(0, S): what the load cell does on its own, free of anything that a model may lack.

    sd : N, root mean square over the points
    rho, rho_sd : correlation of neighbours a median step apart, and its standard error; 0 where the noise is given
    gaps : (N - 1,) steps between points over their median, by the clock that the noise follows
    root : (N, N) Cholesky factor of a covariance that the measurement states, or None
    dof : degrees of freedom behind ``sd``; inf where it is given
    clock : "time" or "readings": what noise forgets with
    profile : (N,) or (1,) standard deviation of each point over ``sd``
    excess : how many times larger than stated the noise is, where the statement was not believed; else 1
    """

    sd: float
    rho: float
    rho_sd: float
    gaps: Array
    root: Array | None
    dof: float
    clock: str = "time"
    profile: Array = field(default_factory=lambda: np.ones(1))
    excess: float = 1.0

    @property
    def stated(self) -> bool:
        """True if the measurement states its noise, and its readings do not contradict."""
        return bool(np.isinf(self.dof))

    @property
    def remembers(self) -> bool:
        """True if neighbouring readings are correlated beyond doubt, in excess of what is stated."""
        return self.rho > NOISE.remembers_from * self.rho_sd

    @property
    def each(self) -> Array:
        """(N,) N, standard deviation of every point."""
        if self.root is not None:
            return np.asarray(np.linalg.norm(self.root, axis=1))
        return np.broadcast_to(self.sd * self.profile, (self.gaps.size + 1,))

    def white(self, values: Array) -> Array:
        """L^-1 v along the first axis of v (N, ...), with S = L L^T: noise becomes N(0, 1)."""
        if self.root is not None:
            flat = values.reshape(len(values), -1)
            return np.asarray(solve_triangular(self.root, flat, lower=True)).reshape(values.shape)
        return decorrelated(divided(values, self.profile), self.rho, self.gaps) / self.sd

    @property
    def log_root(self) -> float:
        """ln |L|, with S = L L^T."""
        if self.root is not None:
            return float(np.sum(np.log(np.diag(self.root))))
        forgot = forgotten(self.rho, self.gaps)
        return float(np.sum(np.log(self.each)) + 0.5 * np.sum(np.log1p(-(forgot**2))))

    def part(self, measurement: Measurement, keep: NDArray[np.bool_]) -> OwnNoise:
        """The same noise for the points at ``keep`` (N,); ``measurement`` is that part."""
        root = None
        if self.root is not None:
            root = np.asarray(np.linalg.cholesky((self.root @ self.root.T)[np.ix_(keep, keep)]), dtype=float)
        profile = self.profile[keep] if self.profile.size > 1 else self.profile
        return replace(self, gaps=gaps_of(measurement, self.clock), root=root, profile=profile)

    def cautious(self) -> OwnNoise:
        """With a correlation larger by its standard error: one that is plugged in makes tests optimistic."""
        if self.stated:
            return self
        rho = min(self.rho + self.rho_sd, NOISE.largest_rho)
        return replace(self, rho=rho)


@dataclass(frozen=True, eq=False)
class Whitened:
    """What a model leaves, freed of noise, and the directions in which nothing could be missing.

    noise : by which it was freed
    residual : (N,) in standard deviations
    reference : (N, p) orthonormal columns that span the smooth reference and the model's own slopes
    parameters : k, of the model
    """

    noise: OwnNoise
    residual: Array
    reference: Array
    parameters: int

    @property
    def rest(self) -> Array:
        """(N,) what is left of the residual beside the reference."""
        return self.residual - self.reference @ (self.reference.T @ self.residual)


def whitened(residual: Array, slopes: Array, smooth: Array, noise: OwnNoise) -> Whitened:
    """Of a model's ``residual`` (N,) N, its ``slopes`` (N, k) and the smooth reference (N, p).

    What its own slopes could take of the residual, to first order, is no misfit.
    """
    known = orthonormal(noise.white(np.column_stack([smooth, slopes])))
    own, white = orthonormal(noise.white(slopes)), noise.white(residual)
    return Whitened(noise, white - own @ (own.T @ white), known, slopes.shape[1])


def divided(values: Array, profile: Array) -> Array:
    """v / profile along the first axis of v (N, ...)."""
    return np.asarray(values / profile.reshape(-1, *(1,) * (values.ndim - 1)))


def decorrelated(values: Array, rho: float, gaps: Array) -> Array:
    """(v_i - phi_i v_(i-1)) / sqrt(1 - phi_i^2) with phi = rho^gap: AR(1) noise of unit variance becomes white."""
    if rho <= 0:
        return np.array(values, dtype=float)
    phi = forgotten(rho, gaps)
    phi = phi.reshape(-1, *(1,) * (values.ndim - 1))
    out = np.array(values, dtype=float)
    out[1:] = (values[1:] - phi * values[:-1]) / np.sqrt(1 - phi**2)
    return out


def forgotten(rho: float, gaps: Array) -> Array:
    """(N - 1,) rho^gap: the correlation of each point with the one before."""
    return rho**gaps if rho > 0 else np.zeros(gaps.size)


def orthonormal(basis: Array, tolerance: float = NOISE.rank) -> Array:
    """(N, rank) orthonormal columns that span those of ``basis`` (N, p), each scaled to unit length first."""
    length = np.linalg.norm(basis, axis=0)
    u, s, _ = np.linalg.svd(basis[:, length > 0] / length[length > 0], full_matrices=False)
    return np.asarray(u[:, s > tolerance * (s[0] if s.size else 1.0)])


def free_of(others: Array, columns: Array) -> Array:
    """``columns`` (N,) or (N, m), less what ``others`` (N, p) can take of them."""
    basis = orthonormal(others)
    return np.asarray(columns - basis @ (basis.T @ columns))
