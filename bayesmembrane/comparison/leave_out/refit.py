"""The posterior of all points but one, drawn by itself: for points that nothing else says enough of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayesmembrane.calibration.posterior import Outcomes, Posterior
from bayesmembrane.calibration.sampling.proposals.independent import independent
from bayesmembrane.calibration.sampling.proposals.mixture import Mixture, fit_mixture
from bayesmembrane.calibration.sampling.proposals.proposing import proposing
from bayesmembrane.calibration.sampling.weights import worth
from bayesmembrane.calibration.starts import Tried, evolved, tempered
from bayesmembrane.comparison.leave_out.pool import UNSEEN
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.noise.base import force_scale

BLIND, EXACT = 30.0, 1e-7
"""Of the largest force: the noise of a reading that says nothing, and that of one whose own noise is not known."""
LEARN_FROM, OF_THEM, EACH = 1500, 500, 600
"""Draws of the whole posterior that a mixture is fitted to, of which some are tried again, and draws of each width."""
WIDTHS, HEAVY = (1.3, 2.5, 4.0), 5.0
"""Of that mixture, for the posterior of fewer points is wider; and its degrees of freedom at most."""
ROUNDS, PARENTS = 4, 300
"""Of differential evolution, and points that it begins at."""
CHECKED = 2000
"""Draws that give the integral."""


def log_integral_without(posterior: Posterior, i: int, draws: Array, rng: np.random.Generator) -> tuple[float, float]:
    """(ln int p0(x) p(y_-i | x) dx, its standard error), with the prior p0 as the posterior has it.

    The reading keeps its place, with a noise of its own of `BLIND` times the largest force: what it then makes of any
    curve is one over that and the root of two pi, to a thousandth, and every scale of the prior stays what it was.
    ``draws`` (M, k) of the whole posterior say where to look. The error is infinite where no proposal is found.
    """
    blind, sd = _blinded(posterior.measurement, i)
    target, counts = replace(posterior, measurement=blind), Outcomes()
    try:
        close = independent(target, _tried(target, draws, rng, counts), rng, counts)
    except (SettingsError, np.linalg.LinAlgError):
        close = None
    if close is None:
        return -np.inf, np.inf
    proposal = proposing(target, close.mixture)
    found = worth(proposal.solved(proposal.drawn(rng, CHECKED)).log_weights)
    unseen = UNSEEN / max(found.efficiency * CHECKED, 1.0)
    return found.log_mean + float(np.log(sd * np.sqrt(2 * np.pi))), max(found.log_mean_sd, unseen)


def _blinded(m: Measurement, i: int) -> tuple[Measurement, float]:
    """The measurement with a reading that says nothing, and the standard deviation of that."""
    own, scale = m.noise_covariance, force_scale(m)
    covariance = np.diag(np.full(len(m), (EXACT * scale) ** 2)) if own is None else np.array(own)
    covariance[i], covariance[:, i] = 0.0, 0.0
    covariance[i, i] = (BLIND * scale) ** 2
    return replace(m, covariance=covariance, force_sd=None), BLIND * scale


def _tried(target: Posterior, draws: Array, rng: np.random.Generator, counts: Outcomes) -> Tried:
    """Points around the posterior of the other readings: draws of all of them, wider ones, and what evolves of both."""
    some = draws[rng.permutation(len(draws))[:LEARN_FROM]]
    g = fit_mixture(some, rng)
    degrees = min(g.degrees, HEAVY)
    wider = [Mixture(g.log_weights, g.means, w * g.roots, degrees).draw(rng, EACH) for w in WIDTHS]
    tried = Tried.of(target, np.concatenate([some[:OF_THEM], *wider]), counts)
    for _ in range(ROUNDS):
        good = tried.possible
        parents = good.x[tempered(good.log_posterior, PARENTS / 2, PARENTS, rng)]
        tried = tried.joined(Tried.of(target, evolved(parents, rng), counts))
    return tried
