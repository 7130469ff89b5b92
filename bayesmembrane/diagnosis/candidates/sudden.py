"""A sudden change: a foreign fault that effects of the library can imitate well enough to give it their name."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.reference.noise import orthonormal
from bayesmembrane.diagnosis.thresholds import SUDDEN
from bayesmembrane.ground.parameters import Array


@dataclass(frozen=True, eq=False)
class SuddenChange:
    """From one reading on the force differs, by a constant or by a factor.

    place : number of the reading, from 0; moment : its time in s, None where there are no times
    size : N, or part of the force if ``relative``
    gain : ln of the Bayes factor over the model without it; share : part of the model's chi^2 that it takes away
    residual : (N,) N, what is left once the model has adapted; slopes : (N, k + 1) its own and the step's
    """

    place: int
    moment: float | None
    size: float
    relative: bool
    gain: float
    share: float
    residual: Array
    slopes: Array


def sudden_change(search: Search, null: Candidate) -> SuddenChange | None:
    """The most probable step beside the null model, whose slopes absorb what they can; None for a short curve.

    ln K = chi^2 taken / 2 - ln(number of steps tried) - ln(N) / 2 (G. Schwarz, Ann. Stat. 6 (1978) 461).
    """
    n, k = null.slopes.shape
    places = np.unique(np.linspace(SUDDEN.margin * n, (1 - SUDDEN.margin) * n, SUDDEN.places).astype(int))
    if places.size < SUDDEN.places:
        return None
    steps = _steps(search, null, places)
    white = search.noise.white(np.column_stack([null.slopes, steps, null.residual]))
    own, residual = orthonormal(white[:, :k]), white[:, -1]
    left = white[:, k:-1] - own @ (own.T @ white[:, k:-1])
    r = residual - own @ (own.T @ residual)
    length = np.sum(left**2, axis=0)
    seen = length > SUDDEN.visible**2 * np.sum(white[:, k:-1] ** 2, axis=0)
    along = left.T @ r
    taken = np.where(seen, along**2 / np.where(seen, length, 1.0), 0.0)
    best = int(np.argmax(taken))
    gain = 0.5 * search.weight * float(taken[best]) - float(np.log(taken.size)) - 0.5 * float(np.log(n))
    adapted = np.linalg.lstsq(white[:, [*range(k), k + best]], residual, rcond=SUDDEN.rank)[0]
    slopes = np.column_stack([null.slopes, steps[:, best]])
    place, time = int(places[best % places.size]), search.measurement.time
    return SuddenChange(
        place=place,
        moment=None if time is None else float(time[place]),
        size=float(along[best] / length[best]),
        relative=best >= steps.shape[1] // 2,
        gain=gain,
        share=float(taken[best] / (r @ r)),
        residual=null.residual - slopes @ adapted,
        slopes=slopes,
    )


def _steps(search: Search, null: Candidate, places: Array) -> Array:
    """(N, 2 m) steps of the force at ``places`` that take several times, by a constant first, then by a factor."""
    clock = search.measurement.path.clock[search.measurement.on_path]
    since = (clock[:, None] - clock[places]) / np.ptp(clock)
    after = np.concatenate([expit(since / width) for width in SUDDEN.widths], axis=1)
    fitted = search.measurement.force - null.residual
    return np.concatenate([after, after * fitted[:, None]], axis=1)
