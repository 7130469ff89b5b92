"""Errors before and after an effect is added: in sample, and on points that were set aside before looking."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.left.continued import continued
from bayesmembrane.diagnosis.thresholds import HELD_OUT
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.forward import Forward

Rivals = Sequence[tuple[Candidate, float]]
"""Candidates, each with ln of what is believed of it before the data."""


@dataclass(frozen=True)
class Misfit:
    """Root mean square and largest residual in N, and chi^2 over degrees of freedom by the measurement's own noise."""

    rmse_N: float  # noqa: N815 - the unit is part of the name that users read
    max_N: float  # noqa: N815
    reduced_chi2: float


def misfit_of(residual: Array, noise_sd: Array, parameters: int = 0, white: Array | None = None) -> Misfit:
    """The misfit of residuals (N,) with the noise's standard deviations (N,); ``parameters`` were fitted to them.

    ``white`` (N,) are the residuals freed of noise, where neighbours are correlated.
    """
    dof = max(residual.size - parameters, 1)
    freed = residual / noise_sd if white is None else white
    return Misfit(float(np.sqrt(np.mean(residual**2))), float(np.max(np.abs(residual))), float(np.sum(freed**2) / dof))


def cycles_of(measurement: Measurement) -> NDArray[np.int64]:
    """Numbers of the cycles; one where readings are states, and no stations of a path."""
    return np.unique(measurement.cycle) if measurement.rig.has_path else np.ones(1, dtype=np.int64)


def held_out(measurement: Measurement) -> NDArray[np.bool_]:
    """(N,) True for points that are set aside: the rule looks at the path alone.

    The last cycle where there are two or more, else every fourth of twenty blocks of the path.
    """
    cycles = cycles_of(measurement)
    if cycles.size >= 2:
        mask = np.asarray(measurement.cycle == cycles[-1])
    else:
        n, every = len(measurement), HELD_OUT.every
        blocks = np.minimum(np.arange(n) * HELD_OUT.blocks // max(n, 1), HELD_OUT.blocks - 1)
        mask = blocks % every == every - 2
    if np.count_nonzero(~mask) < HELD_OUT.least_points:
        return np.zeros(len(measurement), dtype=bool)
    return mask


@dataclass(frozen=True)
class HeldOut:
    """Errors on points that no fit saw, and which model the others choose.

    cycle : number of the cycle that was set aside, the last of ``cycles``; every fourth block of points if ``cycles``
        is 1
    before, after : errors there of the plain and of the chosen model, both fitted to the other points
    chosen : label of the most probable of the rivals when these points are left out
    covered_before, covered_after : part of these points inside the 90 % bands of the two predictions, noise included
    """

    cycle: int
    cycles: int
    before: Misfit
    after: Misfit
    chosen: str
    covered_before: float
    covered_after: float


def validate(search: Search, before: Candidate, after: Candidate, rivals: Rivals) -> HeldOut | None:
    """Fit to the points that are not held out, and predict those that are; None where there are none, or no film.

    ``rivals`` come with ln of what is believed of each before the data.
    """
    whole = search.measurement
    mask = held_out(whole)
    if not np.any(mask):
        return None
    part = _on_the_others(search, mask)
    fits = {}
    for candidate in {c.label: c for c in (before, after, *(c for c, _ in rivals))}.values():
        found = part.polished(replace(candidate.at(~mask), log_evidence=-np.inf))
        if np.isfinite(found.log_evidence):
            fits[candidate.label] = found
    if before.label not in fits or after.label not in fits:
        return None
    first, covered_first = _predicted(part, fits[before.label], search, mask)
    last, covered_last = _predicted(part, fits[after.label], search, mask)
    belief = {c.label: value for c, value in rivals}
    chosen = max(fits, key=lambda label: fits[label].log_evidence + belief.get(label, -np.inf))
    cycles = cycles_of(whole)
    return HeldOut(int(cycles[-1]), cycles.size, first, last, chosen, covered_first, covered_last)


def _on_the_others(search: Search, mask: NDArray[np.bool_]) -> Search:
    seen = search.measurement.select(~mask)
    noise, factors = search.noise.part(seen, ~mask), search.factors.of(~mask)
    return replace(search, measurement=seen, noise=noise, known_factors=factors)


def _predicted(part: Search, fit: Candidate, search: Search, mask: NDArray[np.bool_]) -> tuple[Misfit, float]:
    """(error, part inside the 90 % band) of a model fitted to the others, at the points of ``mask``.

    Its form error goes on as far as it is smooth; the band has what is not known of it, of the coordinates, and noise.
    """
    whole, sd = search.measurement, search.noise.each[mask] * float(np.exp(fit.theta[0]))
    forward = Forward(fit.hypothesis, whole, whole.deflection, search.quick)
    new = continued(part, fit, forward, search.factors)
    residual, here = (whole.force - new.force - new.moved)[mask], new.columns[mask]
    band = HELD_OUT.band * np.sqrt(np.einsum("ni,ij,nj->n", here, new.covariance, here) + sd**2)
    return misfit_of(residual, search.noise.each[mask]), float(np.mean(np.abs(residual) <= band))
