"""Parameters drawn for a film of shear stiffness G d (N/mm) at rest, roughly, that does not lock too early.

Where an energy has a scale of stretch, it follows from the largest stretch that the test is to reach:
I1 - 3 = l^2 + l^-2 - 2 of a film that is pulled along and kept around.
"""

from __future__ import annotations

import numpy as np


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number between the two, its logarithm uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def draw_parameters(rng: np.random.Generator, name: str, stiffness: float, stretch: float) -> list[float]:
    """Parameters of an energy in its order, for a film that is to be stretched by ``stretch`` at most."""
    strain = stretch**2 + stretch**-2 - 2
    if name in ("yeoh", "ogden", "carroll", "lopez_pamies"):
        return _of_several_terms(rng, name, stiffness, stretch)
    half = stiffness / 2
    if name == "neo_hookean":
        return [half]
    if name == "mooney_rivlin":
        share = rng.uniform(0.03, 0.3)
        return [half / (1 + share), half * share / (1 + share)]
    if name == "gent":
        return [half, strain * log_uniform(rng, 1.6, 8)]
    if name == "arruda_boyce":
        return [stiffness, ((3 + strain) / 3) * log_uniform(rng, 1.5, 6)]
    if name == "fung":
        return [half, rng.uniform(0.1, 0.9) / strain]
    if name == "van_der_waals":
        room = strain * log_uniform(rng, 2.5, 9)
        return [stiffness, room, rng.uniform(0.1, 0.7) * np.sqrt(2 / room)]
    if name == "gent_gent":
        share = rng.uniform(0.1, 0.5)
        return [half / (1 + share / 3), strain * log_uniform(rng, 1.6, 6), share * half / (1 + share / 3)]
    raise ValueError(f"no energy {name!r}")


def _of_several_terms(rng: np.random.Generator, name: str, stiffness: float, stretch: float) -> list[float]:
    strain = stretch**2 + stretch**-2 - 2
    u = rng.uniform
    if name == "yeoh":
        return [stiffness / 2, -u(0, 0.22) * stiffness / 2 / strain, u(0.04, 0.2) * stiffness / 2 / strain**2]
    if name == "ogden":
        exponents = [u(1.3, 2.2), u(3.5, 6), -u(1, 2.5)]
        parts = np.array([1, u(0.05, 0.5) * stretch ** -(exponents[1] - 2), u(0.02, 0.15)])
        parts /= parts.sum()
        return [2 * stiffness * x / n for x, n in zip(parts, exponents, strict=True)] + exponents
    if name == "carroll":
        second, third = u(0.05, 0.4), u(0.05, 0.3)
        cubic = second * stiffness / 2 / (4 * (3 + strain) ** 3) * u(0.5, 1.5)
        return [stiffness / 2, cubic, third * stiffness * np.sqrt(3)]
    part = u(0.02, 0.3)
    return [stiffness * (1 - part), u(0.6, 1.1), stiffness * part, u(1.6, 3.2)]
