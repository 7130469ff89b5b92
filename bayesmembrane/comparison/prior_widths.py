"""What ln Z would be under priors of another width, from the draws that there are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.calibration.sampling.convergence import effective_draws
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.parameters import Array, Prior, Uniform
from bayesmembrane.physics.forward import Forward, Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.mechanics import api

FACTORS = (0.5, 1.0, 2.0)
SURVEYED = 2048
WIDTHS = ("sd", "spread", "scale")  # what priors call their width, if it is one number
Ratio = Callable[[int, float], tuple[float, float]]

LEAST_ESS = 100.0
LARGEST_SHARE = 0.1  # of the sum that a single weight may hold


@dataclass(frozen=True)
class Widened:
    """ln Z with one prior of another width, minus ln Z as it is.

    Attributes
    ----------
    parameter, factor : whose prior, and its width relative to the one used
    change, sd : of ln Z, with its standard error
    ess : how many equally weighted draws the reweighted ones are worth
    reason : "" if the reweighting is valid; or why it is not, as a sentence, and ``change`` is nan
    """

    parameter: str
    factor: float
    change: float
    sd: float
    ess: float
    reason: str


def prior_widths(
    posterior: Posterior,
    draws: Array,
    effective: float,
    seed: int = 0,
    factors: Sequence[float] = FACTORS,
    solve: Solve = api.solve,
) -> tuple[Widened, ...]:
    """Z'/Z = mean of p'(x) / p(x) over the posterior of the prior p, times mass / mass' of the two truncated priors.

    ``draws`` (B, k) are those of ``posterior`` and worth ``effective`` independent ones. Normal priors keep their mean,
    uniform ones their middle. The masses come from one survey of the widest prior, reweighted. A wider uniform prior
    allows what no draw has seen, and weights that rest on a few draws say nothing: then the reason is given.
    """
    parameters = posterior.hypothesis.parameters
    masses = _masses(posterior.hypothesis, posterior.measurement, max([1.0, *factors]), seed, solve)
    worth = min(1.0, effective / len(draws))
    found = []
    for i, p in enumerate(parameters):
        for factor in factors:
            wider = scaled(p.prior, factor)
            if wider is None or (isinstance(p.prior, Uniform) and factor > 1):
                why = f"Draws under the prior of {p.name} say nothing of one that allows more: sample again with it."
                found.append(Widened(p.name, factor, np.nan, np.nan, 0.0, why))
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
    w = np.exp(log_ratio - np.max(log_ratio))
    ess = worth * effective_draws(w)
    log_mass, log_mass_sd = mass
    change = float(np.max(log_ratio) + np.log(np.mean(w))) - log_mass
    sd = float(np.hypot(np.std(w) / np.mean(w) / np.sqrt(worth * len(w)), log_mass_sd))
    if not np.isfinite(log_mass) or ess < LEAST_ESS or np.max(w) > LARGEST_SHARE * np.sum(w):
        why = f"Reweighted to {factor:g} times the width, the draws are worth only {ess:.0f}: sample again with it."
        return Widened(name, factor, np.nan, np.nan, ess, why)
    return Widened(name, factor, change, sd, ess, "")


def _masses(hypothesis: Hypothesis, measurement: Measurement, widest: float, seed: int, solve: Solve) -> Ratio:
    """(i, factor) -> ln(mass with the i-th prior scaled / mass as it is) and its error."""
    if hypothesis.convexity == "none":
        return lambda i, factor: (0.0, 0.0)
    priors = [p.prior for p in hypothesis.parameters[: hypothesis.curve_size]]
    wide = [scaled(p, widest) or p for p in priors]
    rng = np.random.default_rng([seed, 3])
    x = np.stack([p.draw(rng, SURVEYED) for p in wide], axis=1)
    only = {"reached": "convex", "elliptic": "elliptic"}.get(hypothesis.convexity, "all")
    prediction = Forward(hypothesis, measurement, measurement.deflection, solve)(x, only=only)
    margin = prediction.margin(hypothesis.convexity, hypothesis)
    inside = margin > 0 if hypothesis.convexity == "elliptic" else margin >= 0
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
