"""What comes where a test turns, beside a law that makes loops there."""

from __future__ import annotations

import numpy as np

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.thresholds import VERDICT
from bayesmembrane.physics.effects.base import Effect


def at_a_turn(candidate: Candidate, measurement: Measurement) -> Effect | None:
    """An effect that begins within `VERDICT.at_a_turn` of the test about a turn, where another one remembers the way.

    Laws of loops are farthest off where a test turns, and what comes there of itself may be no more than that.
    """
    effects, path = candidate.hypothesis.effects, measurement.path
    turns = path.clock[np.flatnonzero(np.diff(path.leg))]
    near = VERDICT.at_a_turn * float(np.ptp(path.clock))
    for e in effects:
        others = any(o.remembers for o in effects if o is not e)
        if e.begins and others and np.any(np.abs(candidate.parameters[f"{e.name}.{e.begins}"] - turns) < near):
            return e
    return None
