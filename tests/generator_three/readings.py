"""What the load cell scatters: white or correlated noise, even or growing with the force, strays, and steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.generator_three.journey import Journey
from tests.generator_three.recipes import NoiseRecipe

GROWING = 0.7  # of the deviation, in the mean square, grows with the force
FAR = (5, 15)  # deviations


def noise_deviations(recipe: NoiseRecipe, sd: float, force: Any) -> Any:
    """(N,) N, whose mean square is about sd^2 where they grow: 0.51 sd^2 + 0.49 sd^2 F^2/<F^2>."""
    if not recipe.grows:
        return np.full(len(force), sd)
    slope = GROWING * sd / np.sqrt(np.mean(force**2))
    return np.sqrt((1 - 0.49) * sd**2 + (slope * force) ** 2)


@dataclass(frozen=True, eq=False)
class Noisy:
    """force : (N,) N as read; rho : correlation of neighbours; strays : numbers of readings; step : N, 0 for none."""

    force: Any
    rho: float
    strays: tuple[int, ...]
    step: float


def read_with_noise(
    rng: np.random.Generator, recipe: NoiseRecipe, clean: Any, deviations: Any, sd: float, way: Journey
) -> Noisy:
    """Readings of the force (N,) N."""
    scatter, rho = rng.standard_normal(len(clean)), 0.0
    if recipe.correlated:
        rho = float(rng.uniform(0.2, 0.6))
        scatter = _correlated(scatter, rho)
    force = clean + deviations * scatter
    strays = _strays(rng, force, deviations, way) if recipe.strays else []
    step = 0.0
    if recipe.rounded:
        step = float(f"{sd * rng.uniform(0.3, 0.9):.3g}")
        force = np.round(force / step) * step
    return Noisy(force, rho, tuple(sorted(strays)), step)


def _correlated(white: Any, rho: float) -> Any:
    out = white.copy()
    for i in range(1, len(white)):
        out[i] = rho * out[i - 1] + np.sqrt(1 - rho**2) * white[i]
    return out


def _strays(rng: np.random.Generator, force: Any, deviations: Any, way: Journey) -> list[int]:
    """Numbers of the readings that are put off, near turns more often than not; ``force`` is changed."""
    out: list[int] = []
    for _ in range(int(rng.integers(1, 4))):
        near_a_turn = rng.uniform() < 0.6
        place = rng.choice(way.turns) + rng.integers(-4, 5) if near_a_turn else rng.integers(0, len(force))
        number = int(np.clip(place, 2, len(force) - 1))
        if number not in out:
            out.append(number)
            force[number] += float(rng.choice([-1, 1]) * rng.uniform(*FAR)) * deviations[number]
    return out
