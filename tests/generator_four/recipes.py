"""The 60 cases of one seed: how many faults, whose energy, which noise; shares are exact, the order is mixed.

Among those without a fault and with a single one are five each whose energy no user can declare; the other groups have
energies of the library.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

CASES = 60
SHARES = (
    *(("none", True, 8), ("none", False, 5), ("one", True, 14), ("one", False, 5)),
    *(("two", True, 16), ("three", True, 7), ("foreign", True, 5)),
)
"""(group, whether the energy is a common one, number of cases)"""
COUNT = {"none": 0, "one": 1, "two": 2, "three": 3, "foreign": 1}
CORRELATED, PROPORTIONAL, QUANTISED, STRAYS, STATED = 15, 12, 14, 9, 30


@dataclass(frozen=True)
class NoiseOrder:
    """correlated : AR(1); proportional : in part to the force; quantised : by the converter; strays : a few readings
    are far off; stated : the file gives its standard deviation.
    """

    correlated: bool
    proportional: bool
    quantised: bool
    strays: bool
    stated: bool


@dataclass(frozen=True)
class BenchRecipe:
    """One case of one seed; all that is left open is drawn from (seed, number, attempt)."""

    seed: int
    number: int
    group: str
    common_energy: bool
    noise: NoiseOrder

    @property
    def fault_count(self) -> int:
        """Number of faults."""
        return COUNT[self.group]


def recipes(seed: int) -> Iterator[BenchRecipe]:
    """The cases in order."""
    rng = np.random.default_rng([seed, 4])
    kinds = [(group, common) for group, common, count in SHARES for _ in range(count)]
    rng.shuffle(kinds)
    marks = [set(rng.permutation(CASES)[:n].tolist()) for n in (CORRELATED, PROPORTIONAL, QUANTISED, STRAYS)]
    # One number states a noise that is alike everywhere, and no other.
    even = [i for i in range(CASES) if i not in marks[1]]
    stated = set(rng.permutation(even)[:STATED].tolist())
    for i, (group, common) in enumerate(kinds):
        correlated, proportional, quantised, strays = (i in m for m in marks)
        noise = NoiseOrder(correlated, proportional, quantised, strays, i in stated)
        yield BenchRecipe(seed, i, group, bool(common), noise)
