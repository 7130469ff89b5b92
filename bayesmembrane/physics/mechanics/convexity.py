"""Is an energy convex in the stretches, and elliptic, on a box or on the states that a film reaches?

Two measures of the Hessian H of W(l1, l2), both relative to |G d| (to 1 N/m where G d = 0):

    convexity    least eigenvalue of H;          convex   <=> >= 0 everywhere
    ellipticity  least of P11 = H11 and P22 = H22;  elliptic <=> >  0 everywhere

`box_convexity` and `box_ellipticity` answer sharply for one film, `box_margins` quickly for many (the prior of a
calibration), and `reached_convexity` and `reached_ellipticity` read what a solver met on its way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.ground.compiling import for_kernel
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.mechanics.compiled import bind
from bayesmembrane.physics.mechanics.convexity_kernels import KERNELS, SHRINK, part_within
from bayesmembrane.physics.mechanics.solution import Curves, Status

Measure = Callable[[Any, Any, Any], Any]

ROUND_OFF = 1e-12
"""A margin above -ROUND_OFF counts as zero: the Hessian itself is not known better."""

_GRID = 129
_CANDIDATES = 8
_ROUNDS = 120


@dataclass(frozen=True)
class ConvexityAnswer:
    """Whether the Hessian of W is positive semidefinite on a box.

    Attributes
    ----------
    convex : margin >= 0 (to round-off)
    margin : least eigenvalue of the Hessian on the box, relative to |G d|; negative where W is not convex
    worst : (l1, l2) where it is met, with l1 >= l2; its mirror image is as bad
    """

    convex: bool
    margin: float
    worst: tuple[float, float]


@dataclass(frozen=True)
class EllipticityAnswer:
    """Whether P11 > 0 and P22 > 0 on a box; ``margin`` and ``worst`` as in `ConvexityAnswer`."""

    elliptic: bool
    margin: float
    worst: tuple[float, float]


def box_convexity(material: Material, low: float, high: float) -> ConvexityAnswer:
    """min over [low, high]^2 of the least eigenvalue of the Hessian of W, over |G d|.

    For a material of limited extensibility the box is intersected with its domain I1 - 3 < Jm. The search is a grid
    that is uniform in ln l over the half l1 >= l2 (the other half is its mirror image), then a zoom into each of its
    lowest dips, so that a violation much narrower than the grid is found where the eigenvalue dips towards it.

    Raises `SettingsError` unless 0 < low < high, or if the material does not exist anywhere on the box.
    """
    margin, worst = _search(material, low, high, least_eigenvalue)
    return ConvexityAnswer(margin >= -ROUND_OFF, margin, worst)


def box_ellipticity(material: Material, low: float, high: float) -> EllipticityAnswer:
    """min over [low, high]^2 of P11 and P22, over |G d|; search, domain and errors as in `box_convexity`."""
    margin, worst = _search(material, low, high, _least_diagonal)
    return EllipticityAnswer(margin > ROUND_OFF, margin, worst)


def box_margins(
    material: type[Material], parameters: ArrayLike, low: float, high: float, *, sign_only: bool = False
) -> Array:
    """Convexity margins (B,) on [low, high]^2 of B films with ``parameters`` (B, n_fields), compiled.

    The sign is that of `box_convexity`. The value is too for a film that is nearly not convex; for the others it is
    that of a coarse grid, an upper bound that is only refined while a refinement could change the sign. It is nan for
    a film that does not exist anywhere on the box, or whose energy overflows all over it. With ``sign_only`` any
    negative value of a film does that is found.

    Raises `SettingsError` unless 0 < low < high, or if the shape of ``parameters`` is wrong.
    """
    _check_box(low, high)
    p = for_kernel(parameters)
    if p.ndim != 2 or p.shape[1] != len(material.field_names()):
        raise SettingsError(
            f"the parameters of {material.name} need the shape (films, {len(material.field_names())}), not {p.shape}"
        )
    limit = for_kernel(np.broadcast_to(material.extensibility(p.T), p.shape[:1]))
    margins = np.empty(len(p))
    bind(KERNELS, material).margins_of(p, limit, float(low), float(high), sign_only, margins)
    return np.asarray(margins / _modulus(material, p.T))


def reached_convexity(curves: Curves) -> Array:
    """Convexity margins (B,) over all states that each film passes, from ``curves.convexity`` (B, N).

    Deflections without a state (locked, or a numerical failure: both stand in ``curves.status``) say nothing about
    the energy and are left out; a film without any is nan. `Status.NOT_ELLIPTIC` says that P11 <= 0 was met: -inf
    unless the solver gives the value.
    """
    return _reached(curves, curves.convexity)


def reached_ellipticity(curves: Curves) -> Array:
    """Ellipticity margins (B,) over all states that each film passes; rules as in `reached_convexity`."""
    return _reached(curves, curves.ellipticity)


def _reached(curves: Curves, margin: Array) -> Array:
    lost = np.isnan(margin) & (curves.status == Status.NOT_ELLIPTIC)
    return np.asarray(np.fmin.reduce(np.where(lost, -np.inf, margin), axis=1))


# ---- the sharp answer ------------------------------------------------------------------------------------------------


def least_eigenvalue(w11: Any, w12: Any, w22: Any) -> Any:
    """Least eigenvalue m - r of [[w11, w12], [w12, w22]], with m = (w11 + w22)/2, r^2 = ((w11 - w22)/2)^2 + w12^2.

    It is det / (m + |r|) where m > 0: m - r would drown a small eigenvalue in the round-off of a large one.
    """
    with np.errstate(all="ignore"):
        m = 0.5 * (w11 + w22)
        r = np.sqrt(0.25 * (w11 - w22) ** 2 + w12 * w12)
        return np.where(m > 0.0, (w11 * w22 - w12 * w12) / (m + r), m - r)


def _least_diagonal(w11: Any, w12: Any, w22: Any) -> Any:
    return np.minimum(w11, w22)


def _search(material: Material, low: float, high: float, measure: Measure) -> tuple[float, tuple[float, float]]:
    """(margin, worst point): zoom into the lowest dips of a grid over ln l."""
    _check_box(low, high)
    ends = _existing_part(material, low, high)
    x = np.geomspace(*ends, _GRID)
    l1, l2 = np.meshgrid(x, x, indexing="ij")
    value, scale = _on_points(material, l1, l2, measure)
    if not np.isfinite(value).any():
        raise SettingsError(
            f"the energy of {material.name} is not finite anywhere on the box [{low:g}, {high:g}]",
            remedy="use a smaller box",
        )
    start = _dips(np.where(l1 >= l2, value, np.inf), scale)
    value, l1, l2 = _zoom(material, measure, l1[start], l2[start], x[1] / x[0] - 1.0, ends)
    best = int(np.argmin(value))
    worst = sorted((float(l1[best]), float(l2[best])), reverse=True)
    gd = float(_modulus(type(material), material.vector[:, None])[0])
    return float(value[best]) / gd, (worst[0], worst[1])


def _on_points(material: Material, l1: Array, l2: Array, measure: Measure) -> tuple[Array, Array]:
    """(measure, |H|) at the stretches; the measure is inf where the material does not exist."""
    *_, w11, w12, w22 = material._at(l1, l2)
    value = np.asarray(measure(w11, w12, w22))
    return np.where(np.isfinite(value), value, np.inf), np.abs(w11) + np.abs(w22)


def _dips(value: Array, scale: Array) -> tuple[Any, Any]:
    """Grid indices of the lowest local minima, in absolute terms and relative to the size of the Hessian there."""
    from scipy.ndimage import minimum_filter  # on demand: a force needs none

    with np.errstate(all="ignore"):
        relative = np.where(np.isfinite(value), value / scale, np.inf)
    chosen: list[Any] = []
    for field in (value, relative):
        local = np.flatnonzero((field <= minimum_filter(field, size=3, mode="nearest")) & np.isfinite(field))
        chosen.append(local[np.argsort(field.flat[local], kind="stable")[:_CANDIDATES]])
    i, j = np.unravel_index(np.unique(np.concatenate(chosen)), value.shape)
    return i, j


def _zoom(
    material: Material, measure: Measure, l1: Array, l2: Array, step: float, ends: tuple[float, float]
) -> tuple[Array, Array, Array]:
    """Least measure near each start (l1, l2), by windows that follow the best point and shrink where it rests.

    A dip can be a narrow curved valley: a window that shrank at every step would stop before its lowest point.
    """
    offset = np.linspace(-1.0, 1.0, 9)
    d1, d2 = (o.ravel() for o in np.meshgrid(offset, offset))
    travels = np.maximum(np.abs(d1), np.abs(d2)) > 0.6
    half = np.full((len(l1), 1), 1.5 * step)
    row = np.arange(len(l1))
    value, _ = _on_points(material, l1, l2, measure)
    for _ in range(_ROUNDS):
        w1 = np.clip(l1[:, None] * (1.0 + half * d1), *ends)
        w2 = np.clip(l2[:, None] * (1.0 + half * d2), *ends)
        v, _ = _on_points(material, w1, w2, measure)
        best = np.argmin(v, axis=1)
        moves = travels[best] & (v[row, best] < value)
        l1, l2, value = w1[row, best], w2[row, best], v[row, best]
        half *= np.where(moves, 1.0, SHRINK)[:, None]
        if np.all(half < 1e-9):
            break
    return value, l1, l2


def _existing_part(material: Material, low: float, high: float) -> tuple[float, float]:
    """The smallest interval [a, b] within [low, high] such that [a, b]^2 holds all states of the box that exist."""
    limit = float(np.asarray(material.extensibility(material.vector)))
    if limit == np.inf:
        return low, high
    a, b = part_within(limit, low, high)
    if not a < b:
        raise SettingsError(
            f"no state of the box [{low:g}, {high:g}] exists for this {material.name} film, whose I1 - 3 must stay "
            f"below {limit:g}",
            remedy="move the box towards l1 = l2 = 1",
        )
    return a, b


def _check_box(low: float, high: float) -> None:
    if not 0.0 < low < high < np.inf:
        raise SettingsError(f"the box [{low:g}, {high:g}] is not one", remedy="give two stretches with 0 < low < high")


def _modulus(material: type[Material], p: Array) -> Array:
    """|G d| (B,) of parameters (n_fields, B), and 1 N/m where it is zero."""
    gd = np.abs(np.asarray(material.shear_modulus(p), dtype=float))
    return np.where(gd == 0.0, 1.0, gd)
