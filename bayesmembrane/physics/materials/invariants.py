"""Kinematics of the invariants, once: what an energy of I1, or of I1 and I2, needs beside psi and its slopes.

    K1 = I1 - 3,  I1 = l1^2 + l2^2 + (l1 l2)^-2;      K2 = I2 - 3,  I2 = (l1 l2)^2 + l1^-2 + l2^-2

Computed from x = l1^2 - 1 and y = l2^2 - 1, neither they nor their slopes lose digits at small strain. An invariant is
handed on as the tuple (K, dK/dl1, dK/dl2, d2K/dl1^2, d2K/dl1 dl2, d2K/dl2^2).

All functions are plain arithmetic, for arrays and, compiled into a material's closed forms, for scalars and vectors.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from numba.extending import register_jitable

from bayesmembrane.physics.materials.base import Derivatives

Invariant = tuple[Any, Any, Any, Any, Any, Any]

F = TypeVar("F", bound=Callable[..., Any])


def compilable(function: F) -> F:
    """The function itself, which compiled closed forms may call: it is copied into them, and shares their options."""
    register_jitable(inline="always")(function)
    return function


@compilable
def first_invariant(l1: Any, l2: Any) -> Invariant:
    """K1 and its derivatives at stretches l1, l2."""
    x, y = (l1 - 1.0) * (l1 + 1.0), (l2 - 1.0) * (l2 + 1.0)
    s1, s2 = l1 * l1, l2 * l2
    ab = 1.0 / (s1 * s2)
    a, b = s2 * ab, s1 * ab
    return (
        ab * (x * x + y * y + x * y * (1.0 + x + y)),
        2.0 * l1 * a * ab * (x * (2.0 + x) * s2 + y),
        2.0 * l2 * b * ab * (y * (2.0 + y) * s1 + x),
        2.0 + 6.0 * a * ab,
        4.0 * ab * ab * l1 * l2,
        2.0 + 6.0 * b * ab,
    )


@compilable
def both_invariants(l1: Any, l2: Any) -> tuple[Invariant, Invariant]:
    """K1 and K2 with their derivatives; the slopes of K2 are those of K1 times the square of the other stretch."""
    x, y = (l1 - 1.0) * (l1 + 1.0), (l2 - 1.0) * (l2 + 1.0)
    s1, s2 = l1 * l1, l2 * l2
    ab = 1.0 / (s1 * s2)
    a, b = s2 * ab, s1 * ab
    k1 = 2.0 * l1 * a * ab * (x * (2.0 + x) * s2 + y)
    k2 = 2.0 * l2 * b * ab * (y * (2.0 + y) * s1 + x)
    u, v = -x * a, -y * b
    return (
        (
            ab * (x * x + y * y + x * y * (1.0 + x + y)),
            k1,
            k2,
            2.0 + 6.0 * a * ab,
            4.0 * ab * ab * l1 * l2,
            2.0 + 6.0 * b * ab,
        ),
        (
            s1 * s2 * (u * u + v * v + u * v * (1.0 + u + v)),
            s2 * k1,
            s1 * k2,
            2.0 * s2 + 6.0 * a * a,
            4.0 * l1 * l2,
            2.0 * s1 + 6.0 * b * b,
        ),
    )


@compilable
def of_first(k: Invariant, psi: Any, d: Any, dd: Any) -> Derivatives:
    """(W, W1, W2, W11, W12, W22) of W = psi(K1), with d = psi' and dd = psi''."""
    return (
        psi,
        d * k[1],
        d * k[2],
        d * k[3] + dd * k[1] * k[1],
        d * k[4] + dd * k[1] * k[2],
        d * k[5] + dd * k[2] * k[2],
    )


@compilable
def of_both(k: tuple[Invariant, Invariant], psi: Any, slopes: Any, second: Any) -> Derivatives:
    """(W, W1, W2, W11, W12, W22) of W = psi(K1, K2): ``slopes`` (psi_1, psi_2), ``second`` (psi_11, psi_12, psi_22)."""
    i, j = k
    d1, d2 = slopes
    d11, d12, d22 = second
    # Slopes of psi_1 and psi_2 along both stretches.
    e1, f1 = d11 * i[1] + d12 * j[1], d12 * i[1] + d22 * j[1]
    e2, f2 = d11 * i[2] + d12 * j[2], d12 * i[2] + d22 * j[2]
    return (
        psi,
        d1 * i[1] + d2 * j[1],
        d1 * i[2] + d2 * j[2],
        d1 * i[3] + d2 * j[3] + e1 * i[1] + f1 * j[1],
        d1 * i[4] + d2 * j[4] + e1 * i[2] + f1 * j[2],
        d1 * i[5] + d2 * j[5] + e2 * i[2] + f2 * j[2],
    )


@compilable
def rate_of_first(k: Invariant, psi: Any, d: Any) -> tuple[Any, Any, Any]:
    """(dW, dW1, dW2) for a parameter that changes psi by ``psi`` and psi' by ``d``."""
    return psi, d * k[1], d * k[2]


@compilable
def rate_of_both(k: tuple[Invariant, Invariant], psi: Any, d1: Any, d2: Any) -> tuple[Any, Any, Any]:
    """(dW, dW1, dW2) for a parameter that changes psi by ``psi``, psi_1 by ``d1`` and psi_2 by ``d2``."""
    i, j = k
    return psi, d1 * i[1] + d2 * j[1], d1 * i[2] + d2 * j[2]
