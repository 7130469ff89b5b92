"""Parameters of films that are drawn, N/mm and numbers: silicones, acrylics and natural rubbers, more or less stiff.

``strain`` is I1 - 3 of a strip as wide as it is clamped, pulled as far as the test is to go; limits and curvatures of
an energy are relative to it, so that the test sees them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

MODULUS, THICKNESS = (0.05, 2.0), (20.0, 300.0)  # MPa, um


def log_between(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return float(low * (high / low) ** rng.uniform())


def draw_rubber(rng: np.random.Generator, energy: str, stiffness: float, stretch: float) -> tuple[float, ...]:
    """Parameters for a shear stiffness G d (N/mm) and a largest stretch."""
    strain = stretch**2 + stretch**-2 - 2
    return tuple(float(x) for x in _DRAWS[energy](rng, stiffness, strain))


def _gent(rng: np.random.Generator, g: float, strain: float) -> Any:
    return g / 2, strain * log_between(rng, 1.5, 12)


def _mooney_rivlin(rng: np.random.Generator, g: float, strain: float) -> Any:
    second = rng.uniform(0.02, 0.25)
    return (1 - second) * g / 2, second * g / 2


def _yeoh(rng: np.random.Generator, g: float, strain: float) -> Any:
    return g / 2, -rng.uniform(0.02, 0.2) * g / 2 / strain, rng.uniform(0.03, 0.25) * g / 2 / strain**2


def _ogden(rng: np.random.Generator, g: float, strain: float) -> Any:
    """Shares of the stiffness: sum C a = 2 G d."""
    exponents = np.array([rng.uniform(1.2, 2.4), rng.uniform(3.5, 7), -rng.uniform(0.8, 2.5)])
    shares = np.array([1, rng.uniform(0.03, 0.4) * (1 + strain) ** (1 - exponents[1] / 2), rng.uniform(0.02, 0.2)])
    return [*(2 * g * shares / shares.sum() / exponents), *exponents]


def _arruda_boyce(rng: np.random.Generator, g: float, strain: float) -> Any:
    return g, (1 + strain / 3) * log_between(rng, 1.4, 7)


def _carroll(rng: np.random.Generator, g: float, strain: float) -> Any:
    hardens = rng.uniform(0.05, 0.5)
    return g / 2, hardens * g / 8 / (3 + strain) ** 3, rng.uniform(0.03, 0.3) * g


def _lopez_pamies(rng: np.random.Generator, g: float, strain: float) -> Any:
    second = rng.uniform(0.01, 0.2)
    return (1 - second) * g, rng.uniform(0.55, 1.05), second * g, rng.uniform(1.5, 3.5)


def _van_der_waals(rng: np.random.Generator, g: float, strain: float) -> Any:
    room = strain * log_between(rng, 2, 12)
    return g, room, rng.uniform(0.1, 0.8) * np.sqrt(2 / room)


def _gent_gent(rng: np.random.Generator, g: float, strain: float) -> Any:
    second = rng.uniform(0.1, 0.6)
    return g / 2 / (1 + second / 3), strain * log_between(rng, 1.5, 8), second * g / 2 / (1 + second / 3)


_DRAWS: dict[str, Callable[[np.random.Generator, float, float], Any]] = {
    "neo_hookean": lambda rng, g, strain: (g / 2,),
    "mooney_rivlin": _mooney_rivlin,
    "gent": _gent,
    "yeoh": _yeoh,
    "ogden": _ogden,
    "arruda_boyce": _arruda_boyce,
    "fung": lambda rng, g, strain: (g / 2, rng.uniform(0.1, 1.0) / strain),
    "carroll": _carroll,
    "lopez_pamies": _lopez_pamies,
    "van_der_waals": _van_der_waals,
    "gent_gent": _gent_gent,
}
