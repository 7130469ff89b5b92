"""The move that ends a walk on an emulator, where curves are smooth in the parameters."""

from __future__ import annotations

from typing import Any

from bayesmembrane.calibration.sampling.proposals.emulator import Emulator
from bayesmembrane.calibration.sampling.proposals.generator import generator_of
from bayesmembrane.ground.parameters import Array


def walking(emulator: Emulator) -> Any:
    """y is where a walk on the emulator from x ends, with its factor ln q(x) - ln q(y)."""
    import emcee  # on demand: it imports scipy.stats, which takes a second

    def propose(x: Array, random: Any) -> tuple[Array, Array]:
        return emulator.walk(x, generator_of(random))

    return emcee.moves.MHMove(propose)
