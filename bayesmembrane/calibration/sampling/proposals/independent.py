"""A proposal that needs no walk: draws of a mixture, learned in rounds from what was solved, judged by its weights."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from bayesmembrane.calibration.posterior import Outcomes, Posterior, weighed
from bayesmembrane.calibration.sampling.proposals.emulator import Allowed, Emulator, emulate
from bayesmembrane.calibration.sampling.proposals.mixture import Mixture, fit_mixture, widened
from bayesmembrane.calibration.sampling.weights import Worth, worth
from bayesmembrane.calibration.starts import Tried, tempered
from bayesmembrane.ground.parameters import Array

ROUNDS, EACH = 6, 400
"""Rounds at most, and draws of the mixture that are solved in each."""
ENOUGH, GAIN = 0.5, 1.15
"""A proposal of this efficiency is good enough, and one that gains less than this factor in two rounds the last."""
LEAST = 0.25
"""A chain of less than this efficiency is stuck for so long that ensembles are as fast."""
HOPELESS, TRIED = 0.1, 3
"""Where the best of so many rounds is below this, no more are tried."""
DEPTH = 6.0
"""An emulator is learned where ln p is less than this, and one for each coordinate, below its largest value: nearly
all of the posterior is there, and a polynomial that must follow more follows less well."""
LEARN_FROM = 800
WALKERS, BURN, SNAPSHOTS, APART = 80, 100, 6, 25
"""Of the walk on the emulator: its walkers for each coordinate, steps to begin with, and snapshots so many steps apart:
of what they give a mixture has about two components for each coordinate."""


@dataclass(frozen=True, eq=False)
class Independent:
    """A mixture to draw proposals from, some states (S, k) distributed as the posterior, nearly, and how good it is."""

    mixture: Mixture
    states: Array
    worth: Worth


def independent(posterior: Posterior, tried: Tried, rng: np.random.Generator, counts: Outcomes) -> Independent | None:
    """A mixture close to the posterior, from what has been ``tried``; None if none is found that is close enough.

    In each round an emulator is learned from the better points, walked on, and a mixture fitted to where that led; some
    draws of it are solved, tell how good it is, and join what the next round learns from. O. Cappé et al.,
    Stat. Comput. 18 (2008) 447, with the walk on an emulator instead of reweighting what has been solved.
    """
    walkers = WALKERS * posterior.size
    found: list[Independent] = []
    for _ in range(ROUNDS):
        # Not the last round's draws by their weights: of a bad mixture one of them may outweigh all others.
        good = tried.possible
        states = good.x[tempered(good.log_posterior, walkers / 2, walkers, rng)]
        try:
            mixture = _learned(posterior, tried, states, rng)
        except np.linalg.LinAlgError:
            break  # what was tried fills no volume
        x = mixture.draw(rng, EACH)
        e = weighed(posterior, x)
        counts.note(x, e.outcome)
        lp = e.log_posterior
        tried = tried.joined(x, lp)
        weights = lp - mixture.log_density(x)
        judged = worth(weights)
        if judged.efficiency > 0:
            share = np.exp(weights - np.max(weights))
            drawn = x[rng.choice(EACH, size=walkers, p=share / np.sum(share))]
            found.append(Independent(mixture, drawn, judged))
        if found and (_enough(judged) or _settled(found)):
            break
    best = max(found, key=lambda f: (f.worth.good, f.worth.efficiency), default=None)
    return best if best is not None and best.worth.good and best.worth.efficiency >= LEAST else None


def _enough(judged: Worth) -> bool:
    return judged.good and judged.efficiency >= ENOUGH


def _settled(found: list[Independent]) -> bool:
    """Whether the last two rounds found next to nothing better than those before."""
    sizes = [f.worth.efficiency for f in found]
    hopeless = len(sizes) >= TRIED and max(sizes) < HOPELESS
    return hopeless or (len(sizes) > 2 and max(sizes[-2:]) < GAIN * max(sizes[:-2]))


def _learned(posterior: Posterior, tried: Tried, states: Array, rng: np.random.Generator) -> Mixture:
    """A mixture for the draws of an emulator, or for the ``states`` where there is none."""
    draws = states
    with suppress(np.linalg.LinAlgError):
        near = _near(tried, rng)
        emulator = emulate(posterior, near, rng, Allowed.of(tried.x, tried.log_posterior > -np.inf))
        if emulator is not None:
            draws = _walked(emulator, states, rng)
    return widened(fit_mixture(_parted(draws, rng), rng), draws)


def _near(tried: Tried, rng: np.random.Generator) -> Array:
    """Points to learn an emulator from."""
    order = np.argsort(-tried.log_posterior)
    depth = tried.log_posterior[order[0]] - tried.log_posterior[order]
    enough = max(int(np.count_nonzero(depth < DEPTH + tried.x.shape[1])), 12 * tried.x.shape[1])
    return np.asarray(tried.x[rng.permutation(order[:enough])[:LEARN_FROM]])


def _walked(emulator: Emulator, states: Array, rng: np.random.Generator) -> Array:
    x, _ = emulator.walk(states, rng, BURN)
    parts = [x]
    for _ in range(SNAPSHOTS):
        x, _ = emulator.walk(x, rng, APART)
        parts.append(x)
    return np.concatenate(parts)


def _parted(x: Array, rng: np.random.Generator) -> Array:
    """The draws with a thousandth of their spread added: states may be there more than once."""
    return np.asarray(x + 1e-3 * np.std(x, axis=0) * rng.standard_normal(x.shape))
