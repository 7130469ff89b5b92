"""The posterior of all points but one, drawn by itself: for points that nothing else says enough of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayesmembrane.calibration.posterior import Outcomes, Posterior
from bayesmembrane.calibration.sampling.proposals.independent import independent
from bayesmembrane.calibration.sampling.proposals.mixture import fit_mixture
from bayesmembrane.calibration.sampling.proposals.proposing import proposing
from bayesmembrane.calibration.sampling.weights import worth
from bayesmembrane.calibration.starts import Tried, try_points
from bayesmembrane.comparison.leave_out.pool import UNSEEN
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.noise.base import force_scale

BLIND, EXACT = 30.0, 1e-11
"""Of the largest force: the noise of a reading that says nothing, and that of one whose own noise is not known."""
LEARN_FROM, OF_THEM, EACH = 1500, 300, 300
"""Draws of the whole posterior that a mixture is fitted to, of which some are tried again, and draws of each width."""
WIDTHS, HEAVY = (1.3, 2.5, 4.0), 5.0
"""Of that mixture, for the posterior of fewer points is wider; and its degrees of freedom at most."""
POSSIBLE = 300
"""Points that have to be possible films."""
GOOD_ENOUGH, CHECKED = 0.1, 2000
"""Efficiency of a proposal, and draws of it that give the integral: to 0.07."""
LOOSE = 0.2
"""An error of this size is worth another proposal."""


def log_integral(posterior: Posterior, draws: Array, rng: np.random.Generator) -> tuple[float, float]:
    """(ln int p0(x) p(y | x) dx, its standard error), by the weights of independent proposals.

    ``draws`` (M, k) of the posterior, or one that is close, say where to look. The error is infinite where no proposal
    is found.
    """
    value, error = -np.inf, np.inf
    for enough in (GOOD_ENOUGH, None):  # the second time one as good as a walk wants
        value, error = _integrated(posterior, draws, rng, enough)
        if error < LOOSE:
            break
    return value, error


def _integrated(
    posterior: Posterior, draws: Array, rng: np.random.Generator, enough: float | None
) -> tuple[float, float]:
    counts = Outcomes()
    try:
        close = independent(posterior, _tried(posterior, draws, rng, counts), rng, counts, enough)
    except (SettingsError, np.linalg.LinAlgError):
        close = None
    if close is None:
        return -np.inf, np.inf
    proposal = proposing(posterior, close.mixture)
    found = worth(proposal.solved(proposal.drawn(rng, CHECKED)).log_weights)
    return found.log_mean, max(found.log_mean_sd, UNSEEN / max(found.efficiency * CHECKED, 1.0))


def log_integral_without(posterior: Posterior, i: int, draws: Array, rng: np.random.Generator) -> tuple[float, float]:
    """(ln int p0(x) p(y_-i | x) dx, its standard error), with the prior p0 as the posterior has it.

    The reading keeps its place, with a noise of its own of `BLIND` times the largest force: what it then makes of any
    curve is one over that and the root of two pi, to a thousandth, and every scale of the prior stays what it was. A
    covariance whose smallest eigenvalue is less than 1e-10 of the largest force squared loses digits beside it.
    """
    m, sd = posterior.measurement, BLIND * force_scale(posterior.measurement)
    value, error = log_integral(replace(posterior, measurement=_blinded(m, i, sd)), draws, rng)
    return value + float(np.log(sd * np.sqrt(2 * np.pi))), error


def _blinded(m: Measurement, i: int, sd: float) -> Measurement:
    """The measurement with a noise ``sd`` (N) of one reading; no covariance where it has none, which costs the most."""
    if m.covariance is None:
        own = np.full(len(m), EXACT * force_scale(m)) if m.force_sd is None else np.array(m.force_sd)
        own[i] = sd
        return replace(m, force_sd=own)
    covariance = np.array(m.covariance)
    covariance[i], covariance[:, i] = 0.0, 0.0
    covariance[i, i] = sd**2
    return replace(m, covariance=covariance, force_sd=None)


def _tried(target: Posterior, draws: Array, rng: np.random.Generator, counts: Outcomes) -> Tried:
    """Points around the posterior of the other readings: draws of all of them, wider ones, and what evolves of both."""
    some = draws[rng.permutation(len(draws))[:LEARN_FROM]]
    g = fit_mixture(some, rng)
    wider = [g.broader(times, min(g.degrees, HEAVY)).draw(rng, EACH) for times in WIDTHS]
    return try_points(target, rng, POSSIBLE, counts, np.concatenate([some[:OF_THEM], *wider]))
