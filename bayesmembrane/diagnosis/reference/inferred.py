"""The noise that a measurement states, or that its readings show."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import chdtrc, ndtr

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.reference.noise import OwnNoise, decorrelated, divided, forgotten, orthonormal
from bayesmembrane.diagnosis.thresholds import NOISE, TINY
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.noise.ar1 import gaps_of


def own_noise(measurement: Measurement, basis: Array) -> OwnNoise:
    """Noise that the measurement states, or else what ``basis`` (N, p) leaves, by restricted maximum likelihood.

    A stated standard deviation is a claim, often from a data sheet: where the readings scatter more than that, or
    remember, what they do counts, in proportion to what is stated of each. A stated covariance is believed. Where
    nothing is stated, or one number for all readings that is not believed, the noise may grow with the force
    (`_growing`).

    For AR(1) noise e the restricted likelihood of rho, sd maximised away, is
    -1/2 [(N - p) ln RSS + ln |R| + ln |B^T R^-1 B|] (D. A. Harville, J. Am. Stat. Assoc. 72 (1977) 320); the prior
    density of rho falls evenly to zero at 1. Where the
    points are uneven in time, noise may forget by the time (drift of air, filters) or by the reading (averages and
    filters of so many readings): the likelier is taken.
    """
    gaps, readings = gaps_of(measurement, "time"), gaps_of(measurement, "readings")
    covariance, stated = measurement.covariance, measurement.force_sd
    if covariance is not None:
        sd = float(np.sqrt(np.mean(np.diag(covariance))))
        return OwnNoise(sd, 0.0, 0.0, gaps, np.asarray(np.linalg.cholesky(covariance), dtype=float), np.inf)
    sd = 1.0 if stated is None else float(np.sqrt(np.mean(stated**2)))
    profile = _growing(measurement, basis) if stated is None else stated / sd
    y, q = divided(measurement.force, profile), orthonormal(divided(basis, profile))
    if not measurement.rig.has_path:
        # States are no stations of one path: their order is that of a file, and nothing remembers by it.
        return _believed(measurement, basis, _noise_at(_Restricted(y, q, readings), 0.0, 0.0, "readings"), profile)
    found = [_most_likely(_Restricted(y, q, gaps), "time")]
    if gaps.size and float(np.max(np.abs(gaps - 1))) > NOISE.even_steps:
        found.append(_most_likely(_Restricted(y, q, readings), "readings"))
    return _believed(measurement, basis, min(found, key=lambda f: f[0])[1], profile)


def _believed(measurement: Measurement, basis: Array, inferred: OwnNoise, profile: Array) -> OwnNoise:
    """The noise that is stated, unless the readings contradict it: then what is ``inferred`` with its ``profile``."""
    inferred, stated = replace(inferred, profile=profile), measurement.force_sd
    if stated is None:
        return inferred
    sd = float(np.sqrt(np.mean(stated**2)))
    larger = chdtrc(inferred.dof, (inferred.sd / sd) ** 2 * inferred.dof) < NOISE.doubt_below
    remembers = measurement.rig.has_path and inferred.remembers
    if inferred.dof < NOISE.doubt_from_dof or not (remembers or larger):
        return OwnNoise(sd, 0.0, 0.0, inferred.gaps, None, np.inf, profile=profile)
    if np.allclose(stated, stated[0], rtol=1e-9):  # one number for all says nothing of which of them are noisier
        inferred = own_noise(replace(measurement, force_sd=None), basis)
    return replace(inferred, excess=inferred.sd / sd)


def _growing(measurement: Measurement, basis: Array) -> Array:
    """(N,) standard deviation of each reading over the root mean square of all, sqrt(1 + (b f)^2) of the part f of the
    largest force that ``basis`` (N, p) follows, counted from that at the least deflection; else (1,) one.

    It takes more than chance: a rank correlation with f of the size |r| of what is left. b minimises
    sum ln w + N ln sum |r| / w, as of Laplace's distribution: a jump that the basis does not follow is a few large r.
    Readings that repeat the one before are left out, for what is rounded off or cut off is no noise.
    """
    force = measurement.force
    q = orthonormal(basis)
    followed = q @ (q.T @ force)
    left = 1 - np.sum(q * q, axis=1)
    repeated = np.diff(force) == 0
    alike = np.append(repeated, False) | np.append(False, repeated)
    some = (left > NOISE.least_left) & ~alike
    if np.count_nonzero(some) < max(NOISE.growing_from, 0.5 * force.size):
        return np.ones(1)
    f = np.abs(followed - followed[int(np.argmin(np.abs(measurement.deflection)))])
    f /= max(float(np.max(f)), TINY)
    r = np.abs(force - followed)[some] / np.sqrt(left[some])
    if _by_chance(r, f[some]) > NOISE.growing_below:
        return np.ones(1)

    def value(log_b: float) -> float:
        w = np.hypot(1.0, np.exp(log_b) * f[some])
        return float(np.mean(np.log(w)) + np.log(max(float(np.sum(r / w)), TINY)))

    low, high = np.log(NOISE.growth)
    w = np.hypot(1.0, np.exp(minimize_scalar(value, bounds=(low, high), method="bounded").x) * f)
    return np.asarray(w / np.sqrt(np.mean(w**2)))


def _by_chance(r: Array, f: Array) -> float:
    """Probability of a rank correlation of r (N,) with a smooth f (N,) as large as seen.

    Of N readings that are like their neighbours, with a correlation c of the ranks of r, N (1 - c) / (1 + c) count
    (M. S. Bartlett, J. R. Stat. Soc. 98 (1935) 536, beside an f that hardly changes from one to the next).
    """
    a, b = (np.argsort(np.argsort(v)) - (v.size - 1) / 2 for v in (r, f))
    alike = max(float(a[1:] @ a[:-1]) / float(a @ a), 0.0)
    score = float(a @ b) / float(a @ a) * np.sqrt((r.size - 1) * (1 - alike) / (1 + alike))
    return float(ndtr(-score))


@dataclass(frozen=True, eq=False)
class _Restricted:
    """The restricted likelihood of readings y (N,) beside the orthonormal columns q (N, p)."""

    y: Array
    q: Array
    gaps: Array

    @property
    def dof(self) -> int:
        return int(self.y.size - self.q.shape[1])

    @cached_property
    def _columns(self) -> tuple[Array, float]:
        """(q and what y has beside it, of unit length (N, p + 1); that length): what q follows of y costs nothing."""
        rest = self.y - self.q @ (self.q.T @ self.y)
        rest -= self.q @ (self.q.T @ rest)  # once more: of a curve without noise little but round-off is left
        length = float(np.linalg.norm(rest)) or 1.0
        return np.column_stack([self.q, rest / length]), length

    def at(self, rho: float) -> tuple[float, float]:
        """(-2 ln L, RSS) at one correlation."""
        columns, length = self._columns
        white = decorrelated(columns, rho, self.gaps)
        try:  # by products: q is orthonormal, and whitening makes no more than a thousand of its condition
            r = np.diag(np.linalg.cholesky(white.T @ white))
        except np.linalg.LinAlgError:
            r = np.diag(np.linalg.qr(white, mode="r"))
        # The last diagonal entry of R is what y has beyond the span of the others.
        rss = float(r[-1] * length) ** 2
        phi = forgotten(rho, self.gaps)
        log_det = float(np.sum(np.log1p(-(phi**2)))) + 2 * float(np.sum(np.log(np.abs(r[:-1]))))
        # A density 2 (1 - rho): noise that hardly forgets is a drift, which no test could tell from a misfit.
        return self.dof * np.log(max(rss, TINY)) + log_det - 2 * np.log1p(-rho), rss

    def value(self, rho: float) -> float:
        return self.at(rho)[0]


def _most_likely(likelihood: _Restricted, clock: str) -> tuple[float, OwnNoise]:
    """(-2 ln L, noise) at the most likely correlation."""
    value, dof = likelihood.value, likelihood.dof
    trials = np.linspace(0.0, NOISE.largest_rho, NOISE.rho_trials)
    best = int(np.argmin([value(rho) for rho in trials]))
    low, high = trials[max(best - 1, 0)], trials[min(best + 1, trials.size - 1)]
    rho = float(minimize_scalar(value, bounds=(low, high), method="bounded").x)
    rho = 0.0 if value(0.0) <= value(rho) else rho
    step = NOISE.rho_step
    middle = min(max(rho, step), NOISE.largest_rho - step)
    bend = (value(middle - step) - 2 * value(middle) + value(middle + step)) / step**2
    error = float(np.sqrt(2 / bend)) if bend > 0 else 1 / np.sqrt(dof)
    return likelihood.value(rho), _noise_at(likelihood, rho, min(error, NOISE.largest_rho_sd), clock)


def _noise_at(likelihood: _Restricted, rho: float, error: float, clock: str) -> OwnNoise:
    """The noise of one correlation, and its standard error."""
    floor = NOISE.smallest_sd * float(np.max(np.abs(likelihood.y)))
    sd = max(float(np.sqrt(likelihood.at(rho)[1] / likelihood.dof)), floor)
    return OwnNoise(sd, rho, error, likelihood.gaps, None, float(likelihood.dof), clock)
