"""What draws of a proposal are worth for a posterior, by their importance weights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayesmembrane.calibration.sampling.convergence import effective_draws
from bayesmembrane.ground.draws import pareto_shape
from bayesmembrane.ground.parameters import Array

GOOD_K = 0.7
"""Up to this Pareto shape of the largest weights their means can be relied on at sizes that one can afford
(A. Vehtari et al., J. Mach. Learn. Res. 25 (2024) 72, section 3.2)."""
FEWEST = 50
"""Fewer positive weights say nothing of their tail."""


@dataclass(frozen=True)
class Worth:
    """What n draws y ~ g with weights w = p(y) / g(y) say of p, which need not be normalised.

    Attributes
    ----------
    k_hat : Pareto shape of the largest weights; inf where there are too few
    efficiency : effective draws for each draw, (sum w)^2 / (n sum w^2)
    acceptance : of independent proposals from g, between states that are drawn from p
    log_mean, log_mean_sd : ln of the mean weight, which is ln of the integral of p, and its standard error
    """

    k_hat: float
    efficiency: float
    acceptance: float
    log_mean: float
    log_mean_sd: float

    @property
    def good(self) -> bool:
        """Whether the proposal can be relied on."""
        return self.k_hat <= GOOD_K

    @property
    def tau(self) -> float:
        """Steps of a chain for one independent draw: 2 / acceptance - 1, if all states were alike."""
        return 2 / self.acceptance - 1 if self.acceptance > 0 else np.inf


NOTHING = Worth(np.inf, 0.0, 0.0, -np.inf, np.inf)


def worth(log_weights: Array) -> Worth:
    """The worth of draws with the weights ``log_weights`` (n,); -inf is a draw that p rules out, nan none at all."""
    lw = log_weights[~np.isnan(log_weights)]
    positive = lw[lw > -np.inf]
    if len(positive) < FEWEST:
        return NOTHING
    w = np.exp(lw - np.max(lw))
    k_hat = pareto_shape(positive)
    efficiency = effective_draws(w) / len(w)
    return Worth(
        k_hat=k_hat,
        efficiency=efficiency,
        acceptance=_acceptance(w),
        log_mean=float(np.log(np.mean(w)) + np.max(lw)),
        log_mean_sd=float(np.sqrt(max(0.0, (1 / efficiency - 1) / len(w)))),
    )


def _acceptance(w: Array) -> float:
    """sum_ij w_i min(1, w_j / w_i) / (n sum w) = sum_ij min(w_i, w_j) / (n sum w), from sorted weights."""
    s, n = np.sort(w), len(w)
    # The i-th smallest is the minimum of itself with those above it, twice, and of itself with itself.
    return float(np.sum(s * (2 * (n - np.arange(n)) - 1)) / (n * np.sum(s)))
