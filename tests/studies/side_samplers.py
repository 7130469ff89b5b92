"""What users of other packages would write for the same posterior: each sampler as its documentation starts it.

All of them ask the same batched density; where a package asks for one point at a time, it gets one. A sampler is a
function of (posterior, seed) that returns `Found`. Packages are imported where they are used: they are in an
environment of their own (`side_by_side.txt`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

import bayesmembrane as bm
from bayesmembrane.calibration.fit import fit
from bayesmembrane.calibration.posterior import Posterior, weighed
from bayesmembrane.calibration.sampling.walk import Settings, run_ensembles
from bayesmembrane.comparison.evidence.bridge import bridge
from bayesmembrane.comparison.evidence.nested import nested
from bayesmembrane.comparison.evidence.target import PosteriorTarget
from bayesmembrane.ground.parameters import Array

WANTED = 1000  # effective draws
WALKERS, CHUNK, MOST_STEPS = 32, 1000, 20_000


@dataclass(frozen=True, eq=False)
class Found:
    """What one run of one sampler gave.

    x : (n, k) draws; weight : (n,), summing to one
    effective : how many independent draws they are worth, as the sampler itself says
    log_evidence : ln Z and its standard error, as the sampler itself says; None where it gives none
    evaluations : draws that were asked for, where the sampler is not all that asks
    """

    x: Array
    weight: Array
    effective: float
    log_evidence: tuple[float, float] | None = None
    evaluations: int | None = None

    @property
    def mean(self) -> Array:
        """(k,)"""
        return np.asarray(self.weight @ self.x)

    @property
    def sd(self) -> Array:
        """(k,)"""
        return np.sqrt(self.weight @ (self.x - self.mean) ** 2)


def even(x: Array) -> Array:
    return np.full(len(x), 1 / len(x))


def kish(weight: Array) -> float:
    """(sum w)^2 / sum w^2"""
    return float(np.sum(weight) ** 2 / np.sum(weight**2))


def normalised(log_weight: Array) -> Array:
    weight = np.exp(log_weight - np.max(log_weight))
    return np.asarray(weight / np.sum(weight))


@dataclass(frozen=True)
class Asked:
    """A posterior as other packages ask for it: in its own coordinates, and in the unit cube of its prior."""

    posterior: Posterior

    def log_posterior(self, x: Array) -> Array:
        """(B,) of x (B, k)"""
        return weighed(self.posterior, np.atleast_2d(x)).log_posterior

    def log_likelihood(self, x: Array) -> Array:
        """(B,) of x (B, k); -1e100 where the density is zero: not every package takes -inf."""
        found = weighed(self.posterior, np.atleast_2d(x))
        return np.where(found.log_prior > -np.inf, np.maximum(found.log_likelihood, -1e100), -1e100)

    def transform(self, u: Array) -> Array:
        """x of u in the unit cube, of the same shape."""
        return self.posterior.prior.transform(np.clip(u, 1e-15, 1 - 1e-15))


# ---- this package --------------------------------------------------------------------------------------------------


def ours(posterior: Posterior, seed: int) -> Found:
    """`bayesmembrane sample` with its checks, without its files; ln Z from the weights, where a mixture was found."""
    run = bm.sample(posterior.measurement, posterior.hypothesis, ess=WANTED, seed=seed)
    x, weights = run.draws(), run.status.get("importance")
    log_evidence = (weights["log_integral"], weights["log_integral_sd"]) if weights else None
    return Found(x, even(x), float(run.quality.ess), log_evidence, int(run.status["evaluations"]))


def ours_with_bridge(posterior: Posterior, seed: int) -> Found:
    """The first estimator of `bayesmembrane compare`: draws, and ln Z from them by bridge sampling."""
    sampled = run_ensembles(posterior, Settings(ess=WANTED), seed)
    chains, burn = sampled.chains, sampled.convergence.burn
    x, log_posterior = chains.x[:, burn:], chains.log_posterior[:, burn:]
    found = bridge(PosteriorTarget(posterior), x, seed=seed, log_posterior=log_posterior)
    flat = x.reshape(-1, posterior.size)
    return Found(flat, even(flat), float(np.min(sampled.convergence.ess)), (found.log_evidence, found.sd))


def ours_with_nested(posterior: Posterior, seed: int) -> Found:
    """The second estimator of `bayesmembrane compare`: nested sampling around the draws."""
    sampled = run_ensembles(posterior, Settings(ess=WANTED), seed)
    x = sampled.chains.x[:, sampled.convergence.burn :].reshape(-1, posterior.size)
    found = nested(PosteriorTarget(posterior), seed=seed, around=(x,))
    return Found(x, even(x), float(np.min(sampled.convergence.ess)), (found.log_evidence, found.sd))


def our_nested(posterior: Posterior, seed: int) -> Found:
    """Nested sampling of this package from the prior; it keeps no draws."""
    found = nested(PosteriorTarget(posterior), seed=seed)
    return Found(np.empty((0, posterior.size)), np.empty(0), np.nan, (found.log_evidence, found.sd))


# ---- others --------------------------------------------------------------------------------------------------------


def walked(asked: Asked, seed: int) -> Any:
    """A sampler of emcee as it comes, 32 walkers with stretch moves, and their start in a ball around the best fit."""
    import emcee

    posterior, rng = asked.posterior, np.random.default_rng(seed)
    best = fit(posterior.measurement, posterior.hypothesis, seed=seed)
    best = best.constrained or best
    noise = [np.log(max(best.rmse_N, 1e-4) / np.max(np.abs(posterior.measurement.force)))]
    centre = np.concatenate([best.coordinates, noise])[: posterior.size]
    x = centre + 1e-2 * rng.standard_normal((32 * WALKERS, posterior.size))
    start = x[asked.log_posterior(x) > -np.inf][:WALKERS]
    sampler = emcee.EnsembleSampler(WALKERS, posterior.size, asked.log_posterior, vectorize=True)
    sampler.random_state = np.random.RandomState(seed).get_state()
    return sampler, start


def plain_emcee(posterior: Posterior, seed: int) -> Found:
    """emcee as it comes, until 1000 effective draws and 50 autocorrelation times."""
    sampler, state = walked(Asked(posterior), seed)
    while sampler.iteration < MOST_STEPS:
        state = sampler.run_mcmc(state, CHUNK)
        tau = float(np.max(sampler.get_autocorr_time(quiet=True, tol=0)))
        burn = int(np.ceil(2 * tau))
        effective = (sampler.iteration - burn) * WALKERS / tau
        if effective > WANTED and sampler.iteration > 50 * tau:
            break
    x = sampler.get_chain(discard=burn, flat=True)
    return Found(x, even(x), effective)


def nautilus(posterior: Posterior, seed: int) -> Found:
    """nautilus with its defaults, vectorised, until 1000 effective draws."""
    from nautilus import Sampler

    asked = Asked(posterior)
    sampler = Sampler(asked.transform, asked.log_likelihood, n_dim=posterior.size, vectorized=True, seed=seed)
    sampler.run(n_eff=WANTED)
    x, log_weight, _ = sampler.posterior()
    return Found(x, normalised(log_weight), sampler.n_eff, (sampler.log_z, 1 / np.sqrt(sampler.n_eff)))


def dynesty(posterior: Posterior, seed: int) -> Found:
    """dynesty's static sampler with its defaults; it asks for one point at a time."""
    from dynesty import NestedSampler

    asked = Asked(posterior)

    def one(x: Array) -> float:
        return float(asked.log_likelihood(x)[0])

    sampler = NestedSampler(one, asked.transform, posterior.size, rstate=np.random.default_rng(seed))
    sampler.run_nested(print_progress=False)
    r = sampler.results
    weight = normalised(r.logwt)
    return Found(r.samples, weight, kish(weight), (r.logz[-1], r.logzerr[-1]))


