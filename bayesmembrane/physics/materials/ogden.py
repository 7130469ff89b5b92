"""Ogden: three powers of the principal stretches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.ground.parameters import Array, Normal, Parameter
from bayesmembrane.physics.materials.base import LN_GD, Derivatives, Material


@dataclass(frozen=True)
class Ogden(Material):
    """W = sum_i c_i / a_i (l1^a_i + l2^a_i + (l1 l2)^-a_i - 3), i = 1, 2, 3; G d = 1/2 sum_i c_i a_i.

    The 3-D constants are the mu_i of sum_i mu_i / a_i (...), so that c_i = d mu_i; constants published for
    sum_i 2 mu_i / a_i^2 (...) must be multiplied by 2 / a_i first.

    The energy takes any constants, its sampling coordinates only the cone c_i a_i > 0, 0 < a1 < a2, a3 < 0: every
    term adds stiffness, and the order of the exponents forbids exchanging the terms, so that the coordinates and the
    cone are in one-to-one correspondence and no second copy of a fit exists. Elsewhere the coordinates are nan.
    """

    c1: float
    c2: float
    c3: float
    a1: float
    a2: float
    a3: float

    name: ClassVar[str] = "ogden"
    title: ClassVar[str] = "Ogden"
    colour: ClassVar[str] = "#CC79A7"
    reference: ClassVar[str] = "R. W. Ogden, Proc. R. Soc. A 326 (1972) 565"
    units: ClassVar[tuple[str, ...]] = ("N/m", "N/m", "N/m", "-", "-", "-")
    meanings: ClassVar[tuple[str, ...]] = (
        "coefficient of the first power",
        "coefficient of the second power",
        "coefficient of the third power",
        "first exponent",
        "second exponent",
        "third exponent",
    )
    scales: ClassVar[tuple[int, ...]] = (1, 1, 1, 0, 0, 0)
    coordinates: ClassVar[tuple[Parameter, ...]] = (
        LN_GD,
        Parameter("ln_r2", "-", "ln(c2 a2 / (c1 a1)), stiffness of term 2 to term 1", Normal(-3.0, 2.5), (-25.0, 15.0)),
        Parameter("ln_r3", "-", "ln(c3 a3 / (c1 a1)), stiffness of term 3 to term 1", Normal(-3.0, 2.0), (-25.0, 15.0)),
        Parameter("ln_a1", "-", "logarithm of the lower positive exponent", Normal(np.log(1.5), 0.5), (-3.0, 2.5)),
        Parameter("ln_a21", "-", "logarithm of a2 - a1", Normal(np.log(3.5), 1.0), (-6.0, 5.0)),
        Parameter("ln_a3", "-", "logarithm of -a3", Normal(np.log(2.0), 0.6), (-4.0, 3.0)),
    )

    @staticmethod
    def derivatives(p: Any, l1: Any, l2: Any) -> Derivatives:
        la, lb = np.log(l1), np.log(l2)
        # e = l1^a - 1, f = l2^a - 1, q = (l1 l2)^-a of each term.
        e1, f1 = np.exp(p[3] * la) - 1.0, np.exp(p[3] * lb) - 1.0
        e2, f2 = np.exp(p[4] * la) - 1.0, np.exp(p[4] * lb) - 1.0
        e3, f3 = np.exp(p[5] * la) - 1.0, np.exp(p[5] * lb) - 1.0
        g1, h1, g2, h2, g3, h3 = 1.0 + e1, 1.0 + f1, 1.0 + e2, 1.0 + f2, 1.0 + e3, 1.0 + f3
        q1, q2, q3 = 1.0 / (g1 * h1), 1.0 / (g2 * h2), 1.0 / (g3 * h3)
        # l1^a + l2^a + q - 3 = q (e^2 + f^2 + e f (1 + e + f)) and l1^a - q = q (e (2 + e) (1 + f) + f) do not cancel.
        m1, m2, m3 = p[0] * q1, p[1] * q2, p[2] * q3
        r1, r2 = 1.0 / l1, 1.0 / l2
        return (
            m1 / p[3] * (e1 * e1 + f1 * f1 + e1 * f1 * (g1 + f1))
            + m2 / p[4] * (e2 * e2 + f2 * f2 + e2 * f2 * (g2 + f2))
            + m3 / p[5] * (e3 * e3 + f3 * f3 + e3 * f3 * (g3 + f3)),
            r1
            * (m1 * (e1 * (1.0 + g1) * h1 + f1) + m2 * (e2 * (1.0 + g2) * h2 + f2) + m3 * (e3 * (1.0 + g3) * h3 + f3)),
            r2
            * (m1 * (f1 * (1.0 + h1) * g1 + e1) + m2 * (f2 * (1.0 + h2) * g2 + e2) + m3 * (f3 * (1.0 + h3) * g3 + e3)),
            r1
            * r1
            * (
                p[0] * ((p[3] - 1.0) * g1 + (p[3] + 1.0) * q1)
                + p[1] * ((p[4] - 1.0) * g2 + (p[4] + 1.0) * q2)
                + p[2] * ((p[5] - 1.0) * g3 + (p[5] + 1.0) * q3)
            ),
            r1 * r2 * (p[3] * m1 + p[4] * m2 + p[5] * m3),
            r2
            * r2
            * (
                p[0] * ((p[3] - 1.0) * h1 + (p[3] + 1.0) * q1)
                + p[1] * ((p[4] - 1.0) * h2 + (p[4] + 1.0) * q2)
                + p[2] * ((p[5] - 1.0) * h3 + (p[5] + 1.0) * q3)
            ),
        )

    @staticmethod
    def sensitivities(p: Any, l1: Any, l2: Any) -> tuple[tuple[Any, Any, Any], ...]:
        la, lb = np.log(l1), np.log(l2)
        lj = la + lb
        e1, f1 = np.exp(p[3] * la) - 1.0, np.exp(p[3] * lb) - 1.0
        e2, f2 = np.exp(p[4] * la) - 1.0, np.exp(p[4] * lb) - 1.0
        e3, f3 = np.exp(p[5] * la) - 1.0, np.exp(p[5] * lb) - 1.0
        g1, h1, g2, h2, g3, h3 = 1.0 + e1, 1.0 + f1, 1.0 + e2, 1.0 + f2, 1.0 + e3, 1.0 + f3
        q1, q2, q3 = 1.0 / (g1 * h1), 1.0 / (g2 * h2), 1.0 / (g3 * h3)
        r1, r2 = 1.0 / l1, 1.0 / l2
        # w = l1^a + l2^a + q - 3, u = l1^a - q, v = l2^a - q of each term.
        w1, w2, w3 = (
            q1 * (e1 * e1 + f1 * f1 + e1 * f1 * (g1 + f1)) / p[3],
            q2 * (e2 * e2 + f2 * f2 + e2 * f2 * (g2 + f2)) / p[4],
            q3 * (e3 * e3 + f3 * f3 + e3 * f3 * (g3 + f3)) / p[5],
        )
        u1, v1 = q1 * (e1 * (1.0 + g1) * h1 + f1), q1 * (f1 * (1.0 + h1) * g1 + e1)
        u2, v2 = q2 * (e2 * (1.0 + g2) * h2 + f2), q2 * (f2 * (1.0 + h2) * g2 + e2)
        u3, v3 = q3 * (e3 * (1.0 + g3) * h3 + f3), q3 * (f3 * (1.0 + h3) * g3 + e3)
        return (
            (w1, u1 * r1, v1 * r2),
            (w2, u2 * r1, v2 * r2),
            (w3, u3 * r1, v3 * r2),
            (
                p[0] / p[3] * (la * u1 + lb * v1 - w1),
                p[0] * r1 * (la * g1 + lj * q1),
                p[0] * r2 * (lb * h1 + lj * q1),
            ),
            (
                p[1] / p[4] * (la * u2 + lb * v2 - w2),
                p[1] * r1 * (la * g2 + lj * q2),
                p[1] * r2 * (lb * h2 + lj * q2),
            ),
            (
                p[2] / p[5] * (la * u3 + lb * v3 - w3),
                p[2] * r1 * (la * g3 + lj * q3),
                p[2] * r2 * (lb * h3 + lj * q3),
            ),
        )

    @staticmethod
    def to_coordinates(p: ArrayLike) -> Array:
        c1, c2, c3, a1, a2, a3 = np.asarray(p, dtype=float)
        g1, g2, g3 = c1 * a1, c2 * a2, c3 * a3
        with np.errstate(all="ignore"):
            inside = (g1 > 0) & (g2 > 0) & (g3 > 0) & (a1 > 0) & (a2 > a1) & (a3 < 0)
            x = np.stack([0.5 * (g1 + g2 + g3), g2 / g1, g3 / g1, a1, a2 - a1, -a3])
            return np.log(np.where(inside, x, np.nan))

    @staticmethod
    def from_coordinates(x: ArrayLike) -> Array:
        gd, r2, r3, a1, a21, minus_a3 = np.exp(np.asarray(x, dtype=float))
        a2, a3 = a1 + a21, -minus_a3
        g1 = 2.0 * gd / (1.0 + r2 + r3)
        return np.stack([g1 / a1, r2 * g1 / a2, r3 * g1 / a3, a1, a2, a3])

    @staticmethod
    def neo_hookean(gd: float) -> Array:
        # The first term with a1 = 2; the others as soft as they may be.
        soft = Ogden.coordinates[1].bounds[0], Ogden.coordinates[2].bounds[0]
        return np.array([np.log(gd), *soft, np.log(2.0), 0.0, np.log(2.0)])

    @staticmethod
    def shear_modulus(p: Any) -> Any:
        return 0.5 * (p[0] * p[3] + p[1] * p[4] + p[2] * p[5])
