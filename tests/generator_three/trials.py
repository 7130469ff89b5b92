"""One case of a recipe: films, tests and flaws are drawn until one can be solved and shows its flaws as asked.

The strongest own ratio is log-uniform between 3 and 80, and the others are within a factor of five of it. Sizes are
found by a few steps of size * (wanted / found)^0.85.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.generator_three.curves import FilmCurves
from tests.generator_three.elements import ElementFilm, NoBalanceError, Rubber
from tests.generator_three.energies import COMMON, UNKNOWN
from tests.generator_three.flaw_draws import draw_flaw
from tests.generator_three.flaws import EFFECTS, FLAWS, LOADING, clash
from tests.generator_three.instrument import Instrument
from tests.generator_three.journey import KINDS, MONOTONE, draw_journey
from tests.generator_three.materials import draw_parameters, log_uniform
from tests.generator_three.readings import noise_deviations
from tests.generator_three.recipes import Recipe
from tests.generator_three.visibility import Ratios, visibility

ATTEMPTS, DRAWS, STEPS = 60, 6, 9
OUTER = (15, 60)  # mm
LEAST_ASKED, MOST_ASKED, UNEQUAL = 3.3, 80, 5
LEAST, MOST, UNEQUAL_FOUND = 3, 100, 5.6
CLOSE, EXPONENT, SLOWER = 0.12, 0.85, 0.6
NOISE = (1e-3, 1e-2)  # standard deviation in parts of the largest force
LIFTED = 3  # times the sound film's largest force, at most


@dataclass(frozen=True, eq=False)
class Stock:
    """What the film is made of: thickness um, shear modulus MPa, and how far it is stretched."""

    thickness: float
    modulus: float
    stretch: float


@dataclass(frozen=True, eq=False)
class Accepted:
    """An accepted case before its noise is drawn: clean : (N,) N; deviations : (N,) N; sd : N, their size."""

    recipe: Recipe
    stock: Stock
    instrument: Instrument
    clean: Any
    deviations: Any
    sd: float
    seen: Mapping[str, Ratios]


def accepted(recipe: Recipe) -> tuple[Accepted, np.random.Generator]:
    """The case, and the random numbers that its noise is to go on with. Raises `NoBalanceError` if none is found."""
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([recipe.seed, recipe.number, attempt])
        found = _attempted(recipe, rng)
        if found is not None:
            return found, rng
    raise NoBalanceError(f"no case {recipe.number} of seed {recipe.seed} was found")


def _attempted(recipe: Recipe, rng: np.random.Generator) -> Accepted | None:
    energy = str(rng.choice(COMMON if recipe.common_energy else UNKNOWN))
    kind = MONOTONE if recipe.loading_only else str(rng.choice(KINDS))
    inner, ratio = log_uniform(rng, 3, 15), rng.uniform(2, 6)
    if not OUTER[0] <= inner * ratio <= OUTER[1]:
        return None
    film = ElementFilm(round(inner, 2), round(round(inner, 2) * ratio, 2))
    thickness, modulus = round(log_uniform(rng, 20, 200), 1), log_uniform(rng, 0.05, 1.5)
    stock = Stock(thickness, modulus, rng.uniform(1.3, 2.8))
    parameters = draw_parameters(rng, energy, modulus * thickness * 1e-3, stock.stretch)
    curves = FilmCurves(film, Rubber(energy, tuple(parameters)), stock.stretch)
    try:
        curves.prepare()
    except NoBalanceError:
        return None
    journey = draw_journey(rng, kind, curves.peak)
    noise = log_uniform(rng, *NOISE)
    for _ in range(DRAWS):
        names = _names(recipe, kind, rng)
        flaws = [draw_flaw(rng, name, journey, curves.peak) for name in names]
        if clash(flaws):
            continue
        asked = _asked(names, rng)
        if asked is None:
            continue
        instrument = Instrument(curves, journey, {f.name: f for f in flaws})
        found = _sized_to(asked, recipe, stock, instrument, noise * instrument.scales.force)
        if found is not None:
            return found
    return None


def _names(recipe: Recipe, kind: str, rng: np.random.Generator) -> list[str]:
    if recipe.group == "foreign":
        return [str(rng.choice(["ripple", "clipped", "temperature_step", *([] if kind == MONOTONE else ["backlash"])]))]
    names = [n for n in (LOADING if kind == MONOTONE else EFFECTS) if n != "rate" or kind == "speeds"]
    # Few tests can show it, so it is asked for where one can.
    weights = np.array([5.0 if n == "rate" else 1.0 for n in names])
    return [str(n) for n in rng.choice(names, recipe.flaw_count, replace=False, p=weights / weights.sum())]


def _asked(names: list[str], rng: np.random.Generator) -> dict[str, float] | None:
    """Own ratios to be reached; none if they turn out too unequal."""
    first = log_uniform(rng, LEAST, MOST_ASKED)
    out = {}
    for i, name in enumerate(names):
        times = log_uniform(rng, 1, UNEQUAL) ** float(rng.choice([-1, 1])) if i else 1.0
        out[name] = float(np.clip(first * times, 3.2, MOST_ASKED)) if i else first
    if len(names) > 1 and max(out.values()) / min(out.values()) > UNEQUAL:
        return None
    return {k: max(v, LEAST_ASKED) for k, v in out.items()}


def _sized_to(
    asked: Mapping[str, float], recipe: Recipe, stock: Stock, instrument: Instrument, sd: float
) -> Accepted | None:
    """The case with sizes that show as much as asked, or as near as is acceptable; none if nothing is."""
    try:
        for step in range(STEPS):
            clean = instrument.reading()
            deviations = noise_deviations(recipe.noise, sd, clean)
            seen = visibility(instrument, deviations)
            if not np.isfinite(clean).all() or abs(clean).max() > LIFTED * instrument.scales.force:
                break
            near = all(abs(np.log(seen[k].own / asked[k])) < CLOSE for k in asked)
            if near or step == STEPS - 1:
                break
            instrument = instrument.with_sizes(
                {k: _resized(instrument, k, asked[k] / max(seen[k].own, 1e-3)) for k in asked}
            )
        found = Accepted(recipe, stock, instrument, clean, deviations, sd, seen)
        return found if _acceptable(found) else None
    except ValueError:  # no balance, or numbers that no spline goes through
        return None


def _resized(instrument: Instrument, name: str, times: float) -> float:
    size = instrument.flaws[name].size
    factor = np.clip(times**EXPONENT, 0.1, 6)
    if name == "clipped":  # shows more than in proportion
        factor = factor**SLOWER
    return float(np.sign(size) * np.clip(abs(size) * factor, *FLAWS[name].limits))


def _acceptable(found: Accepted) -> bool:
    own, largest = [s.own for s in found.seen.values()], abs(found.clean).max()
    return bool(
        np.isfinite(found.clean).all()
        and all(LEAST <= v <= MOST for v in own)
        and (len(own) < 2 or max(own) / min(own) <= UNEQUAL_FOUND)
        and largest < LIFTED * found.instrument.scales.force
        and NOISE[0] <= found.sd / largest <= NOISE[1]
        # What lies beyond the solved states is no film.
        and found.instrument.deflection().max() <= found.instrument.curves.grid[-1]
    )
