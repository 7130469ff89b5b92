"""The cases of `make study-reliability`: a frozen plan in rounds of twenty, so that every prefix of it is balanced.

A case's measurement follows from its kind, declared energy, strengths and seed alone. Even seeds are the calibration
half, odd seeds the test half: what has to be chosen in the diagnosis (widths of priors, scales of the form error) is
chosen on the first, and what is reported is measured on the second. The two halves share the kinds of their cases, and
nothing that is drawn.

At the end stand the plans of `make study-third`, whose cases are those of the third generator, 120 for each seed, and
of the fourth generator, 60 for each seed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, islice

import numpy as np

from tests.generator.datasets import Dataset, generate
from tests.generator.distortions import LIBRARY, OUTSIDE
from tests.generator.energies import DECLARED
from tests.generator.energies import OUTSIDE as FOREIGN_ENERGIES
from tests.generator.film import NoSolutionError
from tests.generator.setups import setup
from tests.generator_four.datasets import BenchDataset
from tests.generator_four.datasets import generate as generate_fourth
from tests.generator_four.recipes import BenchRecipe
from tests.generator_four.recipes import recipes as fourth_recipes
from tests.generator_three.datasets import Dataset as ThirdDataset
from tests.generator_three.datasets import generate as generate_third
from tests.generator_three.recipes import Recipe, recipes

SEED = 400_000
HALVES = {"calibration": 0, "test": 1}
ROUNDS = 60
WEAKEST, STRONGEST = 5.0, 100.0  # signal-to-noise ratio of the strongest effect of a case
UNEQUAL = 5.0  # and how much weaker its others are at most
FAINTEST_FOREIGN, STRONGEST_FOREIGN = 10.0, 60.0
SMALLER, TRIALS = 0.8, 8  # deflections, where a film locks before
UNIT = 20.0  # ratio at strength 1

ROUND = (
    *("null", "single", "pair", "foreign", "single", "null", "triple", "pair", "energy", "single"),
    *("null", "pair", "single", "foreign", "triple", "energy", "null", "pair", "single", "mixed"),
)
"""Groups of one round, in this order: null 4, single 5, pair 4, triple 2, energy 2, mixed 1, foreign 2."""
GROUPS = ("null", "single", "pair", "triple", "energy", "mixed", "foreign")


@dataclass(frozen=True)
class Case:
    """One measurement. group : one of `ROUND`; number : place in the plan; material : the energy to be declared."""

    number: int
    group: str
    kind: str
    material: str
    strengths: tuple[float, ...]
    seed: int

    @property
    def key(self) -> str:
        """What makes it the same case in another run."""
        return f"{self.kind}|{self.material}|{'/'.join(f'{s:.4g}' for s in self.strengths)}|{self.seed}"


def plan(half: str, base: int = SEED) -> Iterator[Case]:
    """The cases of one half, in order."""
    designs = _designs()
    taken = dict.fromkeys(designs, 0)
    for number in range(ROUNDS * len(ROUND)):
        group = ROUND[number % len(ROUND)]
        kind = designs[group][taken[group] % len(designs[group])]
        turn = taken[group] + taken[group] // len(DECLARED) + GROUPS.index(group)
        material = DECLARED[turn % len(DECLARED)]
        taken[group] += 1
        seed = base + 2 * number + HALVES[half]
        family = kind.partition("+")[0].partition(":")[2]
        if family == material:  # then it is no foreign one
            material = DECLARED[(DECLARED.index(material) + 1) % len(DECLARED)]
        yield Case(number, group, kind, material, _strengths(kind, group, seed), seed)


def measured(case: Case) -> Dataset:
    """The measurement of a case; a film that locks before its largest deflection is pulled less far.

    Raises `NoSolutionError` if it locks all the same.
    """
    faults = [k for k in case.kind.split("+") if ":" not in k]
    for trial in range(TRIALS):
        s = setup(faults, case.seed, SMALLER**trial)
        try:
            return generate(case.kind, case.material, s.protocol, s.noise, case.strengths or 1.0, case.seed, s.bench)
        except NoSolutionError:
            if trial == TRIALS - 1:
                raise
    raise AssertionError("unreachable")


def _designs() -> dict[str, tuple[str, ...]]:
    """Kinds of each group, in an order of their own, mixed once for all."""
    rng = np.random.default_rng(12)

    def mixed(kinds: list[str]) -> tuple[str, ...]:
        return tuple(kinds[i] for i in rng.permutation(len(kinds)))

    effects = LIBRARY
    pairs, triples = (["+".join(c) for c in combinations(effects, n)] for n in (2, 3))
    # Outside families twice as often as those of the library under another name.
    energies = [f"typical:{f}" for f in (*FOREIGN_ENERGIES, *FOREIGN_ENERGIES, *DECLARED) if f != "neo_hookean"]
    return {
        "null": ("null",),
        "single": mixed(list(effects)),
        "pair": mixed(pairs),
        "triple": mixed(triples),
        "energy": mixed(energies),
        "mixed": mixed([f"typical:{f}+{e}" for f in FOREIGN_ENERGIES for e in effects]),
        "foreign": mixed(list(OUTSIDE)),
    }


def _strengths(kind: str, group: str, seed: int) -> tuple[float, ...]:
    """One for each name of ``kind``: the strongest anywhere on the scale, the others up to `UNEQUAL` times weaker."""
    names = [] if kind == "null" else kind.split("+")
    rng = np.random.default_rng([seed, 78])
    low, high = (FAINTEST_FOREIGN, STRONGEST_FOREIGN) if group == "foreign" else (WEAKEST, STRONGEST)
    faults = [n for n in names if ":" not in n]
    top = np.exp(rng.uniform(np.log(low), np.log(high)))
    weaker = np.exp(-rng.uniform(0.0, np.log(UNEQUAL), len(faults)))
    if faults:
        weaker[rng.integers(len(faults))] = 1.0
    by = dict(zip(faults, top * weaker / UNIT, strict=True))
    return tuple(round(float(by.get(n, 1.0)), 4) for n in names)


# ---- the third generator ---------------------------------------------------------------------------------------------

THIRD, THIRD_SEED = "third", 20_260_723
OF_THE_FILM = "of the film"
"""What stands for the declared energy in the plan of the third generator, where it is drawn with the film: ``declared``
of its truth."""


def third_plan(half: str = THIRD, base: int = THIRD_SEED) -> Iterator[Case]:
    """The cases of the third generator, in order; ``base`` is the seed of all of them, and they differ by number."""
    if half != THIRD:
        raise ValueError(f"the third generator has no half {half!r}: nothing is tuned on it")
    for recipe in recipes(base):
        yield Case(recipe.number, _group_of(recipe), f"{recipe.group} {recipe.number}", OF_THE_FILM, (), base)


def third_measured(case: Case) -> ThirdDataset:
    """The measurement of a case. Raises `NoBalanceError` if no film can be found for it."""
    return generate_third(next(islice(recipes(case.seed), case.number, None)))


def _group_of(recipe: Recipe | BenchRecipe) -> str:
    """Name in `GROUPS`; pairs and triples are so called whatever their energy."""
    none, one = ("null", "single") if recipe.common_energy else ("energy", "mixed")
    return {"none": none, "one": one, "two": "pair", "three": "triple", "foreign": "foreign"}[recipe.group]


# ---- the fourth generator --------------------------------------------------------------------------------------------

FOURTH, FOURTH_SEED = "fourth", 1


def fourth_plan(half: str = FOURTH, base: int = FOURTH_SEED) -> Iterator[Case]:
    """The cases of the fourth generator, in order; ``base`` is the seed of all of them, and they differ by number."""
    if half != FOURTH:
        raise ValueError(f"the fourth generator has no half {half!r}: nothing is tuned on it")
    for recipe in fourth_recipes(base):
        yield Case(recipe.number, _group_of(recipe), f"{recipe.group} {recipe.number}", OF_THE_FILM, (), base)


def fourth_measured(case: Case) -> BenchDataset:
    """The measurement of a case. Raises `NoBalanceError` if no film can be found for it."""
    return generate_fourth(next(islice(fourth_recipes(case.seed), case.number, None)))
