"""A proposal that needs no walk: draws of a mixture, learned in rounds from what was solved, judged by its weights."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.calibration.posterior import Outcomes, Posterior, weighed
from bayesmembrane.calibration.sampling.proposals.bend import Bend, bend_of, straight
from bayesmembrane.calibration.sampling.proposals.collapsed import Collapsed, collapsed
from bayesmembrane.calibration.sampling.proposals.emulator import Allowed, Emulator, Solved, emulate
from bayesmembrane.calibration.sampling.proposals.filling import Filled, filled, joined
from bayesmembrane.calibration.sampling.proposals.mixture import Mixture, fit_mixture, widened
from bayesmembrane.calibration.sampling.proposals.proposing import ShapeFirst
from bayesmembrane.calibration.sampling.proposals.scored import Scored, scores_of
from bayesmembrane.calibration.sampling.proposals.scores import Scores
from bayesmembrane.calibration.sampling.weights import Worth, worth
from bayesmembrane.calibration.starts import Tried, tempered
from bayesmembrane.ground.parameters import Array

ROUNDS, EACH = 3, 400
"""Rounds at most, and draws of the mixture that are solved in each."""
ENOUGH, ENOUGH_SHAPE, ENOUGH_FILLED = 0.5, 0.75, 0.25
"""A proposal of this efficiency is good enough; one of shapes of the second, and of the third once it is filled."""
LEAST, LEAST_FILLED = 0.02, 0.08
"""What a mixture of all coordinates has to be worth in the end, and one that was filled not to be filled once more: it
is fitted anew to what is walked by it, and many films are solved at once; where it is worth little, ensembles would
have to walk along a narrow valley, which takes many times as many films. (Ogden with a form error, replicate 8 of
`tests.studies.sbc` halfway back: 0.047 led to 24 s of a processor, ensembles took 214.) One of shapes may be worth
anything."""
FILLINGS, HOPELESS = 2, 0.002
"""A mixture of all coordinates is filled so often at most, and not at all if it is worth less than this."""
FITTED = 0.6  # weight of what is fitted to draws beside the mixture that is filled
CHECKED, CHECKED_SHAPES = 2000, 1000  # draws that judge it
DEPTH = 6.0
"""An emulator is learned where ln p is less than this, and one for each coordinate, below its largest value: nearly
all of the posterior is there, and a polynomial that must follow more follows less well."""
LEARN_FROM, LEARN_MORE = 800, 2000
WALKERS, BURN, SNAPSHOTS, APART = 80, 100, 6, 25
"""Of the walk on the emulator: its walkers for each coordinate, steps to begin with, and snapshots so many steps apart:
of what they give a mixture has about two components for each coordinate."""
SHAPES, MORE = 100, 4
"""Walkers where they stand for shapes, and how many times as many snapshots where a first mixture was not enough: a
narrow curved valley takes more components."""
STATES = 256  # of those that walks may begin at


@dataclass(frozen=True, eq=False)
class Independent:
    """A mixture to draw proposals from, some states (S, k) distributed as the posterior, nearly, and how good it is.

    The states are x; while it is learned they are scores, without the bend of the mixture.
    """

    mixture: Mixture
    states: Array
    worth: Worth


def independent(
    posterior: Posterior, tried: Tried, rng: np.random.Generator, counts: Outcomes, enough: float | None = None
) -> Independent | None:
    """A mixture close to the posterior, from what has been ``tried``; None if none is found that is close enough. One
    of the efficiency ``enough`` is good enough (None: as much as a walk wants).

    In each round an emulator is learned from the better points, walked on, and a mixture fitted to where that led; some
    draws of it are solved, tell how good it is, and join what the next round learns from. O. Cappé et al.,
    Stat. Comput. 18 (2008) 447, with the walk on an emulator instead of reweighting what has been solved. Where no
    round finds one that is good enough the best is `filled`.
    """
    shape = collapsed(posterior)
    if shape is None:
        scores = scores_of(posterior)
        search = _Learning(Scored(posterior, scores), rng, counts)
        found = _of_all_coordinates(search, _scored(tried, scores), enough or ENOUGH)
        return None if found is None else replace(found, states=scores.back(found.states))
    close = _of_shapes(_Learning(shape, rng, counts), _shapes(tried, shape), enough or ENOUGH_SHAPE)
    if close is None:
        return None
    states = close.states[:STATES]
    numbers = np.concatenate([states, rng.random((len(states), 2))], axis=1)
    return replace(close, states=ShapeFirst(shape, replace(close.mixture, bend=None)).solved(numbers).x)


def _scored(tried: Tried, scores: Scores) -> Tried:
    """What was tried in normal scores, with ln p of those."""
    z = scores.of(tried.x)
    return replace(tried, x=z, log_posterior=tried.log_posterior + scores.log_stretch(z))


def _shapes(tried: Tried, shape: Collapsed) -> Tried:
    """The shapes of what was tried, with ln p of those."""
    x, lp, ok = shape.part(tried.x), tried.log_posterior.copy(), np.isfinite(tried.log_posterior)
    if tried.curves is None:
        lp[ok] = weighed(shape, x[ok]).log_posterior
        return Tried(x, lp)
    curves = tried.curves / np.exp(tried.x[:, :1])
    lp[ok] = shape.given(curves[ok], x[ok])
    return Tried(x, lp, curves)


def _of_all_coordinates(search: _Learning, tried: Tried, enough: float = ENOUGH) -> Independent | None:
    """What `independent` finds of all coordinates: what is best of `ROUNDS` is filled, if it has to be."""
    found: list[Independent] = []
    with suppress(np.linalg.LinAlgError):  # what was tried fills no volume
        for turn in range(ROUNDS):
            now, tried = search.round(tried, SNAPSHOTS, turn > 0)
            if now is not None:
                found.append(now)
                if _rank(now) >= (True, enough):
                    return now
    best = max(found, key=_rank, default=None)
    if best is None or best.worth.efficiency < HOPELESS:
        return None
    with suppress(np.linalg.LinAlgError):
        more: Independent | None = best
        for _ in range(FILLINGS):
            more = search.relearned(more or best)
            if more is not None:
                found.append(more)
                if _rank(more) >= (True, LEAST_FILLED):
                    return more
    best = max(found, key=_rank)
    return best if _rank(best) >= (True, LEAST) else None


def _of_shapes(search: _Learning, tried: Tried, enough: float = ENOUGH_SHAPE) -> Independent | None:
    """What `independent` finds of shapes: a few hundred draws do not show the tail of their weights, and a mixture is
    filled as soon as there is one that is not good ``enough``.
    """
    found: list[Independent] = []
    with suppress(np.linalg.LinAlgError):
        for turn in range(ROUNDS):
            now, tried = search.round(tried, SNAPSHOTS * (MORE if turn else 1), turn > 0)
            if now is None:
                continue
            if _rank(now) >= (True, enough):
                return now
            more, tried = search.completed(now, tried)
            if more is not None:
                found.append(more)
                if _rank(more) >= (True, min(enough, ENOUGH_FILLED)):
                    return more
    return max(found, key=_rank, default=None)


def _rank(found: Independent) -> tuple[bool, float]:
    return found.worth.good, found.worth.efficiency


@dataclass(frozen=True, eq=False)
class _Learning:
    """What mixtures are learned for."""

    posterior: Scored | Collapsed
    rng: np.random.Generator
    counts: Outcomes

    @property
    def walkers(self) -> int:
        """On the emulator."""
        return SHAPES if isinstance(self.posterior, Collapsed) else WALKERS * self.posterior.size

    def round(self, tried: Tried, snapshots: int, bend: bool) -> tuple[Independent | None, Tried]:
        """A mixture learned from what was tried, and what `EACH` draws say of it; with ``bend`` one along a bend."""
        # Not the last round's draws by their weights: of a bad mixture one of them may outweigh all others.
        good = tried.possible
        states = good.x[tempered(good.log_posterior, self.walkers / 2, self.walkers, self.rng)]
        draws = self.learned(tried, states, LEARN_MORE if bend else LEARN_FROM, snapshots)
        way = bend_of(draws) if bend else None
        u = straight(way, draws)
        mixture = replace(fit_mixture(u, self.rng), bend=way)
        return self.judged(widened(mixture, u), tried, EACH)

    def judged(self, mixture: Mixture, tried: Tried, count: int) -> tuple[Independent | None, Tried]:
        """What ``count`` draws say of a mixture, None if none is possible, and they with what was tried."""
        u = mixture.draw(self.rng, count)
        lp, more = self._solved(mixture.bend, u)
        weights = lp - mixture.log_density(u)
        found = worth(weights)
        tried = tried.joined(more)
        if found.efficiency <= 0:
            return None, tried
        return Independent(mixture, _resampled(more.x, weights, self.walkers, self.rng), found), tried

    def _solved(self, bend: Bend | None, u: Array) -> tuple[Array, Tried]:
        """ln p of the straightened coordinates u (B, k), and the same points without a bend."""
        there = Tried.of(self.posterior.bent(bend), u, self.counts)
        if bend is None:
            return there.log_posterior, there
        plain = replace(there, x=bend.back(u), log_posterior=there.log_posterior - bend.log_stretch)
        return there.log_posterior, plain

    def relearned(self, best: Independent) -> Independent | None:
        """The mixture with what it lacks, beside one that is learned from all that this took to find."""
        whole, tried = self._filling(best)
        states = _resampled(tried.x, whole.log_weights, self.walkers, self.rng)
        draws = self.learned(tried, states, LEARN_MORE, SNAPSHOTS)
        fitted = fit_mixture(straight(best.mixture.bend, draws), self.rng)
        mixture = joined([(whole.mixture, 1 - FITTED), (fitted, FITTED)])
        return self.judged(mixture, tried, CHECKED)[0]

    def completed(self, best: Independent, tried: Tried) -> tuple[Independent | None, Tried]:
        """The mixture with what it lacks, and what this took to find with what was tried."""
        whole, more = self._filling(best)
        return self.judged(whole.mixture, tried.joined(more), CHECKED_SHAPES)

    def _filling(self, best: Independent) -> tuple[Filled, Tried]:
        solved: list[Tried] = []

        def log_density(u: Array) -> Array:
            lp, more = self._solved(best.mixture.bend, u)
            solved.append(more)
            return lp

        return filled(best.mixture, log_density, self.rng), reduce(Tried.joined, solved)

    def learned(self, tried: Tried, states: Array, most: int, snapshots: int) -> Array:
        """Draws of an emulator, or the ``states`` where there is none, none of them twice."""
        draws = states
        with suppress(np.linalg.LinAlgError):
            near = tried.those(_near(tried, most, self.rng))
            seen = Allowed.of(tried.x, tried.log_posterior > -np.inf)
            emulator = emulate(self.posterior, near.x, self.rng, seen, _known(near))
            if emulator is not None:
                draws = _walked(emulator, states, self.rng, snapshots)
        return _parted(draws, self.rng)


def _resampled(x: Array, log_weights: Array, count: int, rng: np.random.Generator) -> Array:
    """``count`` of x (B, k) by their weights."""
    share = np.exp(log_weights - np.max(log_weights))
    return np.asarray(x[rng.choice(len(x), size=count, p=share / np.sum(share))])


def _known(tried: Tried) -> Solved | None:
    """What is known of these points; None if their curves were not kept."""
    return None if tried.curves is None else Solved(tried.log_posterior, tried.curves)


def _near(tried: Tried, most: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Which points to learn an emulator from, ``most`` at most."""
    order = np.argsort(-tried.log_posterior)
    depth = tried.log_posterior[order[0]] - tried.log_posterior[order]
    enough = max(int(np.count_nonzero(depth < DEPTH + tried.x.shape[1])), 12 * tried.x.shape[1])
    return np.asarray(rng.permutation(order[:enough])[:most])


def _walked(emulator: Emulator, states: Array, rng: np.random.Generator, snapshots: int) -> Array:
    x, _ = emulator.walk(states, rng, BURN)
    parts = [x]
    for _ in range(snapshots):
        x, _ = emulator.walk(x, rng, APART)
        parts.append(x)
    return np.concatenate(parts)


def _parted(x: Array, rng: np.random.Generator) -> Array:
    """The draws with a thousandth of their spread added: states may be there more than once."""
    return np.asarray(x + 1e-3 * np.std(x, axis=0) * rng.standard_normal(x.shape))
