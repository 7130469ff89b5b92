"""The deflection at which chains of limited length are stretched out everywhere."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.ground.compiling import compiled, for_kernel
from bayesmembrane.ground.parameters import Array

STEPS = 60  # per factor 3.5 of R2/R1
TABLE = np.linspace(np.log(1e-3), np.log(1e6), 400)
TABULATED = 200  # films of one pre-stretch, from which on a table costs less than they do; one without any is kept


@compiled(error_model="numpy")
def _rates(l2, th, jm):  # type: ignore[no-untyped-def]
    s = l2 * l2
    b = jm + 3.0 - s
    root = b * b - 4.0 / s
    if b <= 0.0 or root <= 0.0:
        return np.nan, np.nan, np.nan
    a = 0.5 * (b + np.sqrt(root))
    l1 = np.sqrt(a)
    pull = l2 * (1.0 - 1.0 / (a * s * s)) / (l1 * (1.0 - 1.0 / (a * a * s)))
    return l1 * np.cos(th) - l2, -np.sin(th) * pull, l1 * np.sin(th)


@compiled(error_model="numpy")
def _shoot(th, jm, l0, span):  # type: ignore[no-untyped-def]
    """(l2(T), d) of the fully stretched film that leaves the disc at angle th: Runge-Kutta 4 in t.

    A film that ends before the ring has l2 = inf if it grew too wide for its chains, -inf if it collapsed.
    """
    steps = int(np.ceil(STEPS * max(span / 1.25, 1.0)))
    l2, h, step = l0, 0.0, span / steps
    for i in range(steps):
        t, before = i * step, l2
        a1, b1, c1 = _rates(l2, th, jm)
        a2, b2, c2 = _rates(l2 + 0.5 * step * a1, th + 0.5 * step * b1, jm)
        a3, b3, c3 = _rates(l2 + 0.5 * step * a2, th + 0.5 * step * b2, jm)
        a4, b4, c4 = _rates(l2 + step * a3, th + step * b3, jm)
        e0, e1, e2 = np.exp(t), np.exp(t + 0.5 * step), np.exp(t + step)
        l2 += step / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        th += step / 6.0 * (b1 + 2.0 * b2 + 2.0 * b3 + b4)
        h += step / 6.0 * (e0 * c1 + 2.0 * e1 * c2 + 2.0 * e1 * c3 + e2 * c4)
        # Steps that are long for a film that collapses may throw it anywhere, out of 0 < th < pi too, which no film
        # leaves: from there it would come back to the ring with a length or a height that means nothing.
        if not l2 > 0.8 * before or l2 < 0.1 * l0 or not 0.0 < th < np.pi:
            return (np.inf if a1 > 0.0 else -np.inf), np.nan
    return l2, h


@compiled(error_model="numpy")
def _lock(jm, l0, span):  # type: ignore[no-untyped-def]
    """Find th with l2(T) = l0: it falls from inf (too flat) to -inf (too steep). Bisection, then false position."""
    if l0 * l0 * 2.0 + 1.0 / (l0 * l0 * l0 * l0) - 3.0 >= jm:
        return 0.0
    low, high, above, below, deflection, side = 0.0, np.pi, np.inf, -np.inf, 0.0, 0
    for _ in range(200):
        th = 0.5 * (low + high)
        if np.isfinite(above) and np.isfinite(below):
            th = (low * below - high * above) / (below - above)
        l2, d = _shoot(th, jm, l0, span)
        if np.isfinite(d):
            deflection = d
        if abs(l2 - l0) < 1e-13 * l0 or high - low < 1e-15:
            break
        # The end that stays twice counts half (Illinois).
        if l2 > l0:
            low, above = th, l2 - l0
            below *= 0.5 if side == 1 else 1.0
            side = 1
        else:
            high, below = th, l2 - l0
            above *= 0.5 if side == -1 else 1.0
            side = -1
    return deflection


@compiled(error_model="numpy")
def _lock_all(jm, l0, span):  # type: ignore[no-untyped-def]
    out = np.full(jm.size, np.inf)
    for i in range(jm.size):
        if jm[i] < 1e12:
            out[i] = _lock(jm[i], l0[i], span)
    return out


def locking_deflection(extensibility: ArrayLike, prestretch: ArrayLike, ratio: float) -> Array:
    """Scaled deflection delta l0/R1 at which I1 - 3 = Jm throughout the film, for R2/R1 = ``ratio``.

    In that limit the force is infinite and the film inextensible in the sense I1(l1, l2) = Jm + 3. With the unknown
    pressure-like tension mu(R), P_i = mu dI1/dl_i, equilibrium is
        l2. = l1 cos th - l2,    th. = -sin th (dI1/dl2)/(dI1/dl1),    h. = R l1 sin th,    l1 = l1(l2; Jm),
    solved for th(R1) such that l2 = l0 at both edges. Zero where the pre-stretch alone locks; infinity for Jm = inf.
    Shapes broadcast. Accurate to about 1e-7.
    """
    jm, l0 = np.broadcast_arrays(np.asarray(extensibility, dtype=float), np.asarray(prestretch, dtype=float))
    shape = jm.shape
    jm, l0 = jm.ravel(), l0.ravel()
    if jm.size and np.all(l0 == l0[0]) and (l0[0] == 1.0 or jm.size >= TABULATED):
        return np.asarray(_interpolate(jm, float(l0[0]), float(ratio))).reshape(shape)
    return np.asarray(_lock_all(for_kernel(jm), for_kernel(l0), np.log(ratio)), dtype=float).reshape(shape)


@lru_cache(maxsize=64)
def _table(l0: float, ratio: float) -> Any:
    """ln of the locking deflection against ln(Jm - Jm0), where Jm0 is the pre-stretch's own I1 - 3."""
    from scipy.interpolate import CubicSpline  # takes longer to import than a film to be solved

    jm = np.exp(TABLE) + _own(l0)
    return CubicSpline(TABLE, np.log(_lock_all(jm, np.full(jm.size, l0), np.log(ratio))))


def _own(l0: float) -> float:
    return 2 * l0**2 + l0**-4 - 3


def _interpolate(jm: Array, l0: float, ratio: float) -> Array:
    spare = jm - _own(l0)
    inside = (spare > np.exp(TABLE[0])) & (spare < np.exp(TABLE[-1]))
    out = np.where(spare >= np.exp(TABLE[-1]), np.inf, 0.0)
    out[inside] = np.exp(_table(l0, ratio)(np.log(spare[inside])))
    return out
