"""One case of a recipe: rigs and faults are drawn until one has a solution and shows its faults as was asked.

Own signal-to-noise ratios are asked for from 3 to 80, log-uniform, in six of seven cases, and otherwise from 1 to 3 or
from 80 to 200; those of a pair or of three are up to five times apart. Sizes come from a few steps of
size * (asked / found)^0.9.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from tests.generator_four.courses import BOTH_WAYS, ONE_WAY, draw_course
from tests.generator_four.faults import FAULTS, FOREIGN_FAULTS, KNOWN_FAULTS, draw_fault
from tests.generator_four.noises import ScatterLaw, draw_scatter
from tests.generator_four.recipes import BenchRecipe
from tests.generator_four.rig import LiftingRig
from tests.generator_four.rubbers import MODULUS, THICKNESS, draw_rubber, log_between
from tests.generator_three.curves import FilmCurves
from tests.generator_three.elements import ElementFilm, NoBalanceError, Rubber
from tests.generator_three.energies import COMMON, UNKNOWN
from tests.generator_three.instrument import Instrument
from tests.generator_three.visibility import Ratios, visibility

ATTEMPTS, DRAWS, STEPS, CLOSE, EXPONENT = 40, 4, 7, 0.12, 0.9
INNER, RATIO, WIDEST = (3.0, 30.0), (1.5, 6.0), 120.0  # mm
STRETCH, LIFTED = (1.2, 3.2), 2.5  # largest stretch; largest lift in free lengths
SCATTER = (8e-4, 1.2e-2)  # of the largest force
USUAL, FAINT, PLAIN, UNEQUAL, RARELY = (3.2, 80.0), (1.0, 3.0), (80.0, 200.0), 5.0, 1 / 14
ONE_WAY_SHARE, FARTHER = 0.12, 1.6
STRONGER = 2.0  # times the sound film's largest force, at most


@dataclass(frozen=True, eq=False)
class FoundCase:
    """A case before its noise is drawn. clean : (N,) N; thickness : um; modulus : MPa."""

    recipe: BenchRecipe
    rig: LiftingRig
    scatter: ScatterLaw
    clean: Any
    thickness: float
    modulus: float
    seen: Mapping[str, Ratios]


def found_case(recipe: BenchRecipe) -> tuple[FoundCase, np.random.Generator]:
    """The case, and the random numbers that its noise goes on with. Raises `NoBalanceError` if none is found."""
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([recipe.seed, recipe.number, attempt, 4])
        with np.errstate(all="ignore"):
            try:
                case = _attempted(recipe, rng)
            except ValueError:  # no balance, or numbers that no spline goes through
                case = None
        if case is not None:
            return case, rng
    raise NoBalanceError(f"no case {recipe.number} of seed {recipe.seed} was found")


def _attempted(recipe: BenchRecipe, rng: np.random.Generator) -> FoundCase | None:
    inner = round(log_between(rng, *INNER), 1)
    outer = round(inner * rng.uniform(*RATIO), 1)
    thickness, modulus = float(round(log_between(rng, *THICKNESS))), log_between(rng, *MODULUS)
    stretch, energy = log_between(rng, *STRETCH), str(rng.choice(COMMON if recipe.common_energy else UNKNOWN))
    rubber = Rubber(energy, draw_rubber(rng, energy, 1e-3 * modulus * thickness, stretch))
    if outer > WIDEST:
        return None
    curves = FilmCurves(ElementFilm(inner, outer), rubber, stretch)
    curves.prepare()
    if curves.peak > LIFTED * (outer - inner) or not np.all(np.diff(curves.sound(curves.grid)) > 0):
        return None
    one_way = rng.uniform() < ONE_WAY_SHARE and recipe.group != "three"
    course = draw_course(rng, str(rng.choice(ONE_WAY if one_way else BOTH_WAYS)), curves.peak)
    plain = LiftingRig(curves, course, {})
    scatter = draw_scatter(rng, recipe.noise, log_between(rng, *SCATTER) * plain.top, plain.top)
    for _ in range(DRAWS):
        names = _names(rng, recipe, one_way)
        rig = LiftingRig(curves, course, {name: draw_fault(rng, name) for name in names})
        found = _sized(rig, scatter, _asked(rng, names))
        if found is not None:
            clean = found[0].reading()
            return FoundCase(recipe, found[0], scatter, clean, thickness, modulus, found[1])
    return None


def _names(rng: np.random.Generator, recipe: BenchRecipe, one_way: bool) -> list[str]:
    among = FOREIGN_FAULTS if recipe.group == "foreign" else KNOWN_FAULTS
    shown = [name for name in among if FAULTS[name].upwards or not one_way]
    return [str(name) for name in rng.permutation(shown)[: recipe.fault_count]]


def _asked(rng: np.random.Generator, names: list[str]) -> dict[str, float]:
    """Own ratios: the first anywhere, the others less, at most `UNEQUAL` times."""
    if not names:
        return {}
    kind = rng.uniform()
    first = log_between(rng, *(FAINT if kind < RARELY else PLAIN if kind > 1 - RARELY else USUAL))
    least = min(first, USUAL[0])
    return {name: max(first * (log_between(rng, 1 / UNEQUAL, 1) if i else 1), least) for i, name in enumerate(names)}


def _sized(rig: LiftingRig, scatter: ScatterLaw, asked: Mapping[str, float]) -> tuple[LiftingRig, Any] | None:
    """The rig with sizes that show as much as asked, and what they show; none if a plausible size does not."""
    for _ in range(STEPS):
        if not _plausible(rig):
            return None
        seen = visibility(cast(Instrument, rig), scatter.deviations(rig.reading()))
        apart = {name: np.log(asked[name] / max(seen[name].own, 1e-6)) for name in asked}
        if all(abs(a) < CLOSE for a in apart.values()):
            return rig, seen
        resized = rig.with_sizes({name: _resized(rig, name, a) for name, a in apart.items()})
        if all(resized.flaws[name].size == rig.flaws[name].size for name in asked):
            return None
        rig = resized
    return None


def _resized(rig: LiftingRig, name: str, apart: float) -> float:
    size = rig.flaws[name].size
    times = np.exp(np.clip(EXPONENT * apart, -2.3, FARTHER))
    return float(np.sign(size) * np.clip(abs(size) * times, *FAULTS[name].limits))


def _plausible(rig: LiftingRig) -> bool:
    force, within = rig.reading(), rig.deflection() <= rig.curves.grid[-1]
    return bool(np.isfinite(force).all() and within.all() and abs(force).max() < STRONGER * rig.top)
