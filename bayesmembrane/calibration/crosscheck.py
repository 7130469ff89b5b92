"""A sample of draws, solved again by the other solver."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.forward import Forward

DRAWS = 16
POINTS = 60


@dataclass(frozen=True)
class CrossCheck:
    """How the two solvers compare on a sample of draws.

    Attributes
    ----------
    draws : films solved by both
    largest : largest |F_ritz - F_shooting| / |F_ritz| over films and deflections; nan if nothing could be compared
    at_mm : deflection at which it was met
    compared, missing : forces that both solvers give, and that one of them does not
    """

    draws: int
    largest: float
    at_mm: float
    compared: int
    missing: int

    def summary(self) -> dict[str, Any]:
        return {k: None if isinstance(v, float) and np.isnan(v) else v for k, v in asdict(self).items()}


def crosscheck(forward: Forward, x: Array, seed: int = 0, draws: int = DRAWS) -> CrossCheck:
    """Compare the two solvers at a random sample of the coordinates x (B, k)."""
    rng = np.random.default_rng(seed)
    sample = x[rng.choice(len(x), min(draws, len(x)), replace=False)]
    films = forward.hypothesis.films(sample)
    at = _sample(forward)
    first, second = forward.curves(films, at), forward.curves(films, at, solver="shooting")
    both = first.ok & second.ok & (first.force != 0)
    missing = int(np.sum(first.ok != second.ok))
    if not np.any(both):
        return CrossCheck(len(films), np.nan, np.nan, 0, missing)
    difference = np.where(both, np.abs(second.force - first.force) / np.where(both, np.abs(first.force), 1.0), -1.0)
    _, column = np.unravel_index(int(np.argmax(difference)), difference.shape)
    return CrossCheck(len(films), float(np.max(difference)), 1e3 * float(at[column]), int(np.sum(both)), missing)


def _sample(forward: Forward) -> Array:
    """(M,) m: `POINTS` of the deflections at most; all of a biaxial test, whose readings each have their own state."""
    if forward.measurement.across is not None:
        return forward.deflection
    at = np.unique(forward.deflection)
    return np.asarray(at[np.unique(np.linspace(0, at.size - 1, min(at.size, POINTS)).astype(int))])
