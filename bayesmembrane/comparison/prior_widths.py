"""What ln Z would be under priors of another width, from the draws that there are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np

from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.calibration.prior import JointPrior
from bayesmembrane.calibration.sampling.convergence import effective_draws
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.draws import pareto_shape
from bayesmembrane.ground.parameters import Array, Prior, Uniform
from bayesmembrane.ground.plain import plain
from bayesmembrane.physics.forward import Forward, Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.mechanics import api

FACTORS = (0.5, 1.0, 2.0)
SURVEYED = 2048
WIDTHS = ("sd", "spread", "scale")  # what priors call their width, if it is one number
Ratio = Callable[[int, float], tuple[float, float]]

LEAST_ESS = 100.0
LARGEST_SHARE = 0.1  # of the sum that a single weight may hold
BATCHES = 20  # of draws in their order, by which the error of a mean of correlated weights is told
HEAVIEST = 0.7  # tail index of the weights from which on their mean says nothing, and less with few draws
MOST_TAIL = 0.9


class Unknown(Enum):
    """Why the draws do not tell what another width would do."""

    NOT_COVERED = "the other prior allows what these draws have not seen"
    FEW = "the draws are worth too few under the other prior"
    HEAVY = "a few draws far out count most"


@dataclass(frozen=True)
class Widened:
    """ln Z with one prior of another width, minus ln Z as it is.

    Attributes
    ----------
    parameter, factor : whose prior, and its width relative to the one used
    change, sd : of ln Z, with its standard error
    ess : how many equally weighted draws the reweighted ones are worth
    tail_index : of the weights, nan where it was not looked at
    unknown : None if the reweighting is valid; or why it is not, and ``change`` is nan
    """

    parameter: str
    factor: float
    change: float
    sd: float
    ess: float
    tail_index: float
    unknown: Unknown | None

    def summary(self) -> dict[str, Any]:
        """The numbers as plain values."""
        return dict(plain({n: getattr(self, n) for n in ("parameter", "factor", "change", "sd", "ess")}))


def prior_widths(
    posterior: Posterior,
    draws: Array,
    effective: float,
    seed: int = 0,
    factors: Sequence[float] = FACTORS,
    solve: Solve = api.solve,
) -> tuple[Widened, ...]:
    """Z'/Z = mean of p'(x) / p(x) over the posterior of the prior p, times mass / mass' of the two truncated priors.

    ``draws`` (B, k) are those of ``posterior``, in the order of the walk, and worth ``effective`` independent ones.
    Normal priors keep their mean, uniform ones their middle. The masses come from one survey of the widest prior,
    reweighted. A wider uniform prior allows what no draw has seen, and weights that rest on a few draws say
    nothing: then the reason is given.
    """
    parameters = posterior.hypothesis.parameters
    masses = _masses(posterior.hypothesis, posterior.measurement, max([1.0, *factors]), seed, solve)
    worth = min(1.0, effective / len(draws))
    found = []
    for i, p in enumerate(parameters):
        if p.name in posterior.hypothesis.known_coordinates:  # its width is no choice
            continue
        for factor in factors:
            wider = scaled(p.prior, factor)
            if wider is None or (isinstance(p.prior, Uniform) and factor > 1):
                found.append(Widened(p.name, factor, np.nan, np.nan, 0.0, np.nan, Unknown.NOT_COVERED))
                continue
            log_ratio = wider.log_density(draws[:, i]) - p.prior.log_density(draws[:, i])
            found.append(_reweighted(p.name, factor, log_ratio, worth, masses(i, factor)))
    return tuple(found)


def scaled(prior: Prior, factor: float) -> Prior | None:
    """The prior ``factor`` times as wide about its middle; None for a kind that has no width."""
    if isinstance(prior, Uniform):
        middle, half = 0.5 * (prior.low + prior.high), 0.5 * (prior.high - prior.low)
        return replace(prior, low=middle - factor * half, high=middle + factor * half)
    for width in WIDTHS:
        if hasattr(prior, width):
            return replace(prior, **{width: factor * getattr(prior, width)})
    return None


def _reweighted(name: str, factor: float, log_ratio: Array, worth: float, mass: tuple[float, float]) -> Widened:
    """ln of the mean weight over n draws worth ``worth`` n, less ln(mass' / mass); its error, or why there is none.

    The error of the mean is the larger of that of ``worth`` n independent weights and that of the means of batches,
    since weights may be correlated longer than coordinates. What lies beyond the largest weight is not in it: of a tail
    of index k that is about max(w) / (worth n (1 - k)), which counts as an error, too. Heavy tails are refused as in
    A. Vehtari et al., J. Mach. Learn. Res. 25 (2024) 72: k above min(0.7, 1 - 1 / log10 n_eff).
    """
    n = len(log_ratio)
    w = np.exp(log_ratio - np.max(log_ratio))
    w /= np.mean(w)
    ess = worth * effective_draws(w)
    log_mass, log_mass_sd = mass
    change = float(np.max(log_ratio) + np.log(np.mean(np.exp(log_ratio - np.max(log_ratio))))) - log_mass
    k = _tail_index(log_ratio, worth)
    thin = ess < LEAST_ESS or np.max(w) > LARGEST_SHARE * n
    if thin or not np.isfinite(log_mass):
        return Widened(name, factor, np.nan, np.nan, ess, k, Unknown.FEW)
    if k > min(HEAVIEST, 1 - 1 / np.log10(worth * n)):
        return Widened(name, factor, np.nan, np.nan, ess, k, Unknown.HEAVY)
    if np.ptp(w) == 0:
        return Widened(name, factor, change, log_mass_sd, ess, k, None)
    batches = np.array([np.mean(part) for part in np.array_split(w, BATCHES)])
    scatter = max(np.std(w) / np.sqrt(worth * n), np.std(batches, ddof=1) / np.sqrt(BATCHES))
    unseen = np.max(w) / (worth * n) / (1 - min(k + _index_sd(k, worth * n), MOST_TAIL))
    sd = float(np.sqrt(scatter**2 + unseen**2 + log_mass_sd**2))
    return Widened(name, factor, change, sd, ess, k, None)


def _tail_index(log_ratio: Array, worth: float) -> float:
    """Pareto index k of the largest weights; 0 where they are all alike, and so bounded."""
    largest = np.partition(log_ratio, -int(np.ceil(0.2 * len(log_ratio))))[-int(np.ceil(0.2 * len(log_ratio))) :]
    if np.ptp(largest) < 1e-6:
        return 0.0
    return pareto_shape(log_ratio, worth)


def _index_sd(k: float, effective: float) -> float:
    """Standard error of a Pareto index from the 3 sqrt(n_eff) largest weights: (1 + k) / sqrt(their number)."""
    return float((1 + max(k, 0.0)) / np.sqrt(3 * np.sqrt(effective)))


def _masses(hypothesis: Hypothesis, measurement: Measurement, widest: float, seed: int, solve: Solve) -> Ratio:
    """(i, factor) -> ln(mass with the i-th prior scaled / mass as it is) and its error."""
    if not hypothesis.convexity.restricts:
        return lambda i, factor: (0.0, 0.0)
    priors = [p.prior for p in hypothesis.parameters[: hypothesis.curve_size]]
    wide = [scaled(p, widest) or p for p in priors]
    rng = np.random.default_rng([seed, 3])
    x = np.stack([p.draw(rng, SURVEYED) for p in wide], axis=1)
    inside = JointPrior(hypothesis).met(x, Forward(hypothesis, measurement, measurement.deflection, solve))
    base = np.stack([p.log_density(x[:, j]) for j, p in enumerate(priors)], axis=1)
    source = sum(p.log_density(x[:, j]) for j, p in enumerate(wide))

    def ratio(i: int, factor: float) -> tuple[float, float]:
        if i >= len(priors) or factor == 1.0:
            return 0.0, 0.0
        other = base.copy()
        new = scaled(priors[i], factor)
        assert new is not None
        other[:, i] = new.log_density(x[:, i])
        a, b = (np.exp(np.sum(each, axis=1) - source) for each in (other, base))
        # Self-normalised masses of both, from the same draws; the error by the delta method.
        m1, m0 = np.sum(a * inside) / np.sum(a), np.sum(b * inside) / np.sum(b)
        if m1 <= 0 or m0 <= 0:
            return np.inf, np.inf
        pull = a * (inside / m1 - 1) / np.mean(a) - b * (inside / m0 - 1) / np.mean(b)
        return float(np.log(m1 / m0)), float(np.std(pull) / np.sqrt(len(pull)))

    return ratio
