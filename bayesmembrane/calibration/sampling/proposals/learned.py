"""What moves an ensemble makes: those that need only its walkers, and those learned from what was walked so far."""

from __future__ import annotations

import sys
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.calibration.sampling.chains import Chains
from bayesmembrane.calibration.sampling.growing import picked
from bayesmembrane.calibration.sampling.proposals.bend import bend_of, straight
from bayesmembrane.calibration.sampling.proposals.emulator import Emulator, emulate
from bayesmembrane.calibration.sampling.proposals.ensemble import ensemble_moves
from bayesmembrane.calibration.sampling.proposals.jumping import jumping
from bayesmembrane.calibration.sampling.proposals.mixture import Mixture, fit_mixture
from bayesmembrane.calibration.sampling.proposals.scored import Scored, scores_of
from bayesmembrane.calibration.sampling.proposals.scores import Scores
from bayesmembrane.calibration.sampling.proposals.walking import walking
from bayesmembrane.ground.jobs import give_back

FIRST_LESSON, NEXT_LESSON = 100, 4
"""The proposal is learned from the chains after so many steps, and anew whenever there are so many times as many,
until the run converges. What came before the last lesson never counts: only a fixed proposal makes a chain. Twice as
many leave too few steps in between for fifty autocorrelation times of ten steps or more: Yeoh with Mullins softening
on 700 readings was worth 2500 draws after 750 steps, learned again at 800, 1600 and 3200, and converged after 3872. To
an ESS of 1000 on ten readings of the paper's film, two seeds, it took 41600 and 37300 evaluations with twice and 28300
and 25600 with four times as many for Mooney-Rivlin, 12700 and 10500 for Gent, 7800 and 10400 for neo-Hookean."""
SEEN = 2**19  # draws of a long walk among which those are chosen that are learned from
WALK_SHARE, JUMP_SHARE, LEARN_FROM = 0.4, 0.3, 2000


@dataclass(frozen=True, eq=False)
class Learned:
    """What proposals are made from, of normal ``scores``; what is None had nothing to learn from."""

    scores: Scores
    emulator: Emulator | None = None
    mixture: Mixture | None = None

    def moves(self) -> list[tuple[Any, float]]:
        """emcee's moves with their weights, which add up to one."""
        # On demand, as emcee is.
        from bayesmembrane.calibration.sampling.proposals.scoring import among_scores

        moves: list[tuple[Any, float]] = []
        if self.emulator is not None:
            moves.append((among_scores(walking(self.emulator), self.scores), WALK_SHARE))
        straight = self.scores.bent(None if self.mixture is None else self.mixture.bend)
        if self.mixture is not None:
            moves.append((among_scores(jumping(self.mixture), straight), JUMP_SHARE))
        share = 1 - sum(weight for _, weight in moves)
        return moves + [(among_scores(move, straight), weight) for move, weight in ensemble_moves(share)]


def learn(posterior: Posterior, chains: Chains) -> Learned:
    """An emulator and a mixture, from the later part of what all ensembles walked until the last lesson.

    An emulator of the curves to walk on, and t-distributions to jump to: one is right where curves are smooth in the
    parameters, the other where they are not but the posterior is compact. Both follow from the chains alone, so that a
    run that was interrupted learns the same again.
    """
    scores = scores_of(posterior)
    if not chains.lessons or chains.mixture is not None:
        return Learned(scores)
    give_back()  # what a walk holds is no use to an emulator
    end = chains.lessons[-1]
    every = -(-(end - end // 4) * chains.log_posterior[:, 0].size // SEEN)
    some, rng = picked(chains.x, np.arange(end // 4, end, every)), np.random.default_rng(end)
    z = scores.of(some.reshape(-1, some.shape[-1]))
    emulator: Emulator | None = None
    mixture: Mixture | None = None
    # Draws that fill no volume teach nothing: then the walkers do without.
    with suppress(np.linalg.LinAlgError):
        emulator = emulate(Scored(posterior, scores), z, rng)
    with suppress(np.linalg.LinAlgError):
        some = z[rng.permutation(len(z))[:LEARN_FROM]]
        way = bend_of(some)
        mixture = replace(fit_mixture(straight(way, some), rng), bend=way)
    return Learned(scores, emulator, mixture)


def next_lesson(chains: Chains) -> int:
    """Steps after which the proposal may be learned (anew); none while all steps are proposed by one mixture."""
    if chains.mixture is not None:
        return sys.maxsize
    if not chains.lessons:
        return FIRST_LESSON
    # What a mixture proposed counts as the steps before the first lesson, however many those were.
    walked = max(FIRST_LESSON, chains.lessons[-1] - chains.leapt) if chains.leapt else chains.lessons[-1]
    return int(chains.lessons[-1] + (NEXT_LESSON - 1) * walked)
