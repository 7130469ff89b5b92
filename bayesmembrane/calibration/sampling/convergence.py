"""What draws are worth: autocorrelation times, effective sample sizes and R-hat, of chains, of series and of weights.

The one place for all of them; everything that counts draws asks here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayesmembrane.calibration.sampling.chains import Chains
from bayesmembrane.calibration.sampling.growing import picked, stretches
from bayesmembrane.ground.draws import rank_r_hat, worth_of_mean
from bayesmembrane.ground.parameters import Array

LEAST_TAUS = 50
BURN_TAUS = 10
LEAST_STEPS = 20  # fewer say nothing
R_HAT = 1.01
R_HAT_DRAWS = 2**18  # of each ensemble, at most


@dataclass(frozen=True, eq=False)
class Convergence:
    """What the chains are worth.

    Attributes
    ----------
    tau : (k,) integrated autocorrelation time in steps, averaged over walkers as emcee does, the worst ensemble's
    burn : steps left out at the start, the same in all ensembles
    ess : (k,) (steps - burn) x walkers / tau, added over ensembles
    r_hat : (k,) rank-normalised, between the halves of the ensembles (A. Vehtari et al., Bayesian Anal. 16 (2021) 667)
    acceptance : part of the proposals that were accepted after burn-in
    lengths : (steps - burn) / max tau
    """

    tau: Array
    burn: int
    ess: Array
    r_hat: Array
    acceptance: float
    lengths: float

    def enough(self, wanted: float) -> bool:
        """True if tau can be believed, every ESS is at least ``wanted`` and every R-hat at most 1.01."""
        return bool(self.lengths >= LEAST_TAUS and np.min(self.ess) >= wanted and np.max(self.r_hat) <= R_HAT)


def convergence(chains: Chains) -> Convergence:
    """Autocorrelation times, burn-in, ESS, R-hat and acceptance of what was walked so far.

    Burn-in is ten autocorrelation times of the second half, and half of the steps at most, but all the steps from which
    the proposal was learned.
    """
    steps, walkers = chains.x.shape[1:3]
    if steps < LEAST_STEPS:
        unknown = np.full(chains.x.shape[3], np.inf)
        return Convergence(unknown, 0, 1 / unknown, unknown, 0.0, 0.0)
    learned = max((s for s in chains.lessons if s <= steps - LEAST_STEPS), default=0)
    tau = autocorrelation_times(chains.x[:, max(learned, steps // 2) :])
    burn = max(learned, min(steps // 2, int(np.ceil(BURN_TAUS * np.max(tau)))))
    kept = chains.x[:, burn:]
    tau = autocorrelation_times(kept)
    enough = -(-kept.shape[1] * walkers // R_HAT_DRAWS)  # ranking more takes memory, and says no more
    some = picked(kept, np.arange(0, kept.shape[1], max(1, int(np.max(tau) / 4), enough)))
    flat = some.reshape(len(some), -1, some.shape[-1])
    return Convergence(
        tau=np.max(tau, axis=0),
        burn=burn,
        ess=np.sum(kept.shape[1] * walkers / tau, axis=0),
        r_hat=np.array([r_hat(flat[:, :, i]) for i in range(flat.shape[-1])]),
        acceptance=_moved(kept),
        lengths=float(kept.shape[1] / np.max(tau)),
    )


def r_hat(flat: Array) -> float:
    """Rank-normalised R-hat of (E, draws) in order of time: it splits each ensemble into halves itself."""
    if flat.shape[1] < 4 or np.ptp(flat) == 0:
        return np.inf
    return rank_r_hat(flat)


def autocorrelation_times(x: Array) -> Array:
    """(E, k) integrated autocorrelation times of x (E, steps, walkers, k); at least one step.

    One coordinate of one ensemble is held at a time.
    """
    from emcee.autocorr import integrated_time  # on demand: it imports scipy.stats, which takes a second

    tau = np.empty((x.shape[0], x.shape[3]))
    with np.errstate(all="ignore"):
        for e, i in np.ndindex(tau.shape):
            one = np.concatenate([part[0, :, :, i].copy() for part in stretches(x[e : e + 1])])
            tau[e, i] = integrated_time(one, tol=0, quiet=True)[0]
    return np.where(np.isfinite(tau), np.maximum(tau, 1.0), x.shape[1])


def _moved(x: Array) -> float:
    """Part of the walkers x (E, steps, walkers, k) that moved, of all steps after the first."""
    parts = (np.any(part[:, 1:] != part[:, :-1], axis=-1) for part in stretches(x, overlap=1))
    moved, all_of_them = np.sum([(np.count_nonzero(part), part.size) for part in parts], axis=0)
    return float(moved / all_of_them)


def effective_draws(weights: Array) -> float:
    """(sum w)^2 / sum w^2: how many equally weighted draws the weights (B,) >= 0 are worth; 0 if none is positive.

    L. Kish, Survey Sampling (1965), section 8.2.
    """
    total = np.sum(weights)
    return float(total**2 / np.sum(weights * weights)) if total > 0 else 0.0


def effective_steps(series: Array) -> float:
    """How many independent values the mean of a series (S,) in order of time is worth; at least one."""
    return max(worth_of_mean(series[None, :]), 1.0)
