"""How well a hypothesis predicts: single points from all others, and the rest of the curve from its first part."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import arviz
import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from bayesmembrane.errors import SettingsError
from bayesmembrane.forward import Forward, Solve
from bayesmembrane.inference.evidence_population import led
from bayesmembrane.inference.mixture import Mixture, fit_mixture
from bayesmembrane.inference.posterior import Posterior
from bayesmembrane.measurement import Measurement
from bayesmembrane.mechanics import api
from bayesmembrane.noise.base import force_scale
from bayesmembrane.parameters import Array

PARETO_K = 0.7
REFITTED, PARTS = 600, 4
TRUSTED = 20.0  # effective draws of the other points' posterior; with fewer, draws are led there
LEARN_FROM, BRIDGED = 2000, 30
SPREAD, HEAVY = 1.3, 5.0  # how much wider than the posterior's the other density is, and its degrees of freedom
FEW = 20  # draws; a mean over fewer says little

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
    pareto_k : (N,) shape of the tail of the importance weights; above 0.7 the term comes from an exact refit
    refitted : indices of those points
    """

    elpd: float
    se: float
    monte_carlo_sd: float
    pointwise: Array
    pareto_k: Array
    refitted: tuple[int, ...]


def leave_one_out(posterior: Posterior, data: Any, seed: int = 0, tell: Tell | None = None) -> LeaveOneOut:
    """ln p(y_i | y_-i) = ln of the mean of p(y_i | y_-i, x) over p(x | y_-i), for every point i.

    ``data`` is the InferenceData of a run of ``posterior``: its pointwise terms are ln p(y_i | y_-i, x) under the whole
    covariance, so that p(x | y) / p(y_i | y_-i, x) is what the other points say of x, whatever the correlation. Pareto
    smoothed importance sampling uses that; where its k exceeds 0.7, draws of a wider density are added, and where that
    does not do either, draws are led to the posterior of the other points and moved there.

    A. Vehtari, A. Gelman, J. Gabry, Stat. Comput. 27 (2017) 1413; P.-C. Bürkner, J. Gabry, A. Vehtari, Comput. Stat. 36
    (2021) 1243.
    """
    with warnings.catch_warnings():
        # arviz warns of large k; those points are refitted.
        warnings.simplefilter("ignore")
        found = arviz.loo(data, pointwise=True, var_name="force", scale="log")  # type: ignore[no-untyped-call]
    terms, k = found.loo_i.values.astype(float).copy(), found.pareto_k.values.astype(float)
    draws = np.stack([data.posterior[n].values.ravel() for n in posterior.hypothesis.names], axis=1)
    log_likelihood = data.log_likelihood["force"].values.reshape(len(draws), -1).astype(float)
    error = np.array([_smoothed_error(log_likelihood[:, i]) for i in range(len(terms))])
    rng = np.random.default_rng([seed, 2])
    bad = np.flatnonzero(~(k <= PARETO_K))
    log_posterior = data.sample_stats["lp"].values.ravel().astype(float)
    wide = _Wide(posterior, draws, log_posterior, log_likelihood, rng) if bad.size else None
    for i in bad:
        if tell is not None:
            tell(f"leaving out point {i + 1} of {len(terms)}")
        assert wide is not None
        terms[i], error[i], effective = wide.without(int(i))
        if effective < TRUSTED:
            terms[i], error[i] = _refitted(posterior, draws, int(i), rng)
    return LeaveOneOut(
        elpd=float(np.sum(terms)),
        se=float(np.sqrt(len(terms) * np.var(terms))),
        monte_carlo_sd=float(np.sqrt(np.sum(error**2))),
        pointwise=terms,
        pareto_k=k,
        refitted=tuple(int(i) for i in bad),
    )


def _smoothed_error(log_likelihood: Array) -> float:
    """Monte Carlo error of one term, from the spread of the raw weights 1 / p(y_i | ...)."""
    w = np.exp(np.min(log_likelihood) - log_likelihood)
    return float(np.sqrt(np.var(w) / len(w)) / np.mean(w))


class _Wide:
    """Draws of the posterior and of a wider density together, weighed as one mixture: enough for any one point less.

    With as many draws from each, the weight of x for a density p_i is p_i / (p / 2 Z + g / 2), bounded where either
    covers p_i (E. Veach, L. J. Guibas, SIGGRAPH 1995, 419: the balance heuristic).
    """

    def __init__(
        self, posterior: Posterior, draws: Array, log_posterior: Array, terms: Array, rng: np.random.Generator
    ) -> None:
        some = rng.permutation(len(draws))
        g = _spread(fit_mixture(draws[some[:LEARN_FROM]], rng))
        x = g.draw(rng, len(draws))
        e = posterior.evaluate(x)
        good = np.isfinite(e.log_posterior)
        more = np.zeros((len(x), terms.shape[1]))
        if np.any(good):
            more[good] = posterior.pointwise(x[good], e.force[good])
        self.terms = np.concatenate([terms, more])
        self.log_p = np.concatenate([log_posterior, np.where(good, e.log_posterior, -np.inf)])
        log_g = np.concatenate([g.log_density(draws), g.log_density(x)])
        log_z = 0.0
        for _ in range(BRIDGED):
            # Meng & Wong's iteration, for as many draws of one as of the other.
            self.log_q = np.logaddexp(self.log_p - log_z, log_g) - np.log(2.0)
            log_z = float(logsumexp(self.log_p - self.log_q) - np.log(len(self.log_p)))

    def without(self, i: int) -> tuple[float, float, float]:
        """(ln p(y_i | y_-i), its Monte Carlo error, effective number of draws) with p(x | y_-i) ~ p(x | y) / term_i."""
        a, b = self.log_p - self.log_q, self.log_p - self.terms[:, i] - self.log_q
        wa, wb = np.exp(a - np.max(a)), np.exp(b - np.max(b))
        value = float(logsumexp(a) - logsumexp(b))
        ratio = wa / np.mean(wa) - wb / np.mean(wb)
        return value, float(np.std(ratio) / np.sqrt(len(ratio))), float(np.sum(wb) ** 2 / np.sum(wb * wb))


