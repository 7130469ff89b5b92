"""W(l1, l2) of an incompressible film, N/mm: P1, P2, P11, P12, P22, its derivatives by the two stretches.

Ten energies are functions of I1 and I2 without mixed terms, W = U(I1) + V(I2), and are given by U', V', U'', V''.
Ogden's W = sum c/a (l1^a + l2^a + (l1 l2)^-a) is given by stretches. Beyond the pole of an energy there is no number.

Moduli are in N/mm (a modulus in MPa times a thickness in mm), since the files are in mm and N.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

Slopes = tuple[Any, Any, Any, Any]
Derivatives = tuple[Any, Any, Any, Any, Any]


@dataclass(frozen=True)
class StrainEnergy:
    """names : of the parameters; pure : those that are numbers and not N/mm; slopes : (I1, I2, p) -> U', V', U'', V'',
    none for an energy of stretches.
    """

    names: tuple[str, ...]
    pure: tuple[str, ...] = ()
    slopes: Callable[[Any, Any, Any], Slopes] | None = None

    def si(self, p: Any) -> dict[str, float]:
        """The parameters by name, N/m or numbers."""
        return {n: float(v if n in self.pure else 1e3 * v) for n, v in zip(self.names, p, strict=True)}


def derivatives(name: str, p: Any, a: Any, b: Any) -> Derivatives:
    """(P1, P2, P11, P12, P22) at stretches a along and b around."""
    slopes = ENERGIES[name].slopes
    return _of_stretches(p, a, b) if slopes is None else _of_invariants(slopes, p, a, b)


def _of_stretches(p: Any, a: Any, b: Any) -> Derivatives:
    P1 = P2 = P11 = P12 = P22 = 0.0
    for c, n in zip(p[:3], p[3:], strict=True):
        z = (a * b) ** -n
        P1, P2 = P1 + c * (a**n - z) / a, P2 + c * (b**n - z) / b
        P11 = P11 + c * ((n - 1) * a**n + (n + 1) * z) / a**2
        P22 = P22 + c * ((n - 1) * b**n + (n + 1) * z) / b**2
        P12 = P12 + c * n * z / (a * b)
    return P1, P2, P11, P12, P22


def _of_invariants(slopes: Callable[[Any, Any, Any], Slopes], p: Any, a: Any, b: Any) -> Derivatives:
    """Chain rule, with I1 = a^2 + b^2 + 1/(ab)^2 and I2 = (ab)^2 + 1/a^2 + 1/b^2."""
    z = (a * b) ** 2
    u, v, uu, vv = slopes(a * a + b * b + 1 / z, z + 1 / a**2 + 1 / b**2, p)
    i_a, i_b = 2 * a - 2 / z / a, 2 * b - 2 / z / b
    i_aa, i_bb, i_ab = 2 + 6 / z / a**2, 2 + 6 / z / b**2, 4 / z / (a * b)
    j_a, j_b = 2 * z / a - 2 / a**3, 2 * z / b - 2 / b**3
    j_aa, j_bb, j_ab = 2 * b * b + 6 / a**4, 2 * a * a + 6 / b**4, 4 * a * b
    return (
        u * i_a + v * j_a,
        u * i_b + v * j_b,
        uu * i_a * i_a + u * i_aa + vv * j_a * j_a + v * j_aa,
        uu * i_a * i_b + u * i_ab + vv * j_a * j_b + v * j_ab,
        uu * i_b * i_b + u * i_bb + vv * j_b * j_b + v * j_bb,
    )


def _mooney_rivlin(i: Any, j: Any, p: Any) -> Slopes:
    return p[0] + 0 * i, p[1] + 0 * i, 0 * i, 0 * i


def _neo_hookean(i: Any, j: Any, p: Any) -> Slopes:
    return p[0] + 0 * i, 0 * i, 0 * i, 0 * i


def _gent(i: Any, j: Any, p: Any) -> Slopes:
    room = 1 - (i - 3) / p[1]
    room = np.where(room > 1e-3, room, np.nan)
    return p[0] / room, 0 * i, p[0] / p[1] / room**2, 0 * i


def _yeoh(i: Any, j: Any, p: Any) -> Slopes:
    x = i - 3
    return p[0] + 2 * p[1] * x + 3 * p[2] * x * x, 0 * i, 2 * p[1] + 6 * p[2] * x, 0 * i


def _arruda_boyce(i: Any, j: Any, p: Any) -> Slopes:
    """Eight chains of p[1] links, with Padé's inverse of Langevin's function."""
    y = i / 3 / p[1]
    y = np.where(y < 0.999, y, np.nan)
    return p[0] / 6 * (3 - y) / (1 - y), 0 * i, p[0] / 6 * 2 / (1 - y) ** 2 / 3 / p[1], 0 * i


def _fung(i: Any, j: Any, p: Any) -> Slopes:
    e = p[0] * np.exp(p[1] * (i - 3))
    return e, 0 * i, p[1] * e, 0 * i


def _carroll(i: Any, j: Any, p: Any) -> Slopes:
    return p[0] + 4 * p[1] * i**3, p[2] / 2 / np.sqrt(j), 12 * p[1] * i**2, -p[2] / 4 * j**-1.5


def _lopez_pamies(i: Any, j: Any, p: Any) -> Slopes:
    u = i / 3
    first = (p[0] * u ** (p[1] - 1) + p[2] * u ** (p[3] - 1)) / 2
    second = (p[0] * (p[1] - 1) * u ** (p[1] - 2) + p[2] * (p[3] - 1) * u ** (p[3] - 2)) / 6
    return first, 0 * i, second, 0 * i


def _van_der_waals(i: Any, j: Any, p: Any) -> Slopes:
    """U' = mu/2 (1/(1 - eta) - a sqrt((I1 - 3)/2)), eta = sqrt((I1 - 3)/room); eta has no slope at rest."""
    x = np.maximum(i - 3, 1e-8)
    eta = np.sqrt(x / p[1])
    eta = np.where(eta < 0.995, eta, np.nan)
    slope = 1 / (2 * p[1] * eta)
    first = p[0] / 2 * (1 / (1 - eta) - p[2] * np.sqrt(x / 2))
    return first, 0 * i, p[0] / 2 * (slope / (1 - eta) ** 2 - p[2] / 4 / np.sqrt(x / 2)), 0 * i


