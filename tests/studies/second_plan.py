"""The cases of `make study-second`: the second generator, looked at once, when nothing more is to be changed.

Rounds of twenty with no effect to three of unequal size, so that every prefix is balanced. Nothing is tuned on them,
hence there is one half only.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from tests.generator_two.datasets import Dataset, generate
from tests.generator_two.elastic import COMMON, UNKNOWN
from tests.generator_two.faults import EFFECTS, FOREIGN
from tests.studies.reliability_plan import GROUPS, Case

SEED = 900_000
ROUNDS = 15
WEAKEST, STRONGEST, UNEQUAL = 6.0, 120.0, 6.0
HALF = "second"

ROUND = (
    *("single", "null", "pair", "single", "foreign", "triple", "null", "pair", "single", "energy"),
    *("pair", "single", "null", "triple", "single", "mixed", "pair", "foreign", "null", "single"),
)
"""null 4, single 6, pair 4, triple 2, energy 1, mixed 1, foreign 2."""


def plan(half: str = HALF, base: int = SEED) -> Iterator[Case]:
    """The cases, in order; the kind of a case is its faults joined by "+", after its energy."""
    if half != HALF:
        raise ValueError(f"the second generator has no half {half!r}: nothing is tuned on it")
    rng = np.random.default_rng(21)

    def mixed(kinds: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
        return [kinds[i] for i in rng.permutation(len(kinds))]

    sets = [mixed(list(combinations(EFFECTS, n))) for n in (1, 2, 3)]
    designs = {
        "null": [()],
        "single": sets[0],
        "pair": sets[1],
        "triple": sets[2],
        "energy": [()],
        "mixed": mixed(list(combinations(EFFECTS, 1))),
        "foreign": mixed([(f,) for f in FOREIGN]),
    }
    taken = dict.fromkeys(designs, 0)
    for number in range(ROUNDS * len(ROUND)):
        group = ROUND[number % len(ROUND)]
        turn, faults = taken[group] + GROUPS.index(group), designs[group][taken[group] % len(designs[group])]
        taken[group] += 1
        family = (UNKNOWN if group in ("energy", "mixed") else COMMON)[(turn + turn // 5) % 5]
        declared = family if family in COMMON else COMMON[(turn + turn // 5 + number) % 5]
        seed = base + number
        yield Case(number, group, "+".join((family, *faults)), declared, _ratios(len(faults), seed), seed)


def measured(case: Case) -> Dataset:
    """The measurement of a case. Raises `LockedError` if no film can be pulled."""
    family, *faults = case.kind.split("+")
    return generate(family, dict(zip(faults, case.strengths, strict=True)), case.seed)


def _ratios(count: int, seed: int) -> tuple[float, ...]:
    """Signal-to-noise ratios; all but one up to `UNEQUAL` times weaker than the strongest."""
    rng = np.random.default_rng([seed, 79])
    top = np.exp(rng.uniform(np.log(WEAKEST), np.log(STRONGEST)))
    parts = np.exp(-rng.uniform(0, np.log(UNEQUAL), count))
    if count:
        parts[rng.integers(count)] = 1.0
    return tuple(round(float(top * x), 3) for x in parts)
