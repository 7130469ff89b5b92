"""The move that jumps to a draw of a mixture, where the posterior is compact."""

from __future__ import annotations

from typing import Any

from bayesmembrane.calibration.sampling.proposals.generator import generator_of
from bayesmembrane.calibration.sampling.proposals.mixture import Mixture
from bayesmembrane.ground.parameters import Array


def jumping(mixture: Mixture) -> Any:
    """y ~ g whatever the place x, with the factor ln g(x) - ln g(y).

    W. K. Hastings, Biometrika 57 (1970) 97.
    """
    import emcee  # on demand: it imports scipy.stats, which takes a second

    def propose(x: Array, random: Any) -> tuple[Array, Array]:
        y = mixture.draw(generator_of(random), len(x))
        return y, mixture.log_density(x) - mixture.log_density(y)

    return emcee.moves.MHMove(propose)
