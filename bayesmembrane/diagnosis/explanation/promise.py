"""What a little of one effect, or of two, would take away beside a fit: to first order, before anything is fitted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.signatures import slopes_of_effect
from bayesmembrane.diagnosis.candidates.weighing import Weighing
from bayesmembrane.diagnosis.explanation.visible import Ratio
from bayesmembrane.diagnosis.reference.noise import free_of
from bayesmembrane.diagnosis.thresholds import GROWTH
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.effects.base import Effect

Pair = frozenset[str]


def first_order(search: Weighing, base: Candidate, effect: Effect) -> float:
    """ln K of a little of ``effect`` beside ``base``, to first order, at the best of several shapes.

    ln K = (s.r)^2 / (s.s + 1) / 2 - ln(1 + s.s) / 2 of the slope s by the expected size, both freed of what the base
    can follow. A form error that has grown to carry what the effect would explain takes its trace as well: the base
    with one no larger than usual is tried too, with what that costs.
    """
    slopes = _slopes(search, base, [effect])
    return max((float(np.max(_gains(f))) - f.cost for f in _freed(search, base, slopes)), default=-np.inf)


def promised(search: Weighing, base: Candidate, effect: Effect, counts: float = 1.0) -> float:
    """ln of the weight of a little of ``effect`` beside ``base``, to first order, at the best of several shapes.

    c (s.r)^2 / (s.s) / 2 + ln int q L^c, with the slope s as in `first_order`, of whose likelihood a part c =
    ``counts`` counts, and `Ratio.log_part`: effects that could not be seen are absent. So is one whose trace is bent
    and absorbed nearby, of which only a fit says how large it is.
    """
    slopes, best = _slopes(search, base, [effect]), -np.inf
    lengths = np.linalg.norm(free_of(search.noise.white(base.slopes), slopes.white), axis=0)
    for f in _freed(search, base, slopes):
        for i in np.flatnonzero(f.left):
            along, square, length = float(f.along[i]), float(f.product[i, i]), float(lengths[i])
            toward = along * slopes.sides[i] if slopes.sides[i] else abs(along)
            ratio = Ratio(toward / square * length, length / sqrt(square), length, effect.size.one_sided)
            best = max(best, counts * (0.5 * along**2 / square - f.cost) + ratio.resolved.log_part(counts))
    return best


def of_changes(search: Weighing, base: Candidate, changes: Array) -> Array:
    """(m,) ln K of ``changes`` (N, m) N of its curve, each of the expected size and of this sign, as `first_order`."""
    m = changes.shape[1]
    slopes = _Slopes(search.noise.white(changes), np.zeros(m, int), np.ones(m, int))
    return np.asarray(np.max([_gains(f) - f.cost for f in _freed(search, base, slopes)], axis=0))


def gains_of_pairs(search: Weighing, base: Candidate, effects: Sequence[Effect]) -> dict[Pair, float]:
    """ln K of a little of two effects beside ``base``, by their names, at the best of several shapes of each.

    ln K = b^T (1 + S)^-1 b / 2 - ln |1 + S| / 2, with the slopes s_i by the expected sizes, freed of what the base can
    follow, S_ij = s_i.s_j and b_i = s_i.r: `first_order` for two at once. Each alone may promise nothing, or look like
    a third one.
    """
    slopes = _slopes(search, base, effects)
    best: dict[Pair, float] = {}
    for f in _freed(search, base, slopes):
        gains = _gains_of_two(f)
        gains[slopes.own[:, None] >= slopes.own[None, :]] = -np.inf
        for i, j in zip(*np.nonzero(np.isfinite(gains)), strict=True):
            pair = frozenset((effects[slopes.own[i]].name, effects[slopes.own[j]].name))
            best[pair] = max(best.get(pair, -np.inf), float(gains[i, j]) - f.cost)
    return best


@dataclass(frozen=True, eq=False)
class _Slopes:
    """Of effects beside a fit, by expected sizes and freed of noise.

    white : (N, m)
    own : which effect each belongs to, (m,)
    sides : the sign that is allowed, or 0, (m,)
    """

    white: Array
    own: NDArray[np.intp]
    sides: NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class _Freed:
    """Slopes freed of what the fit can follow, with its form error of one size.

    along : s.r (m,)
    product : s_i.s_j (m, m)
    left : False where nothing but round-off is left, (m,)
    cost : in ln Z, of that size instead of the fit's own
    """

    slopes: _Slopes
    along: Array
    product: Array
    left: NDArray[np.bool_]
    cost: float


def _slopes(search: Weighing, base: Candidate, effects: Sequence[Effect]) -> _Slopes:
    found = [
        (slope * float(search.expected_sizes(effect)[0]), i, side if effect.size.one_sided else 0)
        for i, effect in enumerate(effects)
        for slope, side in slopes_of_effect(search, base, effect)
    ]
    slopes = np.column_stack([s for s, _, _ in found]) if found else np.empty((search.force.size, 0))
    own, sides = np.array([i for _, i, _ in found], int), np.array([side for *_, side in found], int)
    return _Slopes(search.noise.white(slopes) if found else slopes, own, sides)


def _freed(search: Weighing, base: Candidate, slopes: _Slopes) -> Iterator[_Freed]:
    """With the form error of the base, and with one no larger than usual; nothing without slopes."""
    if not slopes.own.size:
        return
    model = search.linear(base)
    usual = np.minimum(base.theta, model.priors[:, 0])
    costs = model.log_density(base.theta).value - model.log_density(usual).value
    for theta, cost in ((base.theta, 0.0), (usual, costs)):
        freed = model.freed(theta, slopes.white)
        product = slopes.white.T @ freed
        # Of a slope that the base follows wholly nothing is left but round-off, which may be negative.
        left = np.diagonal(product) > GROWTH.round_off * np.sum(slopes.white**2, axis=0)
        yield _Freed(slopes, freed.T @ model.data, product, left, cost)


def _gains(f: _Freed) -> Array:
    """(m,) ln K of each slope; only its cost where it would have the wrong sign, 0 where nothing is left of it."""
    along, square = np.where(f.left, f.along, 0.0), np.where(f.left, np.diagonal(f.product), 0.0)
    allowed = (f.slopes.sides == 0) | (f.slopes.sides * along > 0)
    return np.asarray(0.5 * along**2 / (square + 1) * allowed - 0.5 * np.log1p(square))


def _gains_of_two(f: _Freed) -> Array:
    """(m, m) ln K of each two slopes, -inf where nothing is left of one or it would have the wrong sign."""
    square, along, sides = np.diagonal(f.product), f.along, f.slopes.sides
    a, b = 1 + square[:, None], 1 + square[None, :]
    det = np.maximum(a * b - f.product**2, 1.0)
    first = (b * along[:, None] - f.product * along[None, :]) / det
    second = (a * along[None, :] - f.product * along[:, None]) / det
    gains = 0.5 * (first * along[:, None] + second * along[None, :]) - 0.5 * np.log(det)
    allowed = f.left[:, None] & f.left[None, :]
    allowed &= (sides[:, None] * first >= 0) & (sides[None, :] * second >= 0)
    return np.asarray(np.where(allowed, gains, -np.inf))
