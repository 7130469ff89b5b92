"""Strain energies of an incompressible membrane, written anew: W(l1, l2) in N/m and its derivatives.

Every family holds the neo-Hookean film as a limit. `toward_neo_hookean` walks there, so that the distance between a
true family and a declared one is a number that can be chosen. Parameters are in the order of the fields' names.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Derivatives = tuple[Array, Array, Array, Array, Array, Array]
"""W, W_1, W_2, W_11, W_12, W_22 at stretches (l1, l2), arrays of one shape."""


class InadmissibleStateError(ValueError):
    """The energy does not exist at these stretches (chains locked, or overflow)."""


@dataclass(frozen=True)
class Family:
    """One strain energy: its parameters' names, its derivatives, how to draw it and how to weaken it.

    derivatives(p, l1, l2) -> Derivatives; draw(rng) -> parameters; toward_neo_hookean(p, a) -> parameters, with a = 1
    for p itself, a = 0 for the neo-Hookean film of the same modulus and a > 1 for a stronger departure. ``pure``: the
    parameters that are numbers; the others grow with the thickness.
    """

    name: str
    parameters: tuple[str, ...]
    derivatives: Callable[[Array, Array, Array], Derivatives]
    draw: Callable[[np.random.Generator], Array]
    toward_neo_hookean: Callable[[Array, float], Array]
    pure: tuple[str, ...] = ()

    def thicker(self, p: Array, times: float) -> Array:
        """The parameters of a film of the same material, so many times as thick."""
        return p * np.where([name in self.pure for name in self.parameters], 1.0, times)


# ---- from functions of the invariants to functions of the stretches --------------------------------------------------


def _of_invariants(a: Array, b: Array, w: Callable[[Array, Array], tuple[Array | float, ...]]) -> Derivatives:
    """Chain rule for w(I1, I2) -> (w, w_1, w_2, w_11, w_12, w_22)."""
    aa, bb = a * a, b * b
    i1, i2 = aa + bb + 1 / (aa * bb), aa * bb + 1 / aa + 1 / bb
    i1a, i1b = 2 * a - 2 / (aa * a * bb), 2 * b - 2 / (aa * bb * b)
    i2a, i2b = 2 * a * bb - 2 / (aa * a), 2 * aa * b - 2 / (bb * b)
    i1aa, i1bb, i1ab = 2 + 6 / (aa * aa * bb), 2 + 6 / (aa * bb * bb), 4 / (aa * a * bb * b)
    i2aa, i2bb, i2ab = 2 * bb + 6 / (aa * aa), 2 * aa + 6 / (bb * bb), 4 * a * b
    e, p, q, pp, pq, qq = w(i1, i2)

    def second(x1: Array, x2: Array, y1: Array, y2: Array, x: Array, y: Array) -> Array:
        return p * x + q * y + pp * x1 * x2 + pq * (x1 * y2 + x2 * y1) + qq * y1 * y2

    return (
        e + 0 * a,
        p * i1a + q * i2a,
        p * i1b + q * i2b,
        second(i1a, i1a, i2a, i2a, i1aa, i2aa),
        second(i1a, i1b, i2a, i2b, i1ab, i2ab),
        second(i1b, i1b, i2b, i2b, i1bb, i2bb),
    )


def _mooney(p: Array, a: Array, b: Array) -> Derivatives:
    return _of_invariants(a, b, lambda i1, i2: (p[0] * (i1 - 3) + p[1] * (i2 - 3), p[0], p[1], 0.0, 0.0, 0.0))


def _neo_hookean(p: Array, a: Array, b: Array) -> Derivatives:
    return _mooney(np.array([p[0], 0.0]), a, b)


def _yeoh(p: Array, a: Array, b: Array) -> Derivatives:
    def w(i1: Array, i2: Array) -> tuple[Array | float, ...]:
        k = i1 - 3
        return (
            p[0] * k + p[1] * k**2 + p[2] * k**3,
            p[0] + 2 * p[1] * k + 3 * p[2] * k**2,
            0.0,
            2 * p[1] + 6 * p[2] * k,
            0.0,
            0.0,
        )

    return _of_invariants(a, b, w)


def _room(i1: Array, limit: float) -> Array:
    """1 - (I1 - 3)/Jm, which must stay positive."""
    room = 1 - (i1 - 3) / limit
    if np.min(room) <= 1e-6:
        raise InadmissibleStateError("the chains have locked")
    return np.asarray(room)


def _gent(p: Array, a: Array, b: Array) -> Derivatives:
    def w(i1: Array, i2: Array) -> tuple[Array | float, ...]:
        room = _room(i1, p[1])
        return -p[0] * p[1] * np.log1p((3 - i1) / p[1]), p[0] / room, 0.0, p[0] / (p[1] * room**2), 0.0, 0.0

    return _of_invariants(a, b, w)


def _gent_gent(p: Array, a: Array, b: Array) -> Derivatives:
    """-c1 Jm ln(1 - (I1-3)/Jm) + 3 c2 ln(I2/3) (Pucci and Saccomandi 2002)."""

    def w(i1: Array, i2: Array) -> tuple[Array | float, ...]:
        room = _room(i1, p[1])
        return (
            -p[0] * p[1] * np.log1p((3 - i1) / p[1]) + 3 * p[2] * np.log(i2 / 3),
            p[0] / room,
            3 * p[2] / i2,
            p[0] / (p[1] * room**2),
            0.0,
            -3 * p[2] / i2**2,
        )

    return _of_invariants(a, b, w)


def _arruda_boyce(p: Array, a: Array, b: Array) -> Derivatives:
    """c1 sum_i k_i n^(i-1) (I1^i - 3^i) / sum_i i k_i (3 n)^(i-1), n = 1/N, so that the modulus is 2 c1.

    Five terms of the inverse Langevin series (Arruda and Boyce 1993).
    """
    k = np.array([1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750])
    c = p[0] * k * p[1] ** np.arange(5) / np.sum(np.arange(1, 6) * k * (3 * p[1]) ** np.arange(5))
    power = np.polynomial.Polynomial(np.concatenate([[0.0], c]))
    d1, d2 = power.deriv(1), power.deriv(2)
    return _of_invariants(a, b, lambda i1, i2: (power(i1) - power(3.0), d1(i1), 0.0, d2(i1), 0.0, 0.0))


def _fung(p: Array, a: Array, b: Array) -> Derivatives:
    """(c1/b) (exp(b (I1 - 3)) - 1) (Fung and Demiray)."""

    def w(i1: Array, i2: Array) -> tuple[Array | float, ...]:
        with np.errstate(over="ignore"):
            e = np.exp(p[1] * (i1 - 3))
        if not np.all(np.isfinite(e)):
            raise InadmissibleStateError("the exponential overflows")
        return p[0] * np.expm1(p[1] * (i1 - 3)) / p[1], p[0] * e, 0.0, p[0] * p[1] * e, 0.0, 0.0

    return _of_invariants(a, b, w)


def _lopez_pamies(p: Array, a: Array, b: Array) -> Derivatives:
    """sum_r c_r 3^(1-a_r)/a_r (I1^a_r - 3^a_r), two terms (Lopez-Pamies 2010)."""

    def w(i1: Array, i2: Array) -> tuple[Array | float, ...]:
        total = [0 * i1, 0 * i1, 0 * i1]
        for c, n in ((p[0], p[2]), (p[1], p[3])):
            k = c * 3 ** (1 - n)
            total[0] = total[0] + k / n * (i1**n - 3**n)
            total[1] = total[1] + k * i1 ** (n - 1)
            total[2] = total[2] + k * (n - 1) * i1 ** (n - 2)
        return total[0], total[1], 0.0, total[2], 0.0, 0.0

    return _of_invariants(a, b, w)


def _carroll(p: Array, a: Array, b: Array) -> Derivatives:
    """c1 (I1 - 3) + c2 (I1^4 - 81) + c3 (sqrt(I2) - sqrt(3)) (Carroll 2011)."""

    def w(i1: Array, i2: Array) -> tuple[Array | float, ...]:
        root = np.sqrt(i2)
        return (
            p[0] * (i1 - 3) + p[1] * (i1**4 - 81) + p[2] * (root - 3**0.5),
            p[0] + 4 * p[1] * i1**3,
            p[2] / (2 * root),
            12 * p[1] * i1**2,
            0.0,
            -p[2] / (4 * root**3),
        )

    return _of_invariants(a, b, w)


def _ogden(p: Array, a: Array, b: Array) -> Derivatives:
    out = [np.zeros_like(a) for _ in range(6)]
    for c, n in zip(p[:3], p[3:], strict=True):
        x, y, z = a**n, b**n, (a * b) ** -n
        terms = (
            (x + y + z - 3) / n,
            (x - z) / a,
            (y - z) / b,
            ((n - 1) * x + (n + 1) * z) / a**2,
            n * z / (a * b),
            ((n - 1) * y + (n + 1) * z) / b**2,
        )
        for k, term in enumerate(terms):
            out[k] += c * term
    return out[0], out[1], out[2], out[3], out[4], out[5]


# ---- draws: films of 50 um of soft silicone --------------------------------------------------------------------------


def _scale(rng: np.random.Generator) -> float:
    """Half the shear modulus times thickness, N/m."""
    return float(np.exp(rng.uniform(np.log(5.0), np.log(10.0))))


def _draw_mooney(rng: np.random.Generator) -> Array:
    c, share = _scale(rng), rng.uniform(0.05, 0.3)
    return np.array([c * (1 - share), c * share])


def _draw_yeoh(rng: np.random.Generator) -> Array:
    c = _scale(rng)
    return np.array([c, -c * rng.uniform(0.03, 0.075), c * rng.uniform(0.004, 0.008)])


def _draw_ogden(rng: np.random.Generator) -> Array:
    exponents = np.array([rng.uniform(1.3, 1.9), rng.uniform(4.5, 6.5), -rng.uniform(0.8, 1.8)])
    shares = np.array([1.0, rng.uniform(0.03, 0.1), rng.uniform(0.01, 0.06)])
    return np.concatenate([4 * _scale(rng) * shares / shares.sum() / exponents, exponents])


def _draw_gent_gent(rng: np.random.Generator) -> Array:
    c, share = _scale(rng), rng.uniform(0.1, 0.3)
    return np.array([c * (1 - share), rng.uniform(12, 40), c * share])


def _draw_lopez_pamies(rng: np.random.Generator) -> Array:
    c, share = _scale(rng), rng.uniform(0.01, 0.06)
    return np.array([c * (1 - share), c * share, rng.uniform(0.6, 0.95), rng.uniform(2.0, 3.0)])


def _draw_carroll(rng: np.random.Generator) -> Array:
    c = _scale(rng)
    quartic, root = rng.uniform(0.01, 0.04), rng.uniform(0.1, 0.4)
    return np.array([c * (1 - quartic - root), c * quartic / 108, c * root * 2 * 3**0.5])


# ---- the walk to the neo-Hookean film of the same modulus ------------------------------------------------------------


def _weaker_mooney(p: Array, a: float) -> Array:
    return np.array([p[0] + (1 - a) * p[1], a * p[1]])


def _weaker_gent_gent(p: Array, a: float) -> Array:
    return np.array([p[0] + (1 - a) * p[2], p[1] / a, a * p[2]])


def _weaker_ogden(p: Array, a: float) -> Array:
    modulus = p[:3] * p[3:]  # shares of twice the modulus
    small = a * modulus[1:]
    first = 2 + a * (p[3] - 2)
    return np.array([(modulus.sum() - small.sum()) / first, *(small / p[4:]), first, *p[4:]])


def _weaker_lopez_pamies(p: Array, a: float) -> Array:
    return np.array([p[0] + (1 - a) * p[1], a * p[1], 1 + a * (p[2] - 1), p[3]])


def _weaker_carroll(p: Array, a: float) -> Array:
    away = 108 * p[1] + p[2] / (2 * 3**0.5)
    return np.array([p[0] + (1 - a) * away, a * p[1], a * p[2]])


FAMILIES: dict[str, Family] = {
    f.name: f
    for f in (
        Family("neo_hookean", ("c1",), _neo_hookean, lambda r: np.array([_scale(r)]), lambda p, a: p),
        Family("mooney_rivlin", ("c1", "c2"), _mooney, _draw_mooney, _weaker_mooney),
        Family(
            "gent",
            ("c1", "c2"),
            _gent,
            lambda r: np.array([_scale(r), r.uniform(12, 40)]),
            lambda p, a: np.array([p[0], p[1] / a]),
            ("c2",),
        ),
        Family("yeoh", ("c1", "c2", "c3"), _yeoh, _draw_yeoh, lambda p, a: np.array([p[0], a * p[1], a * p[2]])),
        Family(
            "ogden",
            ("c1", "c2", "c3", "a1", "a2", "a3"),
            _ogden,
            _draw_ogden,
            _weaker_ogden,
            ("a1", "a2", "a3"),
        ),
        Family("gent_gent", ("c1", "jm", "c2"), _gent_gent, _draw_gent_gent, _weaker_gent_gent, ("jm",)),
        Family(
            "arruda_boyce",
            ("c1", "n"),
            _arruda_boyce,
            lambda r: np.array([_scale(r), 1 / r.uniform(4, 15)]),
            lambda p, a: np.array([p[0], a * p[1]]),
            ("n",),
        ),
        Family(
            "fung",
            ("c1", "b"),
            _fung,
            lambda r: np.array([_scale(r), r.uniform(0.02, 0.08)]),
            lambda p, a: np.array([p[0], a * p[1]]),
            ("b",),
        ),
        Family(
            "lopez_pamies",
            ("c1", "c2", "a1", "a2"),
            _lopez_pamies,
            _draw_lopez_pamies,
            _weaker_lopez_pamies,
            ("a1", "a2"),
        ),
        Family("carroll", ("c1", "c2", "c3"), _carroll, _draw_carroll, _weaker_carroll),
    )
}
DECLARED = ("neo_hookean", "mooney_rivlin", "gent", "yeoh", "ogden")
"""The families that a user can declare."""
OUTSIDE = tuple(name for name in FAMILIES if name not in DECLARED)
"""Families that no user can declare."""


def relaxed(family: Family, p: Array, a: Array, b: Array) -> Derivatives:
    """The tension-field energy: a direction that would be compressed wrinkles and carries nothing.

    For an incompressible isotropic film a strip pulled to l contracts to l^(-1/2), whatever its energy; narrower than
    that it wrinkles: W(l1, l2) -> W(l1, l1^(-1/2)) for l2 < l1^(-1/2), l1 > 1, likewise the other way, and 0 for both
    below one.
    """
    wrinkled_2 = (b * np.sqrt(a) < 1) & (a > 1)
    wrinkled_1 = (a * np.sqrt(b) < 1) & (b > 1)
    slack = (a <= 1) & (b <= 1)
    if not (np.any(wrinkled_2) or np.any(wrinkled_1) or np.any(slack)):
        return family.derivatives(p, a, b)
    x = np.where(wrinkled_1, b**-0.5, np.where(slack, 1.0, a))
    y = np.where(wrinkled_2, a**-0.5, np.where(slack, 1.0, b))
    w, w1, w2, w11, w12, w22 = family.derivatives(p, x, y)
    # Along the relaxed path the width follows from a zero tension: W'' = W_11 - W_12^2 / W_22.
    return (
        np.where(slack, 0.0, w),
        np.where(wrinkled_1 | slack, 0.0, w1),
        np.where(wrinkled_2 | slack, 0.0, w2),
        np.where(wrinkled_1 | slack, 0.0, np.where(wrinkled_2, w11 - w12**2 / w22, w11)),
        np.where(wrinkled_1 | wrinkled_2 | slack, 0.0, w12),
        np.where(wrinkled_2 | slack, 0.0, np.where(wrinkled_1, w22 - w12**2 / w11, w22)),
    )
