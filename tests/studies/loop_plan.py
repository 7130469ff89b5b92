"""The cases of `make study-loop`: a frozen plan in rounds, so that every prefix of it is balanced.

A case's measurement follows from its kind, material, protocol, noise, strength and seed alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from tests.generator.distortions import LIBRARY, OUTSIDE

ROUNDS = 38
MATERIALS = ("neo_hookean", "mooney_rivlin", "gent", "yeoh", "ogden")
CYCLIC = ("staircase", "staircase_twice", "two_speeds")
PATHS = (*CYCLIC, "single")
WHITE, AR1 = "white", "ar1:0.5"
NOISES = (WHITE, AR1, "ar1:0.3+quantised+uneven")
COMPLIANCE = "machine_compliance"
PAIRS = (
    "prestretch+clamp_slip",
    "friction+force_drift",
    "viscoelastic+friction",
    "mullins+friction",
    "clamp_slip+friction",
    "tearing+prestretch",
    "permanent_set+force_drift",
    "mullins+viscoelastic",
)
FOREIGN = ("fung", "arruda_boyce", "lopez_pamies", "gent_gent", "carroll", "gent", "yeoh", "ogden")


@dataclass(frozen=True)
class Case:
    """One measurement. group : null, gain, single, compliance, pair, outside or family; number : place in the plan."""

    number: int
    group: str
    kind: str
    material: str
    protocol: str
    noise: str
    strength: float
    seed: int

    @property
    def key(self) -> str:
        """What makes it the same case in another run."""
        return f"{self.kind}|{self.material}|{self.protocol}|{self.noise}|{self.strength:g}|{self.seed}"


Draw = tuple[str, str, str, str, float]


def _designs() -> dict[str, tuple[Draw, ...]]:
    """(kind, material, protocol, noise, strength) of each stream of cases, shuffled once for all."""
    rng = np.random.default_rng(4)

    def mixed(kinds: tuple[str, ...], paths: tuple[str, ...], noises: tuple[str, ...], strength: float) -> list[Draw]:
        """Every combination; in turn of the kinds, each with the rest in an order of its own."""
        rest = list(product(MATERIALS, paths, noises))
        orders = [[rest[i] for i in rng.permutation(len(rest))] for _ in kinds]
        turns = [[(k, *order[i], strength) for k, order in zip(kinds, orders, strict=True)] for i in range(len(rest))]
        return [turn[i] for turn in turns for i in rng.permutation(len(kinds))]

    singles = tuple(k for k in LIBRARY if k != COMPLIANCE)
    families = [
        (f"{manner}:{kind}", material, path, noise, 1.0)
        for kind, material, path, noise, manner in product(
            FOREIGN, MATERIALS, ("single", "staircase"), (WHITE, AR1), ("family", "typical")
        )
        if kind != material and not (material == "ogden" and kind in MATERIALS) and (kind, material) != FOREIGN[:2]
    ]
    return {
        "null white": tuple(mixed(("null",), PATHS, (WHITE,), 1.0)),
        "null ar1": tuple(mixed(("null",), PATHS, (AR1,), 1.0)),
        "gain": tuple(mixed(("gain",), PATHS, NOISES, 1.0)),
        "single": tuple(mixed(singles, CYCLIC, NOISES, 1.0)),
        "single half": tuple(mixed(singles, CYCLIC, NOISES, 0.5)),
        "single quarter": tuple(mixed(singles, CYCLIC, NOISES, 0.25)),
        "compliance": tuple(mixed((COMPLIANCE,), PATHS, NOISES, 1.0)),
        "pair": tuple(mixed(PAIRS, CYCLIC, (WHITE, AR1), 1.0)),
        "outside": tuple(mixed(OUTSIDE, CYCLIC, NOISES, 1.0)),
        "family": tuple(families[i] for i in rng.permutation(len(families))),
    }


NULLS = ("null white", "null ar1")
ROUND = (
    *(*NULLS, "single", *NULLS, "outside", *NULLS, "family", *NULLS, "single", *NULLS, "single half"),
    *(*NULLS, "pair", *NULLS, "single", *NULLS, "single quarter"),
)
"""Streams of one round, in this order."""
SELDOM = {"compliance": 2, "gain": 5}
"""Streams of every so many rounds."""


def plan(base: int) -> Iterator[Case]:
    """The cases, in order; their seeds are ``base``, ``base`` + 1, ..."""
    designs = _designs()
    taken = dict.fromkeys(designs, 0)
    number = 0
    for turn in range(ROUNDS):
        for stream in (*ROUND, *(s for s, every in SELDOM.items() if turn % every == 0)):
            design = designs[stream]
            draw = design[taken[stream] % len(design)]
            taken[stream] += 1
            yield Case(number, stream.split()[0], *draw, base + number)
            number += 1
