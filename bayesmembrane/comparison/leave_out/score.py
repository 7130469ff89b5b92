"""How well a hypothesis predicts: single points from all others, and the rest of the curve from its first part."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from bayesmembrane.calibration.layout import Groups
from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.calibration.sampling.convergence import effective_draws
from bayesmembrane.comparison.leave_out.pool import ENOUGH, Pool
from bayesmembrane.comparison.leave_out.refit import log_integral, log_integral_without
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.draws import left_out, worth_of_mean
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.plain import plain
from bayesmembrane.physics.form_error import ENERGY, LAW, LOCAL, traces
from bayesmembrane.physics.forward import AT_ONCE, Forward, Solve
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.noise.base import force_scale

PARETO_K = 0.7
LED, LED_FROM = 2, 20.0
"""Densities that are led to the posterior of the others before it is integrated, from so many effective draws on."""
MOST_INTEGRALS = 8
"""Of one call: each takes thousands of curves."""

Tell = Callable[[str], None]


# ---- leave one out ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class LeaveOneOut:
    """elpd = sum_i ln p(y_i | all other y).

    Attributes
    ----------
    elpd, se : the sum, and its standard error sqrt(N var_i) over the points
    monte_carlo_sd : what the draws add to that
    pointwise : (N,) the terms
    pareto_k : (N,) shape of the tail of the importance weights; above 0.7 the term comes from further draws
    refitted : indices of those points, and of others of which the draws say too little
    """

    elpd: float
    se: float
    monte_carlo_sd: float
    pointwise: Array
    pareto_k: Array
    refitted: tuple[int, ...]


def leave_one_out(
    posterior: Posterior,
    data: Groups,
    seed: int = 0,
    tell: Tell | None = None,
    integral: tuple[float, float] | None = None,
) -> LeaveOneOut:
    """ln p(y_i | y_-i) = ln of the mean of p(y_i | y_-i, x) over p(x | y_-i), for every point i.

    ``data`` has the groups of a run of ``posterior``: its pointwise terms are ln p(y_i | y_-i, x) under the whole
    covariance, so that p(x | y) / p(y_i | y_-i, x) is what the other points say of x, whatever the correlation. Pareto
    smoothed importance sampling uses that; where its k exceeds 0.7, draws of densities that are led to the posterior of
    the other points are added (`Pool`), and where these do not do, that posterior is integrated by itself (`refit`).
    ``integral`` is ln of that of the whole posterior with its standard error, if the run has it.

    A. Vehtari, A. Gelman, J. Gabry, Stat. Comput. 27 (2017) 1413; P.-C. Bürkner, J. Gabry, A. Vehtari, Comput. Stat. 36
    (2021) 1243.
    """
    terms, k = left_out(data.log_likelihood["force"].values.astype(float), _worth(data.posterior))
    draws = np.stack([data.posterior[n].values.ravel() for n in posterior.hypothesis.names], axis=1)
    log_likelihood = data.log_likelihood["force"].values.reshape(len(draws), -1).astype(float)
    error = np.array([_smoothed_error(log_likelihood[:, i]) for i in range(len(terms))])
    bad, shared = ~(k <= PARETO_K), 0.0
    if np.any(bad):
        log_posterior = data.sample_stats["lp"].values.ravel().astype(float)
        pool = Pool(posterior, draws, log_posterior, log_likelihood, np.random.default_rng([seed, 2]))
        # A k is small, too, where few draws reach what the others allow: those of the pool show it.
        bad |= np.array([pool.effective(i) < ENOUGH for i in range(len(terms))])
        others = _Others(pool, draws, integral)
        for i in np.flatnonzero(bad).tolist():
            if tell is not None:
                tell(f"leaving out point {i + 1} of {len(terms)}")
            terms[i], error[i] = others.term(i)
        shared = others.shared
    return LeaveOneOut(
        elpd=float(np.sum(terms)),
        se=float(np.sqrt(len(terms) * np.var(terms))),
        monte_carlo_sd=float(np.sqrt(np.sum(error**2) + shared**2)),
        pointwise=terms,
        pareto_k=k,
        refitted=tuple(np.flatnonzero(bad).tolist()),
    )


def _worth(posterior: Any) -> float:
    """Effective draws of the mean for each draw, on average of all that was drawn; one where there is one ensemble."""
    chains = [np.asarray(v.values, dtype=float) for v in posterior.data_vars.values()]
    return 1.0 if len(chains[0]) == 1 else float(np.mean([worth_of_mean(c) / c.size for c in chains]))


class _Others:
    """Terms of points that the draws of the posterior say too little of."""

    def __init__(self, pool: Pool, draws: Array, integral: tuple[float, float] | None) -> None:
        self.pool, self.draws, self.whole, self.integrals = pool, draws, integral, 0

    @property
    def shared(self) -> float:
        """What the error of the whole posterior's integral, which is in each of those integrated, adds to their sum."""
        return self.integrals * self.whole[1] if self.integrals and self.whole is not None else 0.0

    def term(self, i: int) -> tuple[float, float]:
        """One with its error: by the draws of the pool, or few more, or by an integral, or by as many as it takes."""
        term, error, effective = self.pool.without(i, LED, LED_FROM)
        if effective >= ENOUGH:
            return term, error
        if self.integrals < MOST_INTEGRALS:
            self.whole = self.whole or log_integral(self.pool.posterior, self.draws, self.pool.rng)
            rest, sd = log_integral_without(self.pool.posterior, i, self.draws, self.pool.rng)
            if np.hypot(sd, self.whole[1]) < error:
                self.integrals += 1
                return self.whole[0] - rest, sd
        return self.pool.without(i)[:2]


