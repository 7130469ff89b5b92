"""What two effects take away together, to first order: each alone may promise nothing, or look like a third one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.signatures import slopes_of_effect
from bayesmembrane.diagnosis.candidates.weighing import Weighing
from bayesmembrane.diagnosis.thresholds import GROWTH
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.effects.base import Effect

Pair = frozenset[str]


def gains_of_pairs(search: Weighing, base: Candidate, effects: Sequence[Effect]) -> dict[Pair, float]:
    """ln K of a little of two effects beside ``base``, by their names, at the best of several shapes of each.

    ln K = b^T (1 + S)^-1 b / 2 - ln |1 + S| / 2, with the slopes s_i by the expected sizes, freed of what the base can
    follow, S_ij = s_i.s_j and b_i = s_i.r: `growth.first_order` for two at once, under the form error of the base and
    under one no larger than usual, with what that costs.
    """
    slopes, own, sides = _slopes(search, base, effects)
    if not own.size:
        return {}
    model, white = search.linear(base), search.noise.white(slopes)
    usual = np.minimum(base.theta, model.priors[:, 0])
    costs = model.log_density(base.theta).value - model.log_density(usual).value
    best: dict[Pair, float] = {}
    for theta, cost in ((base.theta, 0.0), (usual, costs)):
        freed = model.freed(theta, white)
        gains = _gains(white, freed, freed.T @ model.data, sides)
        gains[own[:, None] >= own[None, :]] = -np.inf
        for i, j in zip(*np.nonzero(np.isfinite(gains)), strict=True):
            pair = frozenset((effects[own[i]].name, effects[own[j]].name))
            best[pair] = max(best.get(pair, -np.inf), float(gains[i, j]) - cost)
    return best


def _slopes(
    search: Weighing, base: Candidate, effects: Sequence[Effect]
) -> tuple[Array, NDArray[np.intp], NDArray[np.intp]]:
    """Slopes (N, m) by expected sizes, whose effect each is of (m,), and the side (m,) that is allowed, or 0."""
    found = [
        (slope * float(search.expected_sizes(effect)[0]), i, side if effect.size.one_sided else 0)
        for i, effect in enumerate(effects)
        for slope, side in slopes_of_effect(search, base, effect)
    ]
    slopes = np.column_stack([s for s, _, _ in found]) if found else np.empty((search.force.size, 0))
    return slopes, np.array([i for _, i, _ in found], int), np.array([side for *_, side in found], int)


def _gains(white: Array, freed: Array, along: Array, sides: NDArray[np.intp]) -> Array:
    """(m, m) ln K of each two slopes, -inf where one is nothing but round-off or would have the wrong sign."""
    product = white.T @ freed
    square = np.diagonal(product)
    there = square > GROWTH.round_off * np.sum(white * white, axis=0)
    a, b = 1 + square[:, None], 1 + square[None, :]
    det = np.maximum(a * b - product**2, 1.0)
    first = (b * along[:, None] - product * along[None, :]) / det
    second = (a * along[None, :] - product * along[:, None]) / det
    gains = 0.5 * (first * along[:, None] + second * along[None, :]) - 0.5 * np.log(det)
    allowed = there[:, None] & there[None, :]
    allowed &= (sides[:, None] * first >= 0) & (sides[None, :] * second >= 0)
    return np.asarray(np.where(allowed, gains, -np.inf))
