"""What a small effect would leave in the residual, once the material has absorbed what it can."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bayesmembrane.diagnosis.candidates.candidate import Candidate, with_effects
from bayesmembrane.diagnosis.candidates.weighing import Weighing
from bayesmembrane.diagnosis.detection.scores import Signature
from bayesmembrane.diagnosis.reference.noise import orthonormal
from bayesmembrane.diagnosis.thresholds import DETECTION
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.effects.base import Effect


def signatures(search: Weighing, model: Candidate, effects: Sequence[Effect]) -> list[Signature]:
    """Signatures of ``effects`` beside the model's own slopes, at its parameters; invisible ones are left out."""
    own = orthonormal(search.noise.white(model.slopes))
    found = []
    for effect in effects:
        for slope, side in slopes_of_effect(search, model, effect):
            white = search.noise.white(slope)
            left = white - own @ (own.T @ white)
            whole, length = float(np.linalg.norm(white)), float(np.linalg.norm(left))
            if length > DETECTION.visible * whole and length > 0:
                sign = side if effect.size.one_sided else 0
                found.append(Signature(effect.name, sign, left, length, length / whole))
    return found


def slopes_of_effect(search: Weighing, model: Candidate, effect: Effect) -> list[tuple[Array, int]]:
    """((N,) d (reading) / d (size), side on which it was taken) for several shapes; without those that have no film."""
    rows = _rows(model, effect)
    force = search.curves(with_effects(model.hypothesis, [effect]), rows)
    steps = rows[1:, model.x.size] - rows[0, model.x.size]
    found = [((moved - force[0]) / h, int(np.sign(h))) for moved, h in zip(force[1:], steps, strict=True)]
    return [(slope, side) for slope, side in found if np.all(np.isfinite(slope))]


def _rows(model: Candidate, effect: Effect) -> Array:
    """Coordinates without the effect (first) and with a little of it, at several shapes."""
    null, size = effect.null, effect.size
    side = 1 if (size.null or 0.0) + DETECTION.small_size * size.scale <= size.bounds[1] else -1
    rows = [np.concatenate([model.x, null])]
    shapes = [p for p in effect.coordinates if p.null is None]
    for q in DETECTION.shapes if shapes else DETECTION.shapes[:1]:
        theta = np.array([float(p.prior.quantile(q)) if p.null is None else p.null for p in effect.coordinates])
        for i in effect.sizes:
            own = effect.coordinates[i]
            theta[i] = (own.null or 0.0) + side * DETECTION.small_size * own.scale
        rows.append(np.concatenate([model.x, effect.within_bounds(theta)]))
    return np.array(rows)
