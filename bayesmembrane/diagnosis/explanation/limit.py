"""A load cell, or whatever follows it, at its limit: readings there say no more than that it was reached.

ln K compares the model of all readings with that of the others, and those at the limit with a constant: exact to a
digit where the converter saturates, or with the noise of all readings where the limit comes before it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.evidence import weighed
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.left.shape import plateau_of
from bayesmembrane.diagnosis.thresholds import FOREIGN


@dataclass(frozen=True)
class Limit:
    """A limit beside a model.

    force : N, where it is
    gain : ln of the Bayes factor over the model without it
    first : number of the first reading there
    """

    force: float
    gain: float
    first: int


def limit_of(search: Search, base: Candidate) -> Limit | None:
    """The limit that the readings show, if any."""
    m = search.measurement
    flat = plateau_of(m.force)
    if flat is not None and flat.largest and flat.readings >= FOREIGN.plateau:
        at = m.force >= flat.force - 1e-9 * abs(flat.force)
        # Each is within rounding of the limit.
        constant = -(flat.readings - 1) * float(np.log(max(flat.step, 1e-6 * flat.force)))
        found = _beside(search, base, at)
        return None if found is None else _with_evidence(search, base, found, at, flat.force, constant)
    return _noisy(search, base)


def _noisy(search: Search, base: Candidate) -> Limit | None:
    """A limit that readings scatter about: those that the film, fitted to the others, would have carried beyond it."""
    m, sd = search.measurement, search.noise.each
    top = float(np.max(m.force))
    level = float(np.median(m.force[m.force > top - FOREIGN.limit_band * float(sd[np.argmax(m.force)])]))
    at = m.force > level - 0.5 * FOREIGN.limit_band * sd
    told = None
    for _ in range(FOREIGN.limit_rounds):
        found = _beside(search, base, at) if _promises(search, base, at) else None
        if found is None:
            return None
        level = float(np.mean(m.force[at]))
        told = _with_evidence(search, base, found, at, level, _constant(search, at))
        whole = search.at(found.hypothesis, found.x)
        beyond = at if whole is None else m.force - whole.residual > level
        if np.array_equal(beyond, at):
            break
        at = beyond
    return told


def _promises(search: Search, base: Candidate, at: NDArray[np.bool_]) -> bool:
    """True if there are enough readings, and a constant is nearer to them than the model is."""
    if np.count_nonzero(at) < FOREIGN.plateau:
        return False
    y, sd = search.measurement.force[at], search.noise.each[at]
    flat = float(np.sum(((y - np.mean(y)) / sd) ** 2))
    return flat + FOREIGN.limit_gain < float(np.sum((base.residual[at] / sd) ** 2))


def _constant(search: Search, at: NDArray[np.bool_]) -> float:
    """ln p of the readings at the limit, as a constant with their noise: integrated over the constant, N."""
    m = search.measurement.select(at)
    noise = search.noise.part(m, at)
    both = noise.white(np.column_stack([m.force, np.ones(len(m))]))
    one = float(both[:, 1] @ both[:, 1])
    squares = float(both[:, 0] @ both[:, 0]) - float(both[:, 0] @ both[:, 1]) ** 2 / one
    return -0.5 * (squares + (len(m) - 1) * float(np.log(2 * np.pi)) + float(np.log(one))) - noise.log_root


def _beside(search: Search, base: Candidate, at: NDArray[np.bool_]) -> Candidate | None:
    """The model fitted to the readings that are not ``at`` the limit; None if they are too few."""
    if np.count_nonzero(~at) < base.x.size + FOREIGN.spare:
        return None
    return _others(search, at).fit(base.hypothesis, [base.x])


def _others(search: Search, at: NDArray[np.bool_]) -> Search:
    m = search.measurement.select(~at)
    return Search(m, search.noise.part(m, ~at), search.seed, search.solve)


def _with_evidence(
    search: Search, base: Candidate, others: Candidate, at: NDArray[np.bool_], force: float, constant: float
) -> Limit:
    """With the evidence of the ``others``; the limit itself lies anywhere up to twice the force."""
    part = _others(search, at)
    whole = weighed(search.linear(base), base.theta).log_evidence - search.noise.log_root
    rest = weighed(part.linear(others), others.theta).log_evidence - part.noise.log_root
    return Limit(force, rest - whole + constant - float(np.log(2 * force)), int(np.flatnonzero(at)[0]))
