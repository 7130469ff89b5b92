"""Which further measurement would tell rival explanations apart, found by simulating it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.ground.errors import BayesmembraneError
from bayesmembrane.next_test.further import FurtherTest, Kind, Simulation, other_motions
from bayesmembrane.next_test.gain import separation
from bayesmembrane.physics.effects.base import Compliance
from bayesmembrane.physics.forward import Solve


@dataclass(frozen=True)
class Experiment:
    """A further measurement and how far apart it would put the nearest two rivals.

    separation : in standard deviations of the noise, after each rival has adapted its parameters; inf: one sees it bare
    """

    test: FurtherTest
    separation: float


def experiments(measurement: Measurement, rivals: Sequence[Candidate], sd: float, solve: Solve) -> list[Experiment]:
    """Further measurements, the one that separates the nearest two rivals best first.

    Rival A makes the curve, and rival B is fitted to old and new points together, to first order: what B cannot follow,
    over the noise, is the separation. A test that cannot be simulated for some rival is left out.
    """
    out = []
    for trial in other_motions(measurement):
        try:
            distance = min(_separation(trial, a, b, sd, solve) for a, b in combinations(rivals, 2))
        except (BayesmembraneError, np.linalg.LinAlgError):
            continue
        if np.isfinite(distance):
            out.append(Experiment(trial.test, float(distance)))
    frame = [any(isinstance(e, Compliance) for e in r.hypothesis.effects) for r in rivals]
    if any(frame) and not all(frame):
        out.append(Experiment(FurtherTest(Kind.BLANK), np.inf))
    return sorted(out, key=lambda e: -e.separation)


def _separation(trial: Simulation, a: Candidate, b: Candidate, sd: float, solve: Solve) -> float:
    """|(F_A - F_B) of the new points, less what B's slopes on old and new points absorb| / sd."""
    shown = [trial.signals(c.hypothesis, c.x[None, :], solve) for c in (a, b)]
    difference = np.concatenate([b.residual - a.residual, shown[0].force[0] - shown[1].force[0]])
    return separation(difference, np.concatenate([b.slopes, shown[1].slopes[0]]), sd)
