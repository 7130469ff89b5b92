"""The 120 cases of one seed: which of them have how many flaws, which energy, and which noise; shares are exact.

24 have no flaw, 42 one, 30 two, 14 three, and 10 one that no library of effects holds. 72 have an energy that a user
can declare. 12 are loaded only; with three flaws loading alone hardly shows them all, and the test is another one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

CASES = 120
GROUPS = ("none",) * 24 + ("one",) * 42 + ("two",) * 30 + ("three",) * 14 + ("foreign",) * 10
FLAW_COUNT = {"none": 0, "one": 1, "two": 2, "three": 3, "foreign": 1}


@dataclass(frozen=True)
class NoiseRecipe:
    """correlated : from reading to reading; grows : with the force; strays : one to three readings are far off;
    rounded : to steps; stated : the file says its standard deviation.
    """

    correlated: bool
    grows: bool
    strays: bool
    rounded: bool
    stated: bool


@dataclass(frozen=True)
class Recipe:
    """One case of one seed; what is left open is drawn from (seed, number, attempt)."""

    seed: int
    number: int
    group: str
    common_energy: bool
    loading_only: bool
    noise: NoiseRecipe

    @property
    def flaw_count(self) -> int:
        """Number of flaws."""
        return FLAW_COUNT[self.group]


def recipes(seed: int) -> Iterator[Recipe]:
    """The cases in order."""
    rng = np.random.default_rng(seed)
    groups = list(GROUPS)
    rng.shuffle(groups)

    def marked(count: int) -> list[bool]:
        return [bool(x) for x in np.isin(np.arange(CASES), rng.choice(CASES, count, replace=False))]

    common, loading, correlated, grows, strays, rounded = (marked(n) for n in (72, 12, 30, 30, 18, 24))
    # One number cannot state a noise that grows.
    stated = set(rng.choice([i for i in range(CASES) if not grows[i]], 60, replace=False).tolist())
    for i, group in enumerate(groups):
        noise = NoiseRecipe(correlated[i], grows[i], strays[i], rounded[i], i in stated)
        yield Recipe(seed, i, group, common[i], loading[i] and group != "three", noise)
