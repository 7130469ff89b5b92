"""Whether the data ask for films that the convexity prior rules out: then the prior decides, and not they."""

from __future__ import annotations

import numpy as np

from bayesmembrane.calibration.joint.posterior import JointPosterior
from bayesmembrane.calibration.posterior import Posterior, weighed
from bayesmembrane.ground.parameters import Array

ROUNDS, POINTS, LEAST, READINGS = 4, 128, 16, 50_000
"""Searches, films in each of them, no less than so many, and readings that all films of one may have together."""
WIDER = 1.5


def ruled_out_gain(posterior: Posterior | JointPosterior, x: Array, log_posterior: Array, seed: int) -> float | None:
    """By how much ln p(x | y) is larger, at least, at a film that convexity rules out than at the best draw.

    x (..., k) are draws, with ``log_posterior`` (...). Films are tried around the best one, as far apart as the draws
    are, then around the best of them, with the next weaker convexity prior. 0 if none is better; None where the prior
    asks nothing.
    """
    wider = posterior.with_weaker_convexity
    if wider is None:
        return None
    rng, count = np.random.default_rng([seed, 3]), max(LEAST, min(POINTS, READINGS // posterior.readings))
    x, log_posterior = x.reshape(-1, x.shape[-1]), log_posterior.ravel()
    chosen = rng.integers(len(x), size=4 * count)
    some = x[chosen]
    apart = WIDER * (some - some.mean(axis=0)) / np.sqrt(len(some))  # z @ apart has the covariance of the draws
    best = some[int(np.argmax(log_posterior[chosen]))]
    highest = within = float(weighed(wider, best[None]).log_posterior[0])
    for _ in range(ROUNDS):
        tried = best + rng.standard_normal((count, len(some))) @ apart
        tried = tried[~posterior.prior.surely_inside(tried)]  # of the others none is ruled out
        if not len(tried):
            continue
        lp = weighed(wider, tried).log_posterior
        if np.nanmax(lp) > highest:
            best, highest = tried[int(np.nanargmax(lp))], float(np.nanmax(lp))
    allowed = bool(np.isfinite(weighed(posterior, best[None]).log_prior[0]))
    return 0.0 if allowed else highest - within
