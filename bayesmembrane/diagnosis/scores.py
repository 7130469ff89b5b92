"""What a small effect would leave in the residual, once the material has absorbed what it can."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates import Candidate, with_effects
from bayesmembrane.diagnosis.whitening import OwnNoise, orthonormal
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.effects.base import Effect
from bayesmembrane.physics.forward import Forward, Solve

SHAPES = (0.5, 0.15, 0.85)  # quantiles of the priors of shape parameters
SMALL = 0.02  # of the expected size: how far the signature's difference reaches
VISIBLE = 1e-3  # of a signature that is left after the material has absorbed its part; less is round-off
DRAWS = 20000
POWER, LEVEL = 0.9, 0.005


@dataclass(frozen=True, eq=False)
class Signature:
    """d (reading) / d (size) of an effect of vanishing size and one shape.

    effect : which
    one_sided : +1 if only a growing size is allowed, 0 if both signs are
    left : (N,) whitened, what is left after projecting out the model's own slopes
    length : of ``left``: the signal-to-noise ratio of an effect of unit size
    seen : part of the whitened signature that is left
    """

    effect: Effect
    one_sided: int
    left: Array
    length: float
    seen: float

    @property
    def direction(self) -> Array:
        return self.left / self.length


@dataclass(frozen=True)
class ScoreTest:
    """The largest score over all signatures, and the probability of one as large if nothing is missing."""

    effect: str
    value: float
    p_value: float
    critical: float


def signatures(
    measurement: Measurement, model: Candidate, effects: Sequence[Effect], noise: OwnNoise, solve: Solve
) -> list[Signature]:
    """Signatures of ``effects`` beside those of ``model``, at its parameters; invisible ones are left out."""
    own = orthonormal(noise.white(model.slopes))
    found = []
    for effect in effects:
        rows = _rows(model, effect)
        forward = Forward(with_effects(model.hypothesis, [effect]), measurement, measurement.deflection, solve)
        force = forward(rows, reached=False).force
        base, moved = force[0], force[1:]
        step = rows[1:, model.x.size] - rows[0, model.x.size]
        for response, h in zip(moved, step, strict=True):
            signature = (response - base) / h
            if not np.all(np.isfinite(signature)):
                continue
            white = noise.white(signature)
            left = white - own @ (own.T @ white)
            whole, length = float(np.linalg.norm(white)), float(np.linalg.norm(left))
            if length > VISIBLE * whole and length > 0:
                sign = int(np.sign(h)) if effect.size.one_sided else 0
                found.append(Signature(effect, sign, left, length, length / whole))
    return found


def _rows(model: Candidate, effect: Effect) -> Array:
    """Coordinates without the effect (first) and with a little of it, at several shapes."""
    null, size = effect.null, effect.size
    step = SMALL * size.scale
    if (size.null or 0.0) + step > size.bounds[1]:
        step = -step
    rows = [np.concatenate([model.x, null])]
    shapes = [p for p in effect.coordinates if p.null is None]
    for q in SHAPES if shapes else SHAPES[:1]:
        theta = np.array([float(p.prior.quantile(q)) if p.null is None else p.null for p in effect.coordinates])
        theta[0] = (size.null or 0.0) + step
        rows.append(np.concatenate([model.x, effect.within_bounds(theta)]))
    return np.array(rows)


def score_test(residual: Array, found: Sequence[Signature], noise: OwnNoise, rng: np.random.Generator) -> ScoreTest:
    """max_j s_j^T r / |s_j| against its simulated distribution N(0, G), with G the Gram matrix of the signatures.

    ``residual`` (N,) N is measured less fitted. The error of an inferred noise widens the distribution to Student's t.
    """
    if not found:
        return ScoreTest("", 0.0, 1.0, np.inf)
    white = noise.white(residual)
    s = np.stack([f.direction for f in found])
    one_sided = np.array([f.one_sided for f in found])
    value = _folded(s @ white, one_sided)
    gram = s @ s.T
    w, v = np.linalg.eigh(gram)
    root = v * np.sqrt(np.maximum(w, 0.0))
    z = rng.standard_normal((DRAWS, len(found))) @ root.T
    if np.isfinite(noise.dof):
        z /= np.sqrt(rng.chisquare(noise.dof, (DRAWS, 1)) / noise.dof)
    null = np.max(_folded(z, one_sided), axis=1)
    best = int(np.argmax(value))
    p = (1 + np.count_nonzero(null >= value[best])) / (DRAWS + 1)
    return ScoreTest(found[best].effect.name, float(value[best]), float(p), float(np.quantile(null, 1 - LEVEL)))


def _folded(scores: Array, one_sided: Array) -> Array:
    """Scores of two-sided effects by size, of one-sided ones by their allowed sign."""
    return np.where(one_sided == 0, np.abs(scores), scores * one_sided)


def smallest_sizes(found: Sequence[Signature], critical: float) -> dict[str, float]:
    """By effect, the smallest |size| (SI) that the score test would find nine times out of ten."""
    reach = critical + 1.2816
    out: dict[str, float] = {}
    for f in found:
        size = reach / f.length
        out[f.effect.name] = min(out.get(f.effect.name, np.inf), size)
    return out


def angle(a: Array, b: Array, fold: bool = True) -> float:
    """Degrees between two directions (N,); 0 to 90 if the sign does not matter."""
    length = float(np.linalg.norm(a) * np.linalg.norm(b))
    if length == 0:
        return 0.0
    cosine = float(a @ b) / length
    return float(np.degrees(np.arccos(np.clip(abs(cosine) if fold else cosine, -1.0, 1.0))))
