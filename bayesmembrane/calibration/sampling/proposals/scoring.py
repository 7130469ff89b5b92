"""emcee's moves among normal scores of the coordinates, with walkers that stand at the coordinates themselves."""

from __future__ import annotations

from typing import Any

import emcee

from bayesmembrane.calibration.sampling.proposals.scores import Scores
from bayesmembrane.ground.parameters import Array


class RedBlueOfScores(emcee.moves.RedBlueMove):  # type: ignore[misc]
    """A move of one half of the walkers by the other half, made among their scores."""

    def __init__(self, move: Any, scores: Scores) -> None:
        super().__init__()
        self.move, self.scores = move, scores

    def setup(self, coords: Array) -> None:
        """As that of the move."""
        self.move.setup(coords)

    def get_proposal(self, sample: Array, complement: list[Array], random: Any) -> tuple[Array, Array]:
        """(B, k) proposals for the walkers (B, k), and the logarithms (B,) of their factors."""
        z = self.scores.of(sample)
        y, factor = self.move.get_proposal(z, [self.scores.of(c) for c in complement], random)
        return self.scores.back(y), factor + self.scores.log_stretch(y) - self.scores.log_stretch(z)


def among_scores(move: Any, scores: Scores) -> Any:
    """The ``move``, one of emcee's, as one of walkers that stand at x: y of z = z(x), and back.

    If the move leaves p(z) as it is, this leaves p(x): a factor of z gets |dy / dz| of both places.
    """
    if scores.plain:
        return move
    if isinstance(move, emcee.moves.RedBlueMove):
        return RedBlueOfScores(move, scores)

    def propose(x: Array, random: Any) -> tuple[Array, Array]:
        z = scores.of(x)
        y, factor = move.get_proposal(z, random)
        return scores.back(y), factor + scores.log_stretch(y) - scores.log_stretch(z)

    return emcee.moves.MHMove(propose)
