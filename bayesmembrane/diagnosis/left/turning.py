"""What comes where a test turns, and may be no more than what loops leave there."""

from __future__ import annotations

import numpy as np

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.motion import Motion
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.thresholds import GROWTH, VERDICT
from bayesmembrane.physics.effects.base import Effect


def at_a_turn(candidate: Candidate, measurement: Measurement) -> Effect | None:
    """An effect that begins within `VERDICT.at_a_turn` of the test about a turn, and may be no more than a loop.

    Laws of loops are farthest off where a test turns, so that beside an effect that remembers the way what comes there
    may make up for that. And about the last turn, after which no loading comes half as far again, whatever opposes the
    motion leaves a force that falls at once, too: only another loading would show that a part of the film is gone.
    """
    effects, path = candidate.hypothesis.effects, measurement.path
    ends = np.flatnonzero(np.diff(path.leg)).tolist()
    turns, last = path.clock[ends], path.clock[[i for i in ends if _last(path, i)]]
    near = VERDICT.at_a_turn * float(np.ptp(path.clock))
    for e in effects:
        others = any(o.remembers for o in effects if o is not e)
        doubtful = turns if others else last
        if any(np.any(np.abs(moment - doubtful) < near) for moment in _moments(e, candidate)):
            return e
    return None


def _last(path: Motion, end: int) -> bool:
    """Whether the disc turns down at reading ``end``, and is not lifted half as far again."""
    again = path.deflection[end + 1 :][path.leg[end + 1 :] > 0]
    return bool(path.leg[end] > 0 and np.max(again, initial=0.0) < VERDICT.loads_again * path.deflection[end])


def _moments(effect: Effect, candidate: Candidate) -> list[float]:
    """When it comes, s, as far as that is a good part of it; nothing where it comes with the way."""
    if not effect.begins:
        return []
    p = {name: candidate.parameters[f"{effect.name}.{name}"] for name in (effect.begins, *(effect.second or ()))}
    if effect.second is None:
        return [p[effect.begins]]
    part, first, then = (p[name] for name in effect.second)
    return [t for t, much in ((first, 1 - part), (then, part)) if much > GROWTH.no_event]