def _smoothed_error(log_likelihood: Array) -> float:
    """Monte Carlo error of one term, from the spread of the raw weights 1 / p(y_i | ...)."""
    w = np.exp(np.min(log_likelihood) - log_likelihood)
    return float(np.sqrt(np.var(w) / len(w)) / np.mean(w))


# ---- leave the rest of the range out ---------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class LeaveRangeOut:
    """The held-out points h, given the fitted ones f.

    Attributes
    ----------
    elpd : ln p(y_h | y_f), the joint density of all held-out points
    se : sqrt(M var_j) of the terms ln p(y_hj | y_f, y_h1 .. y_h(j-1)); they are few, and it is rough
    monte_carlo_sd : what the draws add to that
    effective : how many draws the held-out points leave; below 20 the elpd is a guess from the best draws
    lost : part of the draws whose film has no curve at all held-out deflections
    rmse_N, max_N : of measured minus mean prediction, N; nan if no draw has a curve
    deflection, predicted, sd : (M,) m, N, N: mean and standard deviation of the prediction, noise included
    """

    elpd: float
    se: float
    monte_carlo_sd: float
    effective: float
    lost: float
    rmse_N: float  # noqa: N815 - the unit
    max_N: float  # noqa: N815
    deflection: Array
    predicted: Array
    sd: Array

    @property
    def points(self) -> int:
        """M"""
        return int(self.deflection.size)

    def summary(self) -> dict[str, Any]:
        """The numbers as plain values."""
        names = ("elpd", "se", "monte_carlo_sd", "effective", "lost", "rmse_N", "max_N", "points")
        return dict(plain({n: getattr(self, n) for n in names}))


