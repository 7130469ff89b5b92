"""The model of a published posterior of VHB 4910: nonaffine chains, and a spring and dashpot beside them.

    sigma = sigma_e(l) + Q,   dQ/dt = gamma dl/dt - Q gamma / eta,
    W_e = Gc/6 I1 - Gc lm^2 ln(3 lm^2 - I1) + Ge sum_j (l_j + 1/l_j),

P. R. Miles, M. Hays, R. Smith, W. Oates, Mech. Mater. 91 (2015) 35; J. D. Davidson, N. C. Goulbourne, J. Mech. Phys.
Solids 61 (2013) 1784. Energy and effect are declared here as anyone may declare their own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.parameters import Array, Normal, Parameter, Uniform
from bayesmembrane.physics.effects.base import EffectParameter, Memory
from bayesmembrane.physics.materials._digits import ln_one_plus
from bayesmembrane.physics.materials.base import Derivatives, Material
from bayesmembrane.physics.materials.invariants import first_invariant, of_first, rate_of_first
from tests.studies.vhb_data import RIG, TAPE

HELD = 7.55e3, 17.7e3, 4.8
"""Gc and Ge in Pa, and lm, as they were held."""
NARROW = 1e-6


def held() -> tuple[float, float, float]:
    """Coordinates of the energy that is held: ln G d, ln e/c and m."""
    gc, ge, lm = HELD
    gd = TAPE.thickness * (gc / 3 + 2 * gc * lm**2 / (3 * lm**2 - 3) + ge)
    return float(np.log(gd)), float(np.log(ge / gc)), lm


@dataclass(frozen=True)
class Nonaffine(Material):
    """W = c/6 (I1 - 3) - c m^2 ln(1 - (I1 - 3) / (3 m^2 - 3)) + e (l1 + 1/l1 + l2 + 1/l2 + l1 l2 + 1/(l1 l2) - 6)."""

    c: float
    e: float
    m: float

    name: ClassVar[str] = "nonaffine"
    title: ClassVar[str] = "nonaffine"
    ordinary: ClassVar[bool] = False
    reference: ClassVar[str] = "J. D. Davidson, N. C. Goulbourne, J. Mech. Phys. Solids 61 (2013) 1784"
    units: ClassVar[tuple[str, ...]] = ("N/m", "N/m", "-")
    meanings: ClassVar[tuple[str, ...]] = (
        "crosslinks x thickness",
        "entanglements x thickness",
        "largest stretch of the chains",
    )
    scales: ClassVar[tuple[int, ...]] = (1, 1, 0)
    coordinates: ClassVar[tuple[Parameter, ...]] = tuple(
        Parameter(name, "-", "held", Normal(value, NARROW), (value - 1.0, value + 1.0))
        for name, value in zip(("ln_gd", "ln_e_c", "m"), held(), strict=True)
    )

    @staticmethod
    def derivatives(p: Any, l1: Any, l2: Any) -> Derivatives:
        i = first_invariant(l1, l2)
        open_ = 3.0 * p[2] * p[2] - 3.0
        left = open_ - i[0]
        k = p[0] * p[2] * p[2]
        one = of_first(i, p[0] / 6.0 * i[0] - k * ln_one_plus(-i[0] / open_), p[0] / 6.0 + k / left, k / (left * left))
        a, b, q = 1.0 / l1, 1.0 / l2, 1.0 / (l1 * l2)
        return (
            one[0] + p[1] * (l1 + a + l2 + b + l1 * l2 + q - 6.0),
            one[1] + p[1] * (1.0 - a * a + l2 - a * q),
            one[2] + p[1] * (1.0 - b * b + l1 - b * q),
            one[3] + p[1] * 2.0 * a * a * (a + q),
            one[4] + p[1] * (1.0 + q * q),
            one[5] + p[1] * 2.0 * b * b * (b + q),
        )

    @staticmethod
    def sensitivities(p: Any, l1: Any, l2: Any) -> tuple[tuple[Any, Any, Any], ...]:
        i = first_invariant(l1, l2)
        square = p[2] * p[2]
        open_ = 3.0 * square - 3.0
        left = open_ - i[0]
        ln = ln_one_plus(-i[0] / open_)
        a, b, q = 1.0 / l1, 1.0 / l2, 1.0 / (l1 * l2)
        return (
            rate_of_first(i, i[0] / 6.0 - square * ln, 1.0 / 6.0 + square / left),
            (l1 + a + l2 + b + l1 * l2 + q - 6.0, 1.0 - a * a + l2 - a * q, 1.0 - b * b + l1 - b * q),
            rate_of_first(
                i,
                -2.0 * p[0] * p[2] * (ln + 3.0 * square * i[0] / (open_ * left)),
                2.0 * p[0] * p[2] * (1.0 / left - 3.0 * square / (left * left)),
            ),
        )

    @staticmethod
    def to_coordinates(p: ArrayLike) -> Array:
        c, e, m = np.asarray(p, dtype=float)
        with np.errstate(all="ignore"):
            return np.stack([np.log(Nonaffine.shear_modulus((c, e, m))), np.log(e / c), m])

    @staticmethod
    def from_coordinates(x: ArrayLike) -> Array:
        ln_gd, ln_e_c, m = np.asarray(x, dtype=float)
        c = np.exp(ln_gd) / Nonaffine.shear_modulus((1.0, np.exp(ln_e_c), m))
        return np.stack([c, c * np.exp(ln_e_c), m])

    @staticmethod
    def shear_modulus(p: Any) -> Any:
        return p[0] / 3.0 + 2.0 * p[0] * p[2] * p[2] / (3.0 * p[2] * p[2] - 3.0) + p[1]


@dataclass(frozen=True)
class Dashpot(Memory):
    """F = F0 + A Q of a strip of cross-section A, with dQ/dt = gamma dl/dt - Q gamma / eta."""

    name: ClassVar[str] = "dashpot"
    title: ClassVar[str] = "spring and dashpot beside the chains"
    reference: ClassVar[str] = "P. R. Miles, M. Hays, R. Smith, W. Oates, Mech. Mater. 91 (2015) 35"
    signature: ClassVar[str] = "Unloading below loading, with a gap that closes at rest."
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("gamma", "Pa", "modulus of the spring", Uniform(0.0, 1e6), (0.0, 1e6), 0.0),
        EffectParameter("eta", "Pa s", "viscosity of the dashpot", Uniform(0.0, 1e7), (1.0, 1e7)),
    )

    def remember(self, p: Array, force: Array, path: Motion) -> Array:
        stretch = np.diff(path.deflection, prepend=0.0) / RIG.length
        gap = np.diff(path.clock, prepend=0.0)
        q, out = np.zeros(len(p)), np.empty((len(p), gap.size))
        for k in range(gap.size):
            part = gap[k] * p[:, 0] / p[:, 1]
            mean = -np.expm1(-part) / np.where(part > 0, part, 1.0) if gap[k] > 0 else np.ones(len(p))
            q = q * np.exp(-part) + p[:, 0] * stretch[k] * mean
            out[:, k] = q
        return np.asarray(force + RIG.width * TAPE.thickness * out)
