"""A proposal that needs no walk: draws of a mixture, learned in rounds from what was solved, judged by its weights."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from bayesmembrane.calibration.posterior import Outcomes, Posterior, weighed
from bayesmembrane.calibration.sampling.proposals.emulator import Allowed, Emulator, emulate
from bayesmembrane.calibration.sampling.proposals.filling import filled, joined
from bayesmembrane.calibration.sampling.proposals.mixture import Mixture, fit_mixture, widened
from bayesmembrane.calibration.sampling.weights import Worth, worth
from bayesmembrane.calibration.starts import Tried, tempered
from bayesmembrane.ground.parameters import Array

ROUNDS, EACH = 3, 400
"""Rounds at most, and draws of the mixture that are solved in each."""
ENOUGH = 0.5
"""A proposal of this efficiency is good enough."""
LEAST, LEAST_FILLED = 0.25, 0.08
"""A chain of less than the first is stuck for so long that ensembles are as fast; a mixture that has been filled may be
worth less, for its weights have no long tail: what holds it up is short, and many films are solved at once."""
FILLINGS, HOPELESS = 2, 0.02
"""A mixture is filled so often at most, and not at all if it is worth less than this."""
FITTED = 0.6  # weight of what is fitted to draws beside the mixture that is filled
CHECKED = 2000  # draws that judge it
DEPTH = 6.0
"""An emulator is learned where ln p is less than this, and one for each coordinate, below its largest value: nearly
all of the posterior is there, and a polynomial that must follow more follows less well."""
LEARN_FROM, LEARN_MORE = 800, 2000
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
    Stat. Comput. 18 (2008) 447, with the walk on an emulator instead of reweighting what has been solved. Where no
    round finds one that is good enough the best is `filled`.
    """
    search = _Learning(posterior, rng, counts)
    found: list[Independent] = []
    with suppress(np.linalg.LinAlgError):  # what was tried fills no volume
        for _ in range(ROUNDS):
            # Not the last round's draws by their weights: of a bad mixture one of them may outweigh all others.
            good, walkers = tried.possible, search.walkers
            states = good.x[tempered(good.log_posterior, walkers / 2, walkers, rng)]
            mixture = search.learned(tried, states, LEARN_FROM)
            now, tried = search.judged(widened(*mixture), tried, EACH)
            if now is not None:
                found.append(now)
                if _rank(now) >= (True, ENOUGH):
                    return now
    best = max(found, key=_rank, default=None)
    if best is None or best.worth.efficiency < HOPELESS:
        return None
    more = best
    with suppress(np.linalg.LinAlgError):
        for _ in range(FILLINGS):
            more = search.filled(more) or more
            if more is not best and _rank(more) >= (True, LEAST_FILLED):
                return more
    return best if _rank(best) >= (True, LEAST) else None


def _rank(found: Independent) -> tuple[bool, float]:
    return found.worth.good, found.worth.efficiency


@dataclass(frozen=True, eq=False)
class _Learning:
    """What mixtures are learned for."""

    posterior: Posterior
    rng: np.random.Generator
    counts: Outcomes

    @property
    def walkers(self) -> int:
        """On the emulator."""
        return WALKERS * self.posterior.size

    def log_density(self, x: Array) -> Array:
        """ln p of x (B, k), solved."""
        e = weighed(self.posterior, x)
        self.counts.note(x, e.outcome)
        return e.log_posterior

    def judged(self, mixture: Mixture, tried: Tried, count: int) -> tuple[Independent | None, Tried]:
        """What ``count`` draws say of a mixture, None if none is possible, and they with what was tried."""
        x = mixture.draw(self.rng, count)
        lp = self.log_density(x)
        weights = lp - mixture.log_density(x)
        found = worth(weights)
        tried = tried.joined(x, lp)
        if found.efficiency <= 0:
            return None, tried
        return Independent(mixture, _resampled(x, weights, self.walkers, self.rng), found), tried

    def filled(self, best: Independent) -> Independent | None:
        """The mixture with what it lacks, beside one that is learned from all that this took to find."""
        whole = filled(best.mixture, self.log_density, self.rng)
        tried = Tried(whole.x, whole.log_posterior)
        states = _resampled(whole.x, whole.log_weights, self.walkers, self.rng)
        fitted, _ = self.learned(tried, states, LEARN_MORE)
        mixture = joined([(fitted, FITTED), (whole.mixture, 1 - FITTED)])
        return self.judged(mixture, tried, CHECKED)[0]

    def learned(self, tried: Tried, states: Array, most: int) -> tuple[Mixture, Array]:
        """A mixture for the draws of an emulator, or for the ``states`` where there is none, and those draws."""
        draws = states
        with suppress(np.linalg.LinAlgError):
            near = _near(tried, most, self.rng)
            seen = Allowed.of(tried.x, tried.log_posterior > -np.inf)
            emulator = emulate(self.posterior, near, self.rng, seen)
            if emulator is not None:
                draws = _walked(emulator, states, self.rng)
        return fit_mixture(_parted(draws, self.rng), self.rng), draws


def _resampled(x: Array, log_weights: Array, count: int, rng: np.random.Generator) -> Array:
    """``count`` of x (B, k) by their weights."""
    share = np.exp(log_weights - np.max(log_weights))
    return np.asarray(x[rng.choice(len(x), size=count, p=share / np.sum(share))])


def _near(tried: Tried, most: int, rng: np.random.Generator) -> Array:
    """Points to learn an emulator from, ``most`` at most."""
    order = np.argsort(-tried.log_posterior)
    depth = tried.log_posterior[order[0]] - tried.log_posterior[order]
    enough = max(int(np.count_nonzero(depth < DEPTH + tried.x.shape[1])), 12 * tried.x.shape[1])
    return np.asarray(tried.x[rng.permutation(order[:enough])[:most]])


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