def _gent_gent(i: Any, j: Any, p: Any) -> Slopes:
    u, _, uu, _ = _gent(i, j, p)
    return u, p[2] / j, uu, -p[2] / j**2


ENERGIES: dict[str, StrainEnergy] = {
    "neo_hookean": StrainEnergy(("c1",), (), _neo_hookean),
    "mooney_rivlin": StrainEnergy(("c1", "c2"), (), _mooney_rivlin),
    "gent": StrainEnergy(("c1", "c2"), ("c2",), _gent),
    "yeoh": StrainEnergy(("c1", "c2", "c3"), (), _yeoh),
    "ogden": StrainEnergy(("c1", "c2", "c3", "a1", "a2", "a3"), ("a1", "a2", "a3")),
    # Families that no user can declare.
    "arruda_boyce": StrainEnergy(("mu", "links"), ("links",), _arruda_boyce),
    "fung": StrainEnergy(("c1", "b"), ("b",), _fung),
    "carroll": StrainEnergy(("a", "b", "c"), (), _carroll),
    "lopez_pamies": StrainEnergy(("mu1", "a1", "mu2", "a2"), ("a1", "a2"), _lopez_pamies),
    "van_der_waals": StrainEnergy(("mu", "room", "a"), ("room", "a"), _van_der_waals),
    "gent_gent": StrainEnergy(("c1", "c2", "c3"), ("c2",), _gent_gent),
}
COMMON = ("neo_hookean", "mooney_rivlin", "gent", "yeoh", "ogden")
UNKNOWN = tuple(k for k in ENERGIES if k not in COMMON)
