"""Strain energies by their tensions P1, P2 (N/m), as plain arithmetic that complex stretches pass through.

A law is a function (constants, l1, l2) -> (P1, P2). The constants that multiply the energy come first and grow with the
thickness; the others are numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

Numbers = Any
"""Arrays, real or complex."""


@dataclass(frozen=True)
class Elastic:
    """names : of the constants, of which the first ``moduli`` multiply the energy; ranges : of each, for soft rubber of
    50 um, the moduli in parts of half the modulus (N/m) that is drawn first, the rest as they are.
    """

    names: tuple[str, ...]
    moduli: int
    ranges: tuple[tuple[float, float], ...]
    tensions: Callable[[Any, Numbers, Numbers], tuple[Numbers, Numbers]]

    def draw(self, rng: np.random.Generator, thickness: float) -> tuple[float, ...]:
        """Constants of a film so thick (m)."""
        half = float(np.exp(rng.uniform(np.log(4.0), np.log(11.0)))) * thickness / 50e-6
        values = [float(rng.uniform(*r)) for r in self.ranges]
        return tuple(v * half if i < self.moduli else v for i, v in enumerate(values))


def _through(slopes: Callable[[Any, Numbers, Numbers], tuple[Numbers, Numbers]]) -> Any:
    """Tensions of an energy whose slopes (dW/dI1, dW/dI2) are functions of (constants, I1 - 3, I2 - 3)."""

    def tensions(c: Any, a: Numbers, b: Numbers) -> tuple[Numbers, Numbers]:
        z = 1 / (a * b)
        x, y = slopes(c, a * a + b * b + z * z - 3, 1 / (a * a) + 1 / (b * b) + 1 / (z * z) - 3)
        # With the third direction free of stress, l P = 2 (l^2 - z^2) (W1 + m^2 W2), m the other stretch.
        return 2 * (a - z * z / a) * (x + b * b * y), 2 * (b - z * z / b) * (x + a * a * y)

    return tensions


def _ogden(c: Any, a: Numbers, b: Numbers) -> tuple[Numbers, Numbers]:
    p = q = 0.0
    for mu, n in zip(c[:3], c[3:], strict=True):
        z = (a * b) ** -n
        p, q = p + mu * (a**n - z) / a, q + mu * (b**n - z) / b
    return p, q


def _tube(c: Any, a: Numbers, b: Numbers) -> tuple[Numbers, Numbers]:
    """Extended tube: G/2 ((1 - d^2) k/(1 - d^2 k) + ln(1 - d^2 k)) + 2 Ge/beta^2 sum (l^-beta - 1)
    (Kaliske and Heinrich 1999).
    """
    g, ge, d, beta = c
    z = 1 / (a * b)
    k = a * a + b * b + z * z - 3
    room = 1 - d * d * k
    slope = g / 2 * ((1 - d * d) / room**2 - d * d / room)

    def one(l: Numbers) -> Numbers:  # noqa: E741 - a stretch
        return (2 * slope * (l * l - z * z) - 2 * ge / beta * (l**-beta - z**-beta)) / l

    return one(a), one(b)


ELASTIC: dict[str, Elastic] = {
    "neo_hookean": Elastic(("c1",), 1, ((1.0, 1.0),), _through(lambda c, i, j: (c[0] + 0 * i, 0.0))),
    "mooney_rivlin": Elastic(
        ("c1", "c2"), 2, ((0.72, 0.95), (0.06, 0.28)), _through(lambda c, i, j: (c[0] + 0 * i, c[1]))
    ),
    "gent": Elastic(
        ("c1", "c2"), 1, ((1.0, 1.0), (14.0, 45.0)), _through(lambda c, i, j: (c[0] / (1 - i / c[1]), 0.0))
    ),
    "yeoh": Elastic(
        ("c1", "c2", "c3"),
        3,
        ((1.0, 1.0), (-0.07, -0.02), (0.003, 0.008)),
        _through(lambda c, i, j: (c[0] + 2 * c[1] * i + 3 * c[2] * i * i, 0.0)),
    ),
    "ogden": Elastic(
        ("c1", "c2", "c3", "a1", "a2", "a3"),
        3,
        ((2.1, 2.7), (0.01, 0.06), (-0.15, -0.03), (1.4, 1.8), (4.0, 5.8), (-1.8, -1.0)),
        _ogden,
    ),
    # Families that no user can declare.
    "biderman": Elastic(  # Biderman 1958
        ("c1", "c01", "c20", "c30"),
        4,
        ((0.8, 0.95), (0.04, 0.2), (-0.03, -0.005), (0.0005, 0.003)),
        _through(lambda c, i, j: (c[0] + 2 * c[2] * i + 3 * c[3] * i * i, c[1])),
    ),
    "knowles": Elastic(  # Knowles 1977
        ("mu", "b", "n"),
        1,
        ((1.0, 1.0), (0.3, 2.0), (1.1, 2.0)),
        _through(lambda c, i, j: (c[0] * (1 + c[1] * i / c[2]) ** (c[2] - 1), 0.0)),
    ),
    "hart_smith": Elastic(  # Hart-Smith 1966
        ("c1", "k2", "k1"),
        2,
        ((0.75, 0.95), (0.2, 0.8), (0.001, 0.006)),
        _through(lambda c, i, j: (c[0] * np.exp(c[2] * i * i), c[1] / (j + 3))),
    ),
    "extended_tube": Elastic(("gc", "ge", "d", "beta"), 2, ((1.0, 1.6), (0.3, 0.9), (0.1, 0.2), (0.3, 1.0)), _tube),
    "davis_de_thomas": Elastic(  # Davies, De and Thomas 1994
        ("a", "k", "c", "n"),
        2,
        ((0.9, 1.1), (0.002, 0.01), (0.3, 0.9), (0.05, 0.3)),
        _through(lambda c, i, j: (c[0] * (i + c[2] ** 2) ** (-c[3] / 2) + 2 * c[1] * i, 0.0)),
    ),
}
COMMON = ("neo_hookean", "mooney_rivlin", "gent", "yeoh", "ogden")
UNKNOWN = tuple(k for k in ELASTIC if k not in COMMON)
