"""Arruda-Boyce: eight chains of limited length, as a series."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.ground.parameters import Array, Normal, Parameter
from bayesmembrane.physics.materials.base import LN_GD, Derivatives, Material
from bayesmembrane.physics.materials.invariants import compilable, first_invariant, of_first, rate_of_first

# The coefficients k_i of the inverse Langevin function's series.
K1, K2, K3, K4, K5 = 1.0 / 2.0, 1.0 / 20.0, 11.0 / 1050.0, 19.0 / 7000.0, 519.0 / 673750.0


@compilable
def _powers(k: Any, n: Any) -> tuple[Any, Any, Any, Any]:
    """(I1^i - 3^i) / (K N^(i-1)) for i = 2, ..., 5: sums of positive terms, which lose no digits."""
    s, t = (3.0 + k) / n, 3.0 / n
    q2 = s + t
    q3 = s * q2 + t * t
    q4 = s * q3 + t * t * t
    return q2, q3, q4, s * q4 + t * t * t * t


@compilable
def _slope(s: Any) -> Any:
    """psi' / c1 at s = I1 / N."""
    return K1 + s * (2.0 * K2 + s * (3.0 * K3 + s * (4.0 * K4 + s * 5.0 * K5)))


@compilable
def _bend(s: Any) -> Any:
    """The slope of ``_slope``."""
    return 2.0 * K2 + s * (6.0 * K3 + s * (12.0 * K4 + s * 20.0 * K5))


@dataclass(frozen=True)
class ArrudaBoyce(Material):
    """W = c1 sum_i k_i (I1^i - 3^i) / N^(i-1), i = 1, ..., 5, k = 1/2, 1/20, 11/1050, 19/7000, 519/673750;
    G d = c1 (1 + 3/(5 N) + 99/(175 N^2) + 513/(875 N^3) + 42039/(67375 N^4)).

    I1 = l1^2 + l2^2 + (l1 l2)^-2. N is the number of links of a chain, whose locking stretch is sqrt(N): the series of
    the paper stiffens there and has no end. The 3-D form has n k T for c1.
    """

    c1: float
    links: float

    name: ClassVar[str] = "arruda_boyce"
    title: ClassVar[str] = "Arruda-Boyce"
    ordinary: ClassVar[bool] = False
    reference: ClassVar[str] = "E. M. Arruda, M. C. Boyce, J. Mech. Phys. Solids 41 (1993) 389"
    units: ClassVar[tuple[str, ...]] = ("N/m", "-")
    meanings: ClassVar[tuple[str, ...]] = ("chain density x kT x thickness", "links of a chain")
    scales: ClassVar[tuple[int, ...]] = (1, 0)
    coordinates: ClassVar[tuple[Parameter, ...]] = (
        LN_GD,
        Parameter("ln_links", "-", "logarithm of the links of a chain", Normal(np.log(25.0), 1.0), (-1.0, 23.0)),
    )

    @staticmethod
    def derivatives(p: Any, l1: Any, l2: Any) -> Derivatives:
        i = first_invariant(l1, l2)
        q2, q3, q4, q5 = _powers(i[0], p[1])
        s = (3.0 + i[0]) / p[1]
        psi = p[0] * i[0] * (K1 + K2 * q2 + K3 * q3 + K4 * q4 + K5 * q5)
        return of_first(i, psi, p[0] * _slope(s), p[0] * _bend(s) / p[1])

    @staticmethod
    def sensitivities(p: Any, l1: Any, l2: Any) -> tuple[tuple[Any, Any, Any], ...]:
        i = first_invariant(l1, l2)
        q2, q3, q4, q5 = _powers(i[0], p[1])
        s = (3.0 + i[0]) / p[1]
        # Term i falls with the power i - 1 of N.
        fall = p[0] / p[1]
        by_links = K2 * q2 + 2.0 * K3 * q3 + 3.0 * K4 * q4 + 4.0 * K5 * q5
        return (
            rate_of_first(i, i[0] * (K1 + K2 * q2 + K3 * q3 + K4 * q4 + K5 * q5), _slope(s)),
            rate_of_first(i, -fall * i[0] * by_links, -fall * s * _bend(s)),
        )

    @staticmethod
    def to_coordinates(p: ArrayLike) -> Array:
        c1, links = np.asarray(p, dtype=float)
        with np.errstate(all="ignore"):
            return np.stack([np.log(2.0 * c1 * _slope(3.0 / links)), np.log(links)])

    @staticmethod
    def from_coordinates(x: ArrayLike) -> Array:
        ln_gd, ln_links = np.asarray(x, dtype=float)
        links = np.exp(ln_links)
        return np.stack([0.5 * np.exp(ln_gd) / _slope(3.0 / links), links])

    @staticmethod
    def neo_hookean(gd: float) -> Array:
        return np.array([np.log(gd), ArrudaBoyce.coordinates[1].bounds[1]])

    @staticmethod
    def shear_modulus(p: Any) -> Any:
        return 2.0 * p[0] * _slope(3.0 / p[1])
