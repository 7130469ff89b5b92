"""The moves that need nothing but the other walkers."""

from __future__ import annotations

from typing import Any


def ensemble_moves(share: float) -> list[tuple[Any, float]]:
    """Differential evolution, snooker and stretch with weights that add up to ``share``.

    The first two suit curved valleys; differential evolution with gamma = 1 jumps between valleys.
    """
    import emcee  # on demand: it imports scipy.stats, which takes a second

    from bayesmembrane.calibration.sampling.proposals.snooker import Snooker

    return [
        (emcee.moves.DEMove(), 0.6 * share),
        (emcee.moves.DEMove(gamma0=1.0), 0.1 * share),
        (Snooker(), 0.1 * share),
        (emcee.moves.StretchMove(), 0.2 * share),
    ]
