"""Chains whose every step is proposed by one mixture, so that many steps are solved at once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bayesmembrane.calibration.posterior import Outcomes, Posterior
from bayesmembrane.calibration.sampling.chains import Chains
from bayesmembrane.calibration.sampling.growing import picked
from bayesmembrane.calibration.sampling.proposals.bend import bend_of, straight
from bayesmembrane.calibration.sampling.proposals.filling import NEAR, around_largest, joined
from bayesmembrane.calibration.sampling.proposals.generator import generator_of
from bayesmembrane.calibration.sampling.proposals.mixture import Mixture, fit_mixture, widened
from bayesmembrane.calibration.sampling.proposals.proposing import Proposing, proposing
from bayesmembrane.calibration.sampling.weights import Worth, worth
from bayesmembrane.ground.parameters import Array

BLOCK = 16
"""Steps that are solved at once. Blocks end at its multiples, so that a walk that goes on has the same ones."""
MANY, LOOKED_AT, MENDING = 2**18, 2000, 0.2
"""States of a long walk among which distinct ones are sought, those that are looked at for where a mixture holds
walkers up, and the weight of what is added there."""
FITTED_TO, SMEARED, WIDE, HEAVY = 4000, 0.15, 0.2, 5.0
"""States that a new mixture is fitted to, by how much of their spread each is moved, the weight of the wide component
beside that, and the degrees of freedom at most."""


@dataclass(frozen=True, eq=False)
class Leapt:
    """Steps: x (E, S, W, k), ln p and ln p / mixture of what was offered (E, S, W), and the generators after them."""

    x: Array
    log_posterior: Array
    offered: Array
    random_states: tuple[Any, ...]


def blocks(steps: float) -> int:
    """The least multiple of `BLOCK` that is no less than ``steps``."""
    return BLOCK * int(np.ceil(steps / BLOCK))


def leap(posterior: Posterior, mixture: Mixture, standing: Chains, steps: int, counts: Outcomes) -> Leapt:
    """``steps`` more of the walkers that stand at the end of ``standing``.

    y ~ g whatever the place x, accepted with min(1, w(y) / w(x)), w = p / g (W. K. Hastings, Biometrika 57 (1970) 97):
    what is proposed does not hang on where a walker stands, so that all of it can be solved before anybody moves.
    """
    x, lp = standing.x[:, -1], standing.log_posterior[:, -1]
    ensembles, walkers, k = x.shape
    proposal = proposing(posterior, mixture)
    drawn = [_drawn(proposal, state, steps * walkers) for state in standing.random_states]
    e = proposal.solved(np.concatenate([d[0] for d in drawn]))
    counts.note(e.x, e.outcome)
    shape = (ensembles, steps, walkers)
    log_y, offered = e.log_posterior.reshape(shape), e.log_weights.reshape(shape)
    chance = np.stack([d[1] for d in drawn]).reshape(shape)
    y = e.x.reshape(*shape, k)
    made, made_lp = np.empty_like(y), np.empty(shape)
    now = proposal.log_weights(x.reshape(-1, k), lp.ravel()).reshape(lp.shape)
    for step in range(steps):
        taken = chance[:, step] < offered[:, step] - now
        x = np.where(taken[..., None], y[:, step], x)
        lp, now = np.where(taken, log_y[:, step], lp), np.where(taken, offered[:, step], now)
        made[:, step], made_lp[:, step] = x, lp
    return Leapt(made, made_lp, offered, tuple(d[2] for d in drawn))


def offers(chains: Chains) -> Worth:
    """What all that it offered says of the mixture; what another one offered before the last lesson does not count."""
    return worth(np.empty(0) if chains.offered is None else chains.offered[:, chains.learned :].ravel())


def mended(posterior: Posterior, chains: Chains) -> Mixture | None:
    """A better mixture, from what was walked; None where that fills no volume.

    In turn one that is fitted anew to all that was walked but its first quarter, along the bend of that, and the same
    one with more components where it holds walkers up; the other way where one gives none. Each is for what the other
    cannot do: a new fit follows the bulk of a bent valley, which walkers fill better from one to the next, and leaves
    out what is rare.
    """
    assert chains.mixture is not None
    ways = [_fitted_anew, _with_more]
    for way in ways if len(chains.lessons) % 2 == 0 else reversed(ways):
        if (found := way(posterior, chains, chains.mixture)) is not None:
            return found
    return None


def _fitted_anew(posterior: Posterior, chains: Chains, old: Mixture) -> Mixture | None:
    """One for states of the walk, with heavier tails than it would have by itself."""
    rng = np.random.default_rng(chains.steps)
    x, _ = _walked(chains, chains.steps // 4)
    places = proposing(posterior, replace(old, bend=None)).places(x[rng.permutation(len(x))[:FITTED_TO]])
    try:
        way = bend_of(places)
        u = straight(way, places)
        # Where walkers were held up they are one place many times; moved along what they spread over, not across it.
        u = u + SMEARED * rng.standard_normal(u.shape) @ np.linalg.cholesky(np.atleast_2d(np.cov(u.T))).T
        found = widened(replace(fit_mixture(u, rng), bend=way), u, WIDE)
    except np.linalg.LinAlgError:
        return None
    return replace(found, degrees=min(found.degrees, HEAVY))


def _with_more(posterior: Posterior, chains: Chains, old: Mixture) -> Mixture | None:
    """The same with components where walkers are held up.

    A walker stands where w = p / g is large, which a few thousand weights of offers do not show where that is a
    small place; the walkers do, for they are distributed as the posterior, nearly.
    """
    flat, lp = _walked(chains, chains.learned)
    _, at = np.unique(flat, axis=0, return_index=True)
    at = np.random.default_rng(chains.steps).permutation(at)[:LOOKED_AT]
    proposal = proposing(posterior, old)
    w = proposal.log_weights(flat[at], lp[at])
    places = proposal.places(flat[at])
    w = np.where(np.isfinite(w), np.exp(w - np.max(w)), 0.0)
    if len(at) < NEAR:
        return None
    try:
        more = around_largest(places, w, np.atleast_2d(np.cov(places.T)))
    except np.linalg.LinAlgError:
        return None
    return joined([(old, 1 - MENDING), (more, MENDING)])


def _walked(chains: Chains, first: int) -> tuple[Array, Array]:
    """x (n, k) and ln p (n,) from the step ``first`` on, of a long walk every second step and so on."""
    each = chains.log_posterior[:, 0].size
    steps = np.arange(first, chains.steps, -(-(chains.steps - first) * each // MANY))
    return picked(chains.x, steps).reshape(-1, chains.x.shape[-1]), picked(chains.log_posterior, steps).ravel()


def _drawn(proposal: Proposing, state: Any, count: int) -> tuple[Array, Array, Any]:
    """What makes proposals (count, m), ln of uniform draws (count,), and the state of the generator after them."""
    random = np.random.RandomState()
    random.set_state(state)
    rng = generator_of(random)
    return proposal.drawn(rng, count), np.log(rng.random(count)), random.get_state()
