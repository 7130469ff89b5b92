"""A load cell, or whatever follows it, at its limit: readings there say no more than that it was reached.

Where the converter saturates, readings share their last digit: ln K compares the model of all readings with that of
the others, and those at the limit with a constant. Where what comes before it saturates, at once or softly, readings
scatter about the limit as everywhere: then it is a law of the reading (`saturation.py`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.evidence import weighed
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS
from bayesmembrane.diagnosis.explanation.saturation import Saturated, fitted_below, promises, saturated
from bayesmembrane.diagnosis.left.shape import plateau_of
from bayesmembrane.diagnosis.thresholds import FOREIGN, SATURATION
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.form_error import unsteady


@dataclass(frozen=True)
class Limit:
    """A limit beside a model.

    force : N, where it is
    gain : ln of the Bayes factor over the model without it
    first : number of the first reading there
    trace : (N,) N, what the model with it says otherwise than that without
    width : of the force, over what part of the limit the reading yields; 0 where it is met at once
    law : of the reading, with its film, where readings scatter about the limit
    """

    force: float
    gain: float
    first: int
    trace: Array
    width: float = 0.0
    law: Saturated | None = None


def limit_of(search: Search, base: Candidate, before: Limit | None = None) -> Limit | None:
    """The limit that the readings show, if any; looked for near the one that was found ``before``, if there is one.

    It gains what it does without the last reading of each loading, if that is less: single ones go astray where the
    disc turns, as the grip's inertia has it, and a limit is met by more than those.
    """
    found = _limit_of(search, base, before)
    if found is None or found.gain <= BELIEFS.supported:
        return found
    if found.law is not None and not _is_met(search, found.law):
        return None
    rest = ~_last_of_loadings(search.measurement)
    again = found if np.all(rest) else _limit_of(_part(search, rest), base.at(rest), found)
    return None if again is None else replace(found, gain=min(found.gain, again.gain))


def _last_of_loadings(m: Measurement) -> NDArray[np.bool_]:
    """(N,) True for the last reading of each loading, where an unloading follows at once."""
    leg = np.sign(m.leg)
    return np.append((leg[:-1] > 0) & (leg[1:] < 0), False)


def _limit_of(search: Search, base: Candidate, before: Limit | None) -> Limit | None:
    m = search.measurement
    flat = plateau_of(m.force)
    if flat is None or not flat.largest:
        return _before_the_converter(search, base, before)
    at = m.force >= flat.force - 1e-9 * abs(flat.force)
    if np.count_nonzero(at & m.moving) < FOREIGN.plateau:
        return _before_the_converter(search, base, before)
    # Each is within rounding of the limit.
    constant = -(flat.readings - 1) * float(np.log(max(flat.step, 1e-6 * flat.force)))
    found = _beside(search, base, at)
    return None if found is None else _with_evidence(search, base, found, at, flat.force, constant)


def log_evidence_alone(search: Search, base: Candidate) -> float:
    """ln Z of a limit beside ``base`` that leaves noise alone; -inf if there is none, or more is left.

    What a film that is fitted to them leaves of readings far below the largest one is not for a limit, which is only
    looked for where it leaves noise.
    """
    noise = len(search.measurement) + FOREIGN.settled_sd * float(np.sqrt(2 * len(search.measurement)))
    if promises(search, base):
        below = fitted_below(search, base, min(SATURATION.lower))
        if below is not None and below.squares > noise:
            return -np.inf
    found = limit_of(search, base)
    if found is None:
        return -np.inf
    white = search.noise.white(base.residual - found.trace)
    return base.log_evidence + found.gain if float(white @ white) < noise else -np.inf


def _before_the_converter(search: Search, base: Candidate, before: Limit | None) -> Limit | None:
    """A limit that readings scatter about."""
    found, m = saturated(search, base, None if before is None else before.law), search.measurement
    if found is None:
        return None
    gain = found.log_evidence - weighed(search.linear(base), base.theta).log_evidence
    reached = np.flatnonzero(found.reached)
    first = int(reached[0] if reached.size else np.argmax(m.force))
    trace = found.reading - (m.force - base.residual)
    return Limit(found.law.limit, gain, first, trace, 1 / found.law.sharpness, found)


def _is_met(search: Search, found: Saturated) -> bool:
    """True if no reading goes far beyond the limit, and enough readings of a steady motion yield to it."""
    m, sd = search.measurement, search.noise.each
    if np.max(m.force - FOREIGN.beyond * sd) > found.law.limit:
        return False
    yields = m.force - found.film.residual - found.reading > sd
    yields[unsteady(m)] = False
    return bool(np.count_nonzero(yields & m.moving) >= FOREIGN.met)


def _beside(search: Search, base: Candidate, at: NDArray[np.bool_]) -> Candidate | None:
    """The model fitted to the readings that are not ``at`` the limit; None if they are too few."""
    if np.count_nonzero(~at) < base.x.size + FOREIGN.spare:
        return None
    return _part(search, ~at).fit(base.hypothesis, [base.x])


def _part(search: Search, some: NDArray[np.bool_]) -> Search:
    """The search of ``some`` (N,) of the readings."""
    m = search.measurement.select(some)
    return Search(m, search.noise.part(m, some), search.seed, search.solve, search.factors.of(some))


def _with_evidence(
    search: Search, base: Candidate, others: Candidate, at: NDArray[np.bool_], force: float, constant: float
) -> Limit:
    """With the evidence of the ``others``; the limit itself lies anywhere up to twice the force."""
    m, part = search.measurement, _part(search, ~at)
    whole = weighed(search.linear(base), base.theta).log_evidence - search.noise.log_root
    rest = weighed(part.linear(others), others.theta).log_evidence - part.noise.log_root
    beside = search.unweighed(others.hypothesis, others.x)
    film = base if beside is None else beside
    trace = np.minimum(m.force - film.residual, force) - (m.force - base.residual)
    gain = rest - whole + constant - float(np.log(2 * force))
    return Limit(force, gain, int(np.flatnonzero(at)[0]), trace)
