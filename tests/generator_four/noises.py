"""What the load cell and its converter scatter: white or AR(1), even or in part proportional to the force, in steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.generator_four.recipes import NoiseOrder
from tests.generator_four.rubbers import log_between

FAR, RARE = (5.0, 20.0), 0.006  # deviations of a stray; part of the readings
CORRELATION, STEP = (0.15, 0.7), (0.4, 1.6)


@dataclass(frozen=True)
class ScatterLaw:
    """base : N, of all readings; relative : of the force; step : N, 0 for none; rho : of neighbours."""

    base: float
    relative: float
    step: float
    rho: float

    def deviations(self, force: Any) -> Any:
        """(N,) N: sqrt(base^2 + (relative F)^2 + step^2 / 12)"""
        return np.sqrt(self.base**2 + (self.relative * force) ** 2 + self.step**2 / 12)


@dataclass(frozen=True, eq=False)
class NoisyForce:
    """force : (N,) N as written; strays : their numbers."""

    force: Any
    strays: tuple[int, ...]


def draw_scatter(rng: np.random.Generator, order: NoiseOrder, sd: float, top: float) -> ScatterLaw:
    """A law whose deviations are about ``sd`` N, for forces up to ``top`` N."""
    rho = float(rng.uniform(*CORRELATION)) if order.correlated else 0.0
    step = float(f"{sd * log_between(rng, *STEP):.2g}") if order.quantised else 0.0
    if order.proportional:
        return ScatterLaw(0.5 * sd, float(rng.uniform(1, 2.5)) * sd / top, step, rho)
    return ScatterLaw(sd, 0.0, step, rho)


def scattered(rng: np.random.Generator, law: ScatterLaw, strays: bool, clean: Any) -> NoisyForce:
    """Readings of the force (N,) N: x_i = rho x_(i-1) + sqrt(1 - rho^2) white, in deviations."""
    white = rng.standard_normal(len(clean))
    noise = white.copy()
    for i in range(1, len(white)):
        noise[i] = law.rho * noise[i - 1] + np.sqrt(1 - law.rho**2) * white[i]
    deviations = np.hypot(law.base, law.relative * clean)
    force, off = clean + deviations * noise, []
    if strays:
        count = 1 + int(rng.binomial(len(clean), RARE))
        off = sorted(rng.permutation(np.arange(2, len(clean)))[:count].tolist())
        force[off] += rng.choice([-1, 1], count) * rng.uniform(*FAR, count) * deviations[off]
    if law.step:
        force = np.round(force / law.step) * law.step
    return NoisyForce(force, tuple(off))
