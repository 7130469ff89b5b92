"""ln Z from draws of the posterior, by bridge sampling; the draws may be its own where nobody has sampled yet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from bayesmembrane.calibration.sampling.convergence import effective_steps
from bayesmembrane.calibration.sampling.proposals.mixture import Mixture, fit_mixture, reweighted
from bayesmembrane.comparison.evidence.population import from_prior
from bayesmembrane.comparison.evidence.search import Modes, search
from bayesmembrane.comparison.evidence.target import EvidenceEstimate, Problem, Target
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array

PROPOSED, PILOT = 4000, 1000
FEWEST_PROPOSED, FOR_A_DRAW = 1000, 2.0  # proposals: more than so many for what draws are worth change little
FITTED, USED = 4000, 6000  # most draws of a half that a mixture is fitted to, and that the bridge stands on
WALKERS, SNAPSHOTS = 500, 6
SERIES = 50  # steps from which on autocorrelation along them can be seen
FEWEST = 200


def bridge(
    target: Target,
    draws: Array | None = None,
    *,
    seed: int = 0,
    effective: float | None = None,
    log_posterior: Array | None = None,
    searched: Target | None = None,
) -> EvidenceEstimate:
    """Z = E_g[p h] / E_posterior[g h] for p = prior x likelihood, a normalised g, and h = 1 / (s1 p + s2 Z g).

    g is a mixture of t-distributions fitted to one half of the draws, and the other half is what it is compared with;
    then the halves change places, and ln Z is the mean of both. s1 : s2 are the effective numbers of draws and
    proposals. Where ``draws`` is None, two independent populations are led to the posterior first: half of each from
    the prior, half from the modes that a `search` from points that fill the prior has found. Where there are draws, the
    search tells whether they have ``missed`` a mode.

    Parameters
    ----------
    draws : (E, S, W, k) steps of W walkers of E ensembles, or (n, k) in the order in which they were drawn
    effective : what n flat draws are worth; needed with them
    log_posterior : log prior + log likelihood at the draws, if it is known; it saves evaluations
    searched : the same integral over fewer coordinates, if there is one, in which modes are searched where draws are
        given

    The standard error counts the spread of both averages, with the autocorrelation of the draws, and is never less than
    what the two halves differ by. X.-L. Meng, W. H. Wong, Statistica Sinica 6 (1996) 831; S. Frühwirth-Schnatter,
    Econometrics J. 7 (2004) 143; Q. F. Gronau et al., J. Math. Psychol. 81 (2017) 80.

    Raises `SettingsError` for draws of another shape, fewer than 200 of them, or ones that the posterior rules out.
    """
    problem, rng = Problem(target), np.random.default_rng([seed, 4])
    sought = problem if searched is None else Problem(searched)
    modes = search(sought, np.random.default_rng([seed, 10]))
    check: tuple[float, float] | None = None
    if draws is None:
        halves, check = _own(problem, modes, rng)
    else:
        halves = _halves(problem, np.asarray(draws, dtype=float), effective, log_posterior)
    first, second = halves
    found = [_bridged(problem, first, second, rng), _bridged(problem, second, first, rng)]
    value, sd = _mean(found)
    if check is not None:
        # The way from the prior gives an estimate of its own, less exact: a gross difference is an error of either.
        sd = max(sd, 0.5 * (abs(value - check[0]) - 2.0 * check[1]))
    parts, missed = tuple(z for z, _ in found), modes.beyond(value, sd)
    evaluations = problem.evaluations + (0 if searched is None else sought.evaluations)
    return EvidenceEstimate(value, sd, evaluations, problem.seconds, parts, modes.coverage, missed)


@dataclass(frozen=True, eq=False)
class _Half:
    """x (S, W, k), ln p there (S, W), and what they are worth, or None: to be found from the series."""

    x: Array
    log_p: Array
    effective: float | None

    def error(self, values: Array) -> float:
        """Standard error of the mean of values (S, W)."""
        steps, walkers = values.shape
        sd = float(np.std(values))
        if self.effective is not None:
            return float(sd / np.sqrt(self.effective))
        error = 0.0
        if walkers > 1:
            error = float(np.std(values.mean(axis=0), ddof=1) / np.sqrt(walkers))
        series = values.mean(axis=1)
        if steps >= SERIES and np.ptp(series) > 0:
            error = max(error, float(np.std(series) / np.sqrt(effective_steps(series))))
        return error

    def worth(self) -> float:
        """Effective number of draws: the least over the coordinates and ln p."""
        if self.effective is not None:
            return self.effective
        columns = [self.x[..., i] for i in range(self.x.shape[-1])]
        ratios = [np.var(c) / max(self.error(c), 1e-300) ** 2 for c in columns if np.ptp(c) > 0]
        return float(np.clip(min(ratios, default=1.0), 1.0, self.log_p.size))


def _own(problem: Problem, modes: Modes, rng: np.random.Generator) -> tuple[list[_Half], tuple[float, float]]:
    """Two independent populations, and the mean of their stepping stones with its error."""
    walkers = max(WALKERS, 80 * problem.size)
    led = [from_prior(problem, modes, r, walkers, SNAPSHOTS) for r in rng.spawn(2)]
    halves = [_Half(p.x, p.log_base + p.log_added, None) for p in led]
    a, b = (p.log_ratio for p in led)
    sd = max(np.hypot(led[0].sd, led[1].sd), abs(a - b)) / 2
    return halves, (0.5 * (a + b), float(sd))


def _halves(problem: Problem, draws: Array, effective: float | None, log_posterior: Array | None) -> list[_Half]:
    """Ensembles, or what was drawn first and last, as two halves."""
    if draws.ndim not in (2, 4) or draws.shape[-1] != problem.size:
        raise SettingsError(
            f"draws of the shape {draws.shape} are neither (n, {problem.size}) nor "
            f"(ensembles, steps, walkers, {problem.size})"
        )
    if draws.ndim == 2 and effective is None:
        raise SettingsError(
            "flat draws need their effective number", remedy="give effective=, or keep steps and walkers"
        )
    if draws.size < FEWEST * problem.size:
        raise SettingsError(
            f"{draws.size // problem.size} draws are too few for their evidence", remedy="sample longer"
        )
    if draws.ndim == 2:
        draws = draws[None, :, None, :]
    known = None if log_posterior is None else np.asarray(log_posterior, dtype=float).reshape(draws.shape[:-1])
    ensembles, steps = draws.shape[:2]
    # Half the ensembles, or half of the steps of the only one.
    axis, cut = (0, ensembles // 2) if ensembles > 1 else (1, steps // 2)
    halves = []
    for part in (slice(None, cut), slice(cut, None)):
        at = (part, slice(None)) if axis == 0 else (slice(None), part)
        x, log_p = _laid_out(draws[at]), None if known is None else _laid_out(known[at][..., None])[..., 0]
        some = np.linspace(0, len(x) - 1, max(1, min(len(x), USED // x.shape[1]))).astype(int)
        x = x[some]
        log_p = (
            problem.log_posterior(x.reshape(-1, problem.size)).reshape(x.shape[:2]) if log_p is None else log_p[some]
        )
        if not np.all(np.isfinite(log_p)):
            raise SettingsError("the target rules out some of the draws", remedy="give draws of this very target")
        share = len(draws[at].reshape(-1, problem.size)) / (draws.size / problem.size)
        halves.append(_Half(x, log_p, None if effective is None else min(effective * share, log_p.size)))
    return halves


def _laid_out(x: Array) -> Array:
    """Ensembles (E, S, W, k) side by side as walkers, (S, E W, k)."""
    return np.moveaxis(x, 0, 1).reshape(x.shape[1], -1, x.shape[-1])


def _bridged(problem: Problem, fitted: _Half, compared: _Half, rng: np.random.Generator) -> tuple[float, float]:
    """(ln Z, standard error) with g from one half and the draws of the other."""
    g, n1 = _proposal(problem, fitted, rng), compared.worth()
    y = g.draw(rng, int(np.clip(FOR_A_DRAW * n1, FEWEST_PROPOSED, PROPOSED)))
    at_proposals = problem.log_posterior(y) - g.log_density(y)
    if not np.any(np.isfinite(at_proposals)):
        return np.nan, np.inf
    flat = compared.x.reshape(-1, problem.size)
    at_draws = compared.log_p - g.log_density(flat).reshape(compared.log_p.shape)
    n2 = float(len(y))
    log_z = _fixed_point(at_draws.ravel(), at_proposals, n1, n2)
    # f1 = p / (s1 p + s2 Z g) over the proposals, f2 = g / (the same) over the draws; with p / (Z g) = exp(d).
    s1, s2 = n1 / (n1 + n2), n2 / (n1 + n2)
    f1 = 1 / (s1 + s2 * np.exp(np.minimum(log_z - at_proposals, 700.0)))
    f2 = 1 / (s1 * np.exp(np.minimum(at_draws - log_z, 700.0)) + s2)
    variance = np.var(f1) / n2 / np.mean(f1) ** 2 + (compared.error(f2) / np.mean(f2)) ** 2
    return log_z, float(np.sqrt(variance))


def _proposal(problem: Problem, half: _Half, rng: np.random.Generator) -> Mixture:
    """The mixture fitted to the draws, its component weights corrected by importance sampling.

    That makes the answer robust against walkers that are spread wrongly over separate modes: where g is right, it does
    not matter how many draws each mode holds.
    """
    flat = half.x.reshape(-1, problem.size)
    g = fit_mixture(flat[np.linspace(0, len(flat) - 1, min(len(flat), FITTED)).astype(int)], rng)
    if len(g.means) == 1:
        return g
    y = g.draw(rng, PILOT)
    d = problem.log_posterior(y) - g.log_density(y)
    if not np.any(np.isfinite(d)):
        return g
    w = np.exp(d - np.max(d))
    return reweighted(g, y, np.minimum(w, np.sqrt(len(w)) * np.mean(w)))


def _fixed_point(at_draws: Array, at_proposals: Array, n1: float, n2: float) -> float:
    """ln Z with Z = mean(l2 / (s1 l2 + s2 Z)) / mean(1 / (s1 l1 + s2 Z)), l = p / g at draws (1) and proposals (2)."""
    log_s1, log_s2 = np.log(n1 / (n1 + n2)), np.log(n2 / (n1 + n2))
    log_z = float(np.median(at_draws))
    for _ in range(1000):
        above = logsumexp(at_proposals - np.logaddexp(log_s1 + at_proposals, log_s2 + log_z)) - np.log(
            at_proposals.size
        )
        below = logsumexp(-np.logaddexp(log_s1 + at_draws, log_s2 + log_z)) - np.log(at_draws.size)
        new = float(above - below)
        if abs(new - log_z) < 1e-8:
            return new
        log_z = new
    return log_z


def _mean(found: list[tuple[float, float]]) -> tuple[float, float]:
    """Mean of two halves, its standard error no less than half of what they differ by."""
    (a, sa), (b, sb) = found
    return 0.5 * (a + b), 0.5 * max(float(np.hypot(sa, sb)), abs(a - b))
