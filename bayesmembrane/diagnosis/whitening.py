"""The measurement's own noise: how large, how long it remembers, and residuals freed from it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.optimize import minimize_scalar
from scipy.stats import chi2

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.noise.ar1 import gaps_of

LARGEST_RHO = 0.97
TRIALS = np.linspace(0.0, LARGEST_RHO, 25)
CURVED = 0.02  # step in rho at which the curvature of the likelihood is taken
CLOCKS = ("time", "readings")
EVEN = 0.05  # steps that differ by no more than this part are even: both clocks are the same
FEW, SURE, DOUBTED = 30, 3.0, 1e-3
"""A stated standard deviation is doubted from so many degrees of freedom on, where the correlation is so many standard
errors above zero, or a scatter as large had less than this probability."""
SMALLEST_SD = 1e-9  # of the largest force: a perfect curve still has a noise


@dataclass(frozen=True, eq=False)
class OwnNoise:
    """e ~ N(0, S): what the load cell does on its own, free of anything that a model may lack.

    sd : N, root mean square over the points
    rho, rho_sd : correlation of neighbours a median step apart, and its standard error; 0 where the noise is given
    gaps : (N - 1,) steps between points over their median, by the clock that the noise follows
    root : (N, N) Cholesky factor of a covariance that the measurement states, or None
    dof : degrees of freedom behind ``sd``; inf where it is given
    clock : one of `CLOCKS`: what noise forgets with, the time or the number of readings
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
        return self.rho > SURE * self.rho_sd

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
        return decorrelated(_over(values, self.profile), self.rho, self.gaps) / self.sd

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
        rho = min(self.rho + self.rho_sd, LARGEST_RHO)
        return replace(self, rho=rho)


def _over(values: Array, profile: Array) -> Array:
    """v / profile along the first axis of v (N, ...)."""
    return np.asarray(values / profile.reshape(-1, *(1,) * (values.ndim - 1)))


def decorrelated(values: Array, rho: float, gaps: Array) -> Array:
    """(v_i - phi_i v_(i-1)) / sqrt(1 - phi_i^2) with phi = rho^gap: AR(1) noise of unit variance becomes white."""
    phi = rho**gaps if rho > 0 else np.zeros(gaps.size)
    phi = phi.reshape(-1, *(1,) * (values.ndim - 1))
    out = np.array(values, dtype=float)
    out[1:] = (values[1:] - phi * values[:-1]) / np.sqrt(1 - phi**2)
    return out


def own_noise(measurement: Measurement, basis: Array) -> OwnNoise:
    """Noise that the measurement states, or else what ``basis`` (N, p) leaves, by restricted maximum likelihood.

    A stated standard deviation is a claim, often from a data sheet: where the readings scatter more than that, or
    remember, what they do counts, in proportion to what is stated of each. A stated covariance is believed.

    For AR(1) noise e the restricted likelihood of rho, sd maximised away, is
    -1/2 [(N - p) ln RSS + ln |R| + ln |B^T R^-1 B|] (D. A. Harville, J. Am. Stat. Assoc. 72 (1977) 320); the prior
    density of rho falls evenly to zero at 1. Where the
    points are uneven in time, noise may forget by the time (drift of air, filters) or by the reading (averages and
    filters of so many readings): the likelier is taken.
    """
    gaps, covariance, stated = gaps_of(measurement), measurement.covariance, measurement.force_sd
    if covariance is not None:
        sd = float(np.sqrt(np.mean(np.diag(covariance))))
        return OwnNoise(sd, 0.0, 0.0, gaps, np.asarray(np.linalg.cholesky(covariance), dtype=float), np.inf)
    sd = 1.0 if stated is None else float(np.sqrt(np.mean(stated**2)))
    profile = np.ones(1) if stated is None else stated / sd
    y, q = _over(measurement.force, profile), orthonormal(_over(basis, profile))
    found = [_restricted(y, q, gaps, "time")]
    if gaps.size and float(np.max(np.abs(gaps - 1))) > EVEN:
        found.append(_restricted(y, q, gaps_of(measurement, "readings"), "readings"))
    inferred = replace(min(found, key=lambda f: f[0])[1], profile=profile)
    if stated is None:
        return inferred
    larger = chi2.sf((inferred.sd / sd) ** 2 * inferred.dof, inferred.dof) < DOUBTED
    if inferred.dof < FEW or not (inferred.remembers or larger):
        return OwnNoise(sd, 0.0, 0.0, gaps, None, np.inf, profile=profile)
    return replace(inferred, excess=inferred.sd / sd)


def _restricted(y: Array, q: Array, gaps: Array, clock: str) -> tuple[float, OwnNoise]:
    """(-2 ln L, noise) at the most likely correlation, beside the orthonormal columns q (N, p)."""

    def fit(rho: float) -> tuple[float, float]:
        """(-2 ln L, RSS) at one correlation."""
        # The last diagonal entry of R is what y has beyond the span of the others.
        r = np.diag(np.linalg.qr(decorrelated(np.column_stack([q, y]), rho, gaps), mode="r"))
        rss = float(r[-1] ** 2)
        phi = rho**gaps if rho > 0 else np.zeros(gaps.size)
        log_det = float(np.sum(np.log1p(-(phi**2)))) + 2 * float(np.sum(np.log(np.abs(r[:-1]))))
        # A density 2 (1 - rho): noise that hardly forgets is a drift, which no test could tell from a misfit.
        return (y.size - q.shape[1]) * np.log(max(rss, 1e-300)) + log_det - 2 * np.log1p(-rho), rss

    values = [fit(rho)[0] for rho in TRIALS]
    best = int(np.argmin(values))
    low, high = TRIALS[max(best - 1, 0)], TRIALS[min(best + 1, TRIALS.size - 1)]
    rho = float(minimize_scalar(lambda v: fit(v)[0], bounds=(low, high), method="bounded").x)
    rho = 0.0 if fit(0.0)[0] <= fit(rho)[0] else rho
    middle = min(max(rho, CURVED), LARGEST_RHO - CURVED)
    bend = (fit(middle - CURVED)[0] - 2 * fit(middle)[0] + fit(middle + CURVED)[0]) / CURVED**2
    dof = y.size - q.shape[1]
    error = float(np.sqrt(2 / bend)) if bend > 0 else 1 / np.sqrt(dof)
    value, rss = fit(rho)
    floor = SMALLEST_SD * float(np.max(np.abs(y)))
    sd = max(float(np.sqrt(rss / dof)), floor)
    return value, OwnNoise(sd, rho, min(error, 0.3), gaps, None, float(dof), clock)


def orthonormal(basis: Array, tolerance: float = 1e-9) -> Array:
    """(N, rank) orthonormal columns that span those of ``basis`` (N, p), each scaled to unit length first."""
    length = np.linalg.norm(basis, axis=0)
    u, s, _ = np.linalg.svd(basis[:, length > 0] / length[length > 0], full_matrices=False)
    return np.asarray(u[:, s > tolerance * (s[0] if s.size else 1.0)])