def ultranest(posterior: Posterior, seed: int) -> Found:
    """UltraNest's reactive sampler with its defaults, vectorised, until 1000 effective draws."""
    from ultranest import ReactiveNestedSampler

    np.random.seed(seed)  # it draws from the global stream
    asked, names = Asked(posterior), [str(i) for i in range(posterior.size)]
    sampler = ReactiveNestedSampler(names, asked.log_likelihood, asked.transform, vectorized=True)
    r = sampler.run(show_status=False, viz_callback=False, min_ess=WANTED)
    drawn = r["weighted_samples"]
    weight = drawn["weights"] / np.sum(drawn["weights"])
    return Found(drawn["points"], weight, r["ess"], (r["logz"], r["logzerr"]))


def nuts(posterior: Posterior, seed: int) -> Found:
    """See `tests.studies.side_nuts`."""
    from tests.studies.side_nuts import on_an_emulator

    return on_an_emulator(posterior, seed)


SAMPLERS: dict[str, Callable[[Posterior, int], Found]] = {
    "bayesmembrane sample": ours,
    "bayesmembrane sample + bridge": ours_with_bridge,
    "bayesmembrane sample + nested": ours_with_nested,
    "bayesmembrane nested from the prior": our_nested,
    "emcee with stretch moves": plain_emcee,
    "nautilus": nautilus,
    "dynesty": dynesty,
    "UltraNest": ultranest,
    "NUTS on an emulator": nuts,
}
