"""Points that fill the unit cube evenly."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bayesmembrane.ground.interrupts import held_back

if TYPE_CHECKING:
    from scipy.stats import qmc


def scrambled_sobol(dimensions: int, rng: np.random.Generator | int) -> qmc.Sobol:
    """A scrambled Sobol sequence in the unit cube (A. B. Owen, J. Complexity 14 (1998) 466)."""
    from scipy.stats import qmc  # on demand: scipy.stats takes a second, and most commands never ask for it

    with held_back():  # SciPy reads its numbers in a function that cannot raise, and goes on without them
        return qmc.Sobol(dimensions, scramble=True, rng=rng)
