"""A sudden change: a foreign fault that effects of the library can imitate well enough to give it their name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from bayesmembrane.diagnosis.candidates import Candidate, Search
from bayesmembrane.diagnosis.whitening import orthonormal
from bayesmembrane.ground.parameters import Array

PLACES, MARGIN = 160, 0.04  # moments that are tried, and the part of the readings at either end that is not
WIDTHS = (1e-6, 0.006, 0.018)  # of the whole test: how long the change takes
SEEN = 1e-3  # of a step, that the model's own slopes leave over


@dataclass(frozen=True)
class Step:
    """From one reading on the force differs, by a constant or by a factor.

    place : number of the reading; size : N, or part of the force if ``relative``
    gain : ln of the Bayes factor over the model without it; share : part of the model's chi^2 that it takes away
    residual : (N,) N, what is left once the model has adapted; slopes : (N, k + 1) its own and the step's
    """

    place: int
    size: float
    relative: bool
    gain: float
    share: float
    residual: Array
    slopes: Array

    def sentence(self, time: Array | None, shown: Mapping[str, tuple[float, str]]) -> str:
        """When, how large (by `Rig.shown`), and what makes such a step."""
        factor, unit = shown["N"]
        when = f"reading {self.place + 1}" if time is None else f"{time[self.place]:.4g} s"
        size = f"{100 * abs(self.size):.2g} %" if self.relative else f"{factor * abs(self.size):.3g} {unit}"
        return (
            f"A sudden {'rise' if self.size > 0 else 'drop'} of the force by {size} at {when} takes "
            f"{100 * self.share:.0f} % of the squares away: look for a change of temperature, a knock or a tear then."
        )


def sudden(search: Search, null: Candidate) -> Step | None:
    """The most probable step beside the null model, whose slopes absorb what they can; None for a short curve.

    ln K = chi^2 taken / 2 - ln(number of steps tried) - ln(N) / 2 (G. Schwarz, Ann. Stat. 6 (1978) 461).
    """
    n = null.residual.size
    places = np.unique(np.linspace(MARGIN * n, (1 - MARGIN) * n, PLACES).astype(int))
    if places.size < PLACES:
        return None
    clock = search.measurement.path.clock[search.measurement.on_path]
    since = (clock[:, None] - clock[places]) / np.ptp(clock)
    after = np.concatenate([expit(since / width) for width in WIDTHS], axis=1)
    fitted = search.measurement.force - null.residual
    steps = np.concatenate([after, after * fitted[:, None]], axis=1)
    own = orthonormal(search.noise.white(null.slopes))
    white, r = search.noise.white(steps), search.noise.white(null.residual)
    left = white - own @ (own.T @ white)
    r = r - own @ (own.T @ r)
    length = np.sum(left**2, axis=0)
    seen = length > SEEN**2 * np.sum(white**2, axis=0)
    along = left.T @ r
    taken = np.where(seen, along**2 / np.where(seen, length, 1.0), 0.0)
    best = int(np.argmax(taken))
    gain = 0.5 * search.weight * float(taken[best]) - float(np.log(taken.size)) - 0.5 * float(np.log(n))
    slopes = np.column_stack([null.slopes, steps[:, best]])
    adapted = np.linalg.lstsq(search.noise.white(slopes), search.noise.white(null.residual), rcond=1e-9)[0]
    return Step(
        place=int(places[best % places.size]),
        size=float(along[best] / length[best]),
        relative=best >= after.shape[1],
        gain=gain,
        share=float(taken[best] / (r @ r)),
        residual=null.residual - slopes @ adapted,
        slopes=slopes,
    )
