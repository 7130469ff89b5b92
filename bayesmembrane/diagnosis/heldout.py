"""Errors before and after an effect is added: in sample, and on points that were set aside before looking."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates import Candidate, Search
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.forward import Forward

BLOCKS, EVERY = 20, 4
LEAST_POINTS = 12
Z = 1.6449  # standard deviations to either side of a 90 % band


@dataclass(frozen=True)
class Error:
    """Root mean square and largest residual in N, and chi^2 over degrees of freedom by the measurement's own noise."""

    rmse_N: float  # noqa: N815 - the unit is part of the name that users read
    max_N: float  # noqa: N815
    reduced_chi2: float


def error_of(residual: Array, noise_sd: Array, parameters: int = 0) -> Error:
    """The error of residuals (N,) with the noise's standard deviations (N,); ``parameters`` were fitted to them."""
    dof = max(residual.size - parameters, 1)
    return Error(
        float(np.sqrt(np.mean(residual**2))),
        float(np.max(np.abs(residual))),
        float(np.sum((residual / noise_sd) ** 2) / dof),
    )


def held_out(measurement: Measurement) -> tuple[NDArray[np.bool_], str]:
    """((N,) True for points that are set aside, which they are in words): the rule looks at the path alone.

    The last cycle where there are two or more, else every fourth of twenty blocks of the path.
    """
    cycles = np.unique(measurement.cycle)
    mask = np.zeros(len(measurement), dtype=bool)
    if cycles.size >= 3:
        mask = measurement.cycle == cycles[-1]
        words = f"cycle {cycles[-1]}"
    elif cycles.size == 2:
        mask = measurement.cycle == cycles[-1]
        words = "the second cycle"
    else:
        blocks = np.minimum(np.arange(len(measurement)) * BLOCKS // max(len(measurement), 1), BLOCKS - 1)
        mask = blocks % EVERY == EVERY - 2
        words = "every fourth block of points"
    if np.count_nonzero(~mask) < LEAST_POINTS or not np.any(mask):
        return np.zeros(len(measurement), dtype=bool), "nothing: too few points"
    return mask, words


@dataclass(frozen=True)
class HeldOut:
    """Errors on points that no fit saw, and which model the others choose.

    where : the points, in words
    before, after : errors there of the plain and of the chosen model, both fitted to the other points
    chosen : label of the most probable of the rivals when these points are left out
    covered_before, covered_after : part of these points inside the 90 % bands of the two predictions, noise included
    """

    where: str
    before: Error
    after: Error
    chosen: str
    covered_before: float
    covered_after: float


def validate(
    search: Search,
    mask: NDArray[np.bool_],
    where: str,
    before: Candidate,
    after: Candidate,
    rivals: list[Candidate],
) -> HeldOut | None:
    """Fit to the points that are not in ``mask`` (N,) and predict those that are; None where there are none."""
    if not np.any(mask):
        return None
    whole = search.measurement
    seen = whole.select(~mask)
    part = Search(seen, search.noise.part(seen, ~mask), search.seed, search.solve, search.weight)
    fits = {}
    for candidate in {c.label: c for c in (before, after, *rivals)}.values():
        found = part.fit(candidate.hypothesis, [candidate.x])
        if found is not None:
            fits[candidate.label] = found
    if before.label not in fits or after.label not in fits:
        return None
    sd = search.noise.each[mask]

    def predicted(candidate: Candidate) -> tuple[Error, float]:
        fit = fits[candidate.label]
        forward = Forward(candidate.hypothesis, whole, whole.deflection, search.solve)
        new = forward(fit.x[None, :], sensitivities=True, reached=False)
        assert new.sensitivity is not None
        residual = np.nan_to_num(whole.force - new.force[0], nan=float(np.max(whole.force)))[mask]
        slopes = np.nan_to_num(new.sensitivity[0][mask])
        band = Z * np.sqrt(np.einsum("ni,ij,nj->n", slopes, part.covariance(fit), slopes) + sd**2)
        return error_of(residual, sd), float(np.mean(np.abs(residual) <= band))

    chosen = max(fits, key=lambda label: fits[label].log_evidence)
    (first, covered_first), (last, covered_last) = predicted(before), predicted(after)
    return HeldOut(where, first, last, chosen, covered_first, covered_last)