def leave_range_out(posterior: Posterior, draws: Array, whole: Measurement, solve: Solve = api.solve) -> LeaveRangeOut:
    """ln p(y_h | y_f) = ln of the mean of N(y_h; F_h + S_hf S_ff^-1 (y_f - F_f), S_hh - S_hf S_ff^-1 S_fh).

    ``draws`` (B, k) are those of ``posterior``, whose measurement is ``whole`` up to some deflection; h are the other
    points. S is the covariance of the whole measurement, its own noise and the inferred one.

    Raises `SettingsError` if nothing is left out, or the noise model has coordinates other than the logarithms of a
    standard deviation, a length and relative errors.
    """
    fitted = whole.deflection <= np.max(posterior.measurement.deflection) * (1 + 1e-9)
    if np.all(fitted):
        raise SettingsError("the fit has used the whole range, and nothing is left to be predicted")
    if np.count_nonzero(fitted) != len(posterior.measurement):
        raise SettingsError("the run was not made from the first part of this measurement")
    forward = Forward(posterior.hypothesis, whole, whole.deflection, solve)
    force = forward(draws, reached=False).force
    noise = _carried(posterior, draws, whole)
    model = posterior.hypothesis.noise.bind(whole)
    shown = traces(forward, draws, force) if model.traced else None
    held = np.flatnonzero(~fitted)
    log_p = np.full((len(draws), held.size), -np.inf)
    mean, variance = np.full((len(draws), held.size), np.nan), np.full((len(draws), held.size), np.nan)
    good = np.flatnonzero(np.all(np.isfinite(force), axis=1))
    rows = max(1, AT_ONCE // len(whole) ** 2)
    for some in (good[i : i + rows] for i in range(0, good.size, rows)):
        own = [model.at(force[[b]], None if shown is None else shown[[b]]).covariance(noise[b]) for b in some]
        residual = whole.force - force[some]
        shift, conditional = _conditional(np.stack(own), residual, fitted)
        mean[some] = force[np.ix_(some, held)] + shift
        variance[some] = np.diagonal(conditional, axis1=1, axis2=2)
        log_p[some] = _sequential(conditional, residual[:, held] - shift)
    return _summary(whole, held, good, log_p, mean, variance)


def _summary(
    whole: Measurement, held: NDArray[np.intp], good: NDArray[np.intp], log_p: Array, mean: Array, variance: Array
) -> LeaveRangeOut:
    total = np.cumsum(log_p, axis=1)
    count = len(log_p)
    cumulative = logsumexp(total, axis=0) - np.log(count) if good.size else np.full(held.size, -np.inf)
    terms = np.diff(cumulative, prepend=0.0) if good.size else cumulative
    w = np.exp(total[:, -1] - np.max(total[:, -1])) if good.size else np.zeros(1)
    effective = effective_draws(w)
    predicted = np.mean(mean[good], axis=0) if good.size else np.full(held.size, np.nan)
    spread = np.sqrt(np.mean(variance[good], axis=0) + np.var(mean[good], axis=0)) if good.size else predicted
    miss = whole.force[held] - predicted
    return LeaveRangeOut(
        elpd=float(cumulative[-1]),
        se=float(np.sqrt(held.size * np.var(terms))) if good.size else np.nan,
        monte_carlo_sd=float(np.std(w) / np.sqrt(count) / np.mean(w)) if good.size else np.nan,
        effective=effective,
        lost=1.0 - good.size / count,
        rmse_N=float(np.sqrt(np.mean(miss**2))),
        max_N=float(np.max(np.abs(miss))),
        deflection=whole.deflection[held],
        predicted=predicted,
        sd=spread,
    )


def _conditional(covariance: Array, residual: Array, fitted: NDArray[np.bool_]) -> tuple[Array, Array]:
    """(S_hf S_ff^-1 r_f, S_hh - S_hf S_ff^-1 S_fh) of S (B, N, N) and r (B, N)."""
    ff, fh = covariance[:, fitted][:, :, fitted], covariance[:, fitted][:, :, ~fitted]
    gain = np.swapaxes(np.linalg.solve(ff, fh), 1, 2)
    rest = covariance[:, ~fitted][:, :, ~fitted] - gain @ fh
    return (gain @ residual[:, fitted, None])[..., 0], 0.5 * (rest + np.swapaxes(rest, 1, 2))


def _sequential(covariance: Array, residual: Array) -> Array:
    """(B, M) ln N of each residual given those before it: -z^2/2 - ln L_jj - ln(2 pi)/2, S = L L^T and z = L^-1 r."""
    root = np.linalg.cholesky(covariance)
    z = np.linalg.solve(root, residual[..., None])[..., 0]
    return np.asarray(-0.5 * z * z - np.log(np.diagonal(root, axis1=1, axis2=2)) - 0.5 * np.log(2 * np.pi))


def _carried(posterior: Posterior, draws: Array, whole: Measurement) -> Array:
    """Noise coordinates (B, m) that mean for ``whole`` what those of the draws mean for the fitted part.

    They are relative to the largest force and to the median step, and both change with the range.
    """
    part = posterior.measurement
    of_force = np.log(force_scale(part) / force_scale(whole))
    shifts = {
        "ln_sd": of_force,
        LOCAL.name: of_force,
        "ln_length": np.log(_median_step(part) / _median_step(whole)),
        ENERGY.name: 0.0,
        LAW.name: 0.0,
    }
    names = [p.name for p in posterior.hypothesis.noise.coordinates]
    unknown = [n for n in names if n not in shifts]
    if unknown:
        raise SettingsError(f'the noise coordinate "{unknown[0]}" cannot be carried over to another range')
    return np.asarray(posterior.hypothesis.noise_coordinates(draws) + np.array([shifts[n] for n in names]))


def _median_step(measurement: Measurement) -> float:
    place = measurement.deflection if measurement.time is None else measurement.time
    step = np.abs(np.diff(place))
    return float(np.median(step)) if step.size and np.median(step) > 0 else 1.0