def _spread(g: Mixture) -> Mixture:
    return Mixture(g.log_weights, g.means, SPREAD * g.roots, min(g.degrees, HEAVY))


def _refitted(posterior: Posterior, draws: Array, i: int, rng: np.random.Generator) -> tuple[float, float]:
    """(ln p(y_i | y_-i), its Monte Carlo error) from draws that are led to p(x | y) / p(y_i | y_-i, x).

    The ratio of the normalisations of these two is 1 / p(y_i | y_-i), and stepping stones between them find it even
    where the point lies so far out that hardly any draw of the other points' posterior foresees it.
    """

    def terms(x: Array) -> tuple[Array, Array]:
        e = posterior.evaluate(x)
        possible = np.isfinite(e.log_posterior)
        added = np.full(len(x), -np.inf)
        if np.any(possible):
            added[possible] = -posterior.pointwise(x[possible], e.force[possible])[:, i]
        return e.log_posterior, added

    start = draws[rng.choice(len(draws), min(REFITTED, len(draws)), replace=False)]
    log_ratio = np.array([led(terms, start[i::PARTS], rng, 1).log_ratio for i in range(PARTS)])
    # Each ratio is right in the mean, not its logarithm.
    value = -float(logsumexp(log_ratio) - np.log(PARTS))
    return value, float(np.std(log_ratio, ddof=1) / np.sqrt(PARTS))


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


def leave_range_out(posterior: Posterior, draws: Array, whole: Measurement, solve: Solve = api.solve) -> LeaveRangeOut:
    """ln p(y_h | y_f) = ln of the mean of N(y_h; F_h + S_hf S_ff^-1 (y_f - F_f), S_hh - S_hf S_ff^-1 S_fh).

    ``draws`` (B, k) are those of ``posterior``, whose measurement is ``whole`` up to some deflection; h are the other
    points. S is the covariance of the whole measurement, its own noise and the inferred one.

    Raises `SettingsError` if nothing is left out, or the noise model has coordinates other than the logarithms of a
    standard deviation and a length.
    """
    fitted = whole.deflection <= np.max(posterior.measurement.deflection) * (1 + 1e-9)
    if np.all(fitted):
        raise SettingsError("the fit has used the whole range, and nothing is left to be predicted")
    if np.count_nonzero(fitted) != len(posterior.measurement):
        raise SettingsError("the run was not made from the first part of this measurement")
    force = Forward(posterior.hypothesis, whole, whole.deflection, solve)(draws, reached=False).force
    noise = _carried(posterior, draws, whole)
    model = posterior.hypothesis.noise.bind(whole)
    held = np.flatnonzero(~fitted)
    log_p = np.full((len(draws), held.size), -np.inf)
    mean, variance = np.full((len(draws), held.size), np.nan), np.full((len(draws), held.size), np.nan)
    good = np.flatnonzero(np.all(np.isfinite(force), axis=1))
    for b in good:
        residual, covariance = whole.force - force[b], model.covariance(noise[b])
        shift, conditional = _conditional(covariance, residual, fitted)
        mean[b], variance[b] = force[b, held] + shift, np.diag(conditional)
        log_p[b] = _sequential(conditional, residual[held] - shift)
    return _summary(whole, held, good, log_p, mean, variance)


def _summary(
    whole: Measurement, held: NDArray[np.intp], good: NDArray[np.intp], log_p: Array, mean: Array, variance: Array
) -> LeaveRangeOut:
    total = np.cumsum(log_p, axis=1)
    count = len(log_p)
    cumulative = logsumexp(total, axis=0) - np.log(count) if good.size else np.full(held.size, -np.inf)
    terms = np.diff(cumulative, prepend=0.0) if good.size else cumulative
    w = np.exp(total[:, -1] - np.max(total[:, -1])) if good.size else np.zeros(1)
    effective = float(np.sum(w) ** 2 / np.sum(w * w)) if good.size else 0.0
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
    """(S_hf S_ff^-1 r_f, S_hh - S_hf S_ff^-1 S_fh)."""
    ff, hf = covariance[np.ix_(fitted, fitted)], covariance[np.ix_(~fitted, fitted)]
    gain = np.linalg.solve(ff, hf.T).T
    rest = covariance[np.ix_(~fitted, ~fitted)] - gain @ hf.T
    return gain @ residual[fitted], 0.5 * (rest + rest.T)


def _sequential(covariance: Array, residual: Array) -> Array:
    """(M,) ln N of each residual given those before it: -z^2/2 - ln L_jj - ln(2 pi)/2, S = L L^T and z = L^-1 r."""
    root = np.linalg.cholesky(covariance)
    z = np.linalg.solve(root, residual)
    return np.asarray(-0.5 * z * z - np.log(np.diag(root)) - 0.5 * np.log(2 * np.pi))


def _carried(posterior: Posterior, draws: Array, whole: Measurement) -> Array:
    """Noise coordinates (B, m) that mean for ``whole`` what those of the draws mean for the fitted part.

    They are relative to the largest force and to the median step, and both change with the range.
    """
    part = posterior.measurement
    shifts = {
        "ln_sd": np.log(force_scale(part) / force_scale(whole)),
        "ln_length": np.log(_median_step(part) / _median_step(whole)),
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
