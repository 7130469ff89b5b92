"""The models on the way of a closed loop: as given, what each round added, and rivals that could not be told apart."""

from __future__ import annotations

from dataclasses import dataclass, replace

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.left.heldout import Misfit, misfit_of
from bayesmembrane.diagnosis.loop import Loop, Round, Stage
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.words.hypothesis import spoken


@dataclass(frozen=True, eq=False)
class Waypoint:
    """One model on the way.

    title : material and effects as people say them
    of : the diagnosis that it belongs to
    candidate : at its most probable parameters
    error, held_out : in sample; on points that were set aside, with the model fitted to the others, or None
    stage : its posterior, or None if it was not sampled
    added : False for what the answer leaves undecided
    covered : part of the points that were set aside inside the 90 % band of the model fitted to the others, or None
    """

    title: str
    of: Diagnosis
    candidate: Candidate
    error: Misfit
    held_out: Misfit | None
    stage: Stage | None
    added: bool = True
    covered: float | None = None


def waypoints(loop: Loop) -> list[Waypoint]:
    """The model as given, then what each round added or, at the end, would have added if it could be told."""
    first = loop.rounds[0]
    d = first.diagnosis
    out = [_waypoint(d, d.null, d.before, first.before, before=True)]
    for r, following in zip(loop.rounds, [*loop.rounds[1:], None], strict=True):
        d = r.diagnosis
        if r.changed and following is not None and len(following.diagnosis.measurement) == len(d.measurement):
            # The next diagnosis fits it again: one model has one error.
            again = following.diagnosis
            out.append(_waypoint(again, again.null, again.before, r.after, before=True))
        elif d.verdict == "ambiguous":
            out += _undecided(r)
        elif d.explains:
            stage = r.after if r.changed else None
            out.append(replace(_waypoint(d, d.best, d.after, stage, before=False), added=stage is not None))
    return out


def _undecided(r: Round) -> list[Waypoint]:
    """The members of an ambiguous answer that were sampled, or else the first; only that one was held to new points."""
    d = r.diagnosis
    first = replace(_waypoint(d, d.best, d.after, next(iter(r.leaders), None), before=False), added=False)
    sd = d.noise.each
    rest = zip(d.members[1:], r.leaders[1:], strict=False)
    return [
        first,
        *(
            Waypoint(
                spoken(j.candidate.hypothesis),
                d,
                j.candidate,
                misfit_of(j.candidate.residual, sd, j.candidate.x.size),
                None,
                stage,
                added=False,
            )
            for j, stage in rest
        ),
    ]


def _waypoint(d: Diagnosis, candidate: Candidate, error: Misfit, stage: Stage | None, before: bool) -> Waypoint:
    v, title = d.validation, spoken(candidate.hypothesis)
    if v is None:
        return Waypoint(title, d, candidate, error, None, stage)
    held, covered = (v.before, v.covered_before) if before else (v.after, v.covered_after)
    return Waypoint(title, d, candidate, error, held, stage, covered=covered)
