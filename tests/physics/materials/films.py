"""Films that the tests of materials share, and closed forms in more digits than a double has."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np

from bayesmembrane.physics.materials.base import Material

DIGITS = 50
NAMES = {"arctan": "atan", "arcsin": "asin", "arccos": "acos", "arctanh": "atanh", "arcsinh": "asinh"}
"""What mpmath calls functions that NumPy calls otherwise."""


def exact(function, p, l1, l2):
    with mpmath.workdps(DIGITS):
        rows = function(*(mpmath.mpf(float(v)) for v in (*p, l1, l2)))
        return np.array([[float(v) for v in r] if isinstance(r, list) else float(r) for r in rows])


def draws(material, n, seed=1):
    """Parameters (n, n_fields) from the prior."""
    rng = np.random.default_rng(seed)
    x = np.stack([c.prior.draw(rng, n) for c in material.coordinates])
    return material.from_coordinates(x).T


def films(material, n, seed=1, spread=(0.85, 1.9)):
    """Parameters (n, n_fields) and stretches (n,), (n,) that exist for them."""
    rng = np.random.default_rng(seed)
    p = draws(material, 8 * n, seed)
    l1, l2 = rng.uniform(*spread, (2, 8 * n))
    k = l1**2 + l2**2 + (l1 * l2) ** -2.0 - 3
    keep = np.flatnonzero(k < 0.9 * np.broadcast_to(material.extensibility(p.T), k.shape))[:n]
    assert len(keep) == n
    return p[keep], l1[keep], l2[keep]


class Exact:
    """A number of `DIGITS` digits that NumPy's functions take: closed forms run on it as they do on doubles."""

    def __init__(self, value: Any) -> None:
        self.value = value.value if isinstance(value, Exact) else mpmath.mpf(value)

    def __getattr__(self, name: str) -> Callable[[], Exact]:
        """``log``, ``exp``, ``sqrt`` and the like, which NumPy asks its objects for."""
        if name.startswith("_"):
            raise AttributeError(name)
        function = getattr(mpmath, NAMES.get(name, name))
        return lambda: Exact(function(self.value))

    def __add__(self, other: Any) -> Exact:
        return Exact(self.value + Exact(other).value)

    def __sub__(self, other: Any) -> Exact:
        return Exact(self.value - Exact(other).value)

    def __rsub__(self, other: Any) -> Exact:
        return Exact(Exact(other).value - self.value)

    def __mul__(self, other: Any) -> Exact:
        return Exact(self.value * Exact(other).value)

    def __truediv__(self, other: Any) -> Exact:
        return Exact(self.value / Exact(other).value)

    def __rtruediv__(self, other: Any) -> Exact:
        return Exact(Exact(other).value / self.value)

    def __pow__(self, other: Any) -> Exact:
        return Exact(self.value ** Exact(other).value)

    def __neg__(self) -> Exact:
        return Exact(-self.value)

    __radd__, __rmul__ = __add__, __mul__


def energy(material: type[Material]) -> Callable[..., Any]:
    """W(p..., l1, l2) of the material's own closed form, in many digits."""

    def w(*values: Any) -> Any:
        *p, l1, l2 = (Exact(v) for v in values)
        return Exact(material.derivatives(p, l1, l2)[0]).value

    return w


def slopes(material: type[Material], p: np.ndarray, l1: float, l2: float) -> tuple[np.ndarray, np.ndarray]:
    """(W, W1, W2, W11, W12, W22) and (d/dp_i of the first three), by differences of W in many digits."""
    at, n = (*(mpmath.mpf(float(v)) for v in p), mpmath.mpf(l1), mpmath.mpf(l2)), len(p)
    w = energy(material)

    def diff(*orders: tuple[int, int]) -> float:
        order = [0] * (n + 2)
        for place, times in orders:
            order[place] += times
        with mpmath.workdps(DIGITS):
            return float(mpmath.diff(w, at, tuple(order)) if any(order) else w(*at))

    six = [(), ((n, 1),), ((n + 1, 1),), ((n, 2),), ((n, 1), (n + 1, 1)), ((n + 1, 2),)]
    rates = [[diff((i, 1), *more) for more in six[:3]] for i in range(n)]
    return np.array([diff(*orders) for orders in six]), np.array(rates)
