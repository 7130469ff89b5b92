"""Does the residual look like a known effect? It sees what its size hides from the other tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from bayesmembrane.diagnosis.reference.noise import Whitened
from bayesmembrane.diagnosis.thresholds import DETECTION
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.symmetric import eigh


@dataclass(frozen=True, eq=False)
class Signature:
    """d (reading) / d (size) of an effect of vanishing size and one shape.

    effect : name
    one_sided : +1 or -1 if only sizes of that sign are allowed, 0 if both are
    left : (N,) whitened, what is left after projecting out the model's own slopes
    length : of ``left``: the signal-to-noise ratio of an effect of unit size
    seen : part of the whitened signature that is left
    """

    effect: str
    one_sided: int
    left: Array
    length: float
    seen: float

    @property
    def direction(self) -> Array:
        """(N,) of length 1."""
        return self.left / self.length


@dataclass(frozen=True)
class ScoreTest:
    """The largest score over all signatures, and the probability of one as large if nothing is missing."""

    effect: str
    value: float
    p_value: float
    critical: float


def score_test(model: Whitened, found: Sequence[Signature], rng: np.random.Generator) -> ScoreTest:
    """max_j s_j^T r / |s_j| against its simulated distribution N(0, G), with G the Gram matrix of the signatures.

    The error of an inferred noise widens the distribution to Student's t.
    """
    if not found:
        return ScoreTest("", 0.0, 1.0, np.inf)
    dof = model.noise.dof
    s = np.stack([f.direction for f in found])
    one_sided = np.array([f.one_sided for f in found])
    value = _folded(s @ model.residual, one_sided)
    w, v = eigh(s @ s.T)
    root = v * np.sqrt(np.maximum(w, 0.0))
    z = rng.standard_normal((DETECTION.draws, len(found))) @ root.T
    if np.isfinite(dof):
        z /= np.sqrt(rng.chisquare(dof, (DETECTION.draws, 1)) / dof)
    null = np.max(_folded(z, one_sided), axis=1)
    best = int(np.argmax(value))
    p = (1 + np.count_nonzero(null >= value[best])) / (DETECTION.draws + 1)
    critical = float(np.quantile(null, 1 - DETECTION.power_level))
    return ScoreTest(found[best].effect, float(value[best]), float(p), critical)


def _folded(scores: Array, one_sided: Array) -> Array:
    """Scores of two-sided effects by size, of one-sided ones by their allowed sign."""
    return np.where(one_sided == 0, np.abs(scores), scores * one_sided)


def smallest_sizes(found: Sequence[Signature], critical: float) -> dict[str, float]:
    """By effect, the smallest |size| (SI) that the score test would find nine times out of ten."""
    reach = critical + DETECTION.power_quantile
    out: dict[str, float] = {}
    for f in found:
        size = reach / f.length
        out[f.effect] = min(out.get(f.effect, np.inf), size)
    return out


def confounded(found: Sequence[Signature]) -> tuple[tuple[str, str, float], ...]:
    """(effect, effect, degrees) of pairs whose signatures nearly coincide for some shapes, the nearest first."""
    nearest: dict[tuple[str, str], float] = {}
    for a, b in combinations(found, 2):
        if a.effect == b.effect:
            continue
        one, two = sorted((a.effect, b.effect))
        fold = not (a.one_sided and b.one_sided)
        sign = (a.one_sided or 1) * (b.one_sided or 1)
        degrees = angle(a.direction, sign * b.direction, fold)
        nearest[one, two] = min(nearest.get((one, two), 90.0), degrees)
    pairs = sorted(nearest.items(), key=lambda i: i[1])
    return tuple((a, b, v) for (a, b), v in pairs if v < DETECTION.near_degrees)


def angle(a: Array, b: Array, fold: bool = True) -> float:
    """Degrees between two directions (N,); 0 to 90 if the sign does not matter."""
    length = float(np.linalg.norm(a) * np.linalg.norm(b))
    if length == 0:
        return 0.0
    cosine = float(a @ b) / length
    return float(np.degrees(np.arccos(np.clip(abs(cosine) if fold else cosine, -1.0, 1.0))))
