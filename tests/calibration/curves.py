"""Ordinary curves at random, from the finite elements of tests/generator and not from the solver that calibrates."""

from functools import cache

import numpy as np

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.physics.rigs.annulus import Annulus
from tests.generator.energies import FAMILIES, InadmissibleStateError
from tests.generator.film import NoSolutionError, film

NOISE = 0.01  # of the largest force
TRIES = 50


@cache
def ordinary(seed: int) -> Measurement:
    """A film on a ring: R1 5 to 15 mm, R2 30 to 50 mm, 5 to 30 points to 10 to 90 mm, 1 % noise.

    Films of odd seeds were clamped with a stretch of 1.01 to 1.1. One that locks or is lost on the way is drawn anew.
    """
    rng = np.random.default_rng([seed, 49])
    for _ in range(TRIES):
        family = str(rng.choice(sorted(FAMILIES)))
        p = tuple(map(float, FAMILIES[family].draw(rng)))
        inner, outer, end = rng.uniform(5e-3, 15e-3), rng.uniform(30e-3, 50e-3), rng.uniform(10e-3, 90e-3)
        deflection = np.linspace(0, end, int(rng.integers(5, 31)) + 1)[1:]
        stretch = float(rng.uniform(1.01, 1.1)) if seed % 2 else 1.0
        try:
            force = film(family, p, inner, outer, end, True).force(deflection, stretch)
        except (NoSolutionError, InadmissibleStateError):
            continue
        force = force + NOISE * float(np.max(force)) * rng.standard_normal(force.size)
        return Measurement(deflection, force, Annulus(inner, outer), Specimen(f"{family} {seed}", 50e-6))
    raise AssertionError(f"no film of seed {seed} can be solved")
