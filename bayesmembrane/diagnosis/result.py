"""What a diagnosis came to, as values: `words.diagnosis` says it in sentences."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from bayesmembrane.data.fixture import Fixture
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.sudden import SuddenChange
from bayesmembrane.diagnosis.detection.detect import Detection
from bayesmembrane.diagnosis.explanation.case import Judged
from bayesmembrane.diagnosis.left.heldout import HeldOut, Misfit
from bayesmembrane.diagnosis.left.shape import ResidualShape
from bayesmembrane.diagnosis.reference.noise import OwnNoise
from bayesmembrane.diagnosis.separation import Experiment
from bayesmembrane.ground.showable import Showable
from bayesmembrane.physics.hypothesis import Hypothesis

VERDICTS = ("adequate", "named", "ambiguous", "material", "unknown")


@dataclass(frozen=True)
class Thinned:
    """How many readings were diagnosed, of a measurement that has more than a diagnosis takes."""

    used: int
    measured: int


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Showable):
    """The answer.

    Attributes
    ----------
    verdict : one of `VERDICTS`
    effects : names; of a pair both, of an ambiguous answer all in the set
    material : the better energy if that is the verdict, else ""
    rig, thickness : of the measurement; m
    detection : tests of the model as given
    null, best : the model as given, and the most probable one
    ranking : every candidate that was refitted, the most probable first
    members : the candidates that the verdict rests on
    better : the same effects or others with another energy, where that is decisively more probable
    form : part of the plain material's misfit that an adequate model leaves, where the tests do see it
    sudden : a change at one moment that explains the curve as well as the members do, or comes nearest where nothing
        explains it
    confounded : (effect, effect, degrees) that this protocol cannot separate
    noise : the measurement's own
    power : by effect, the smallest |size| that this measurement would have shown, SI
    absorbed : names of the effects that the material absorbs without trace
    before, after : misfit in sample
    shape : of the residual before
    validation : misfit on points that were set aside, or None
    experiments : what to measure next where rivals are left
    thinned : what was diagnosed of a measurement with too many readings, and what all of the above is about; else None
    """

    verdict: str
    effects: tuple[str, ...]
    material: str
    rig: Fixture
    thickness: float
    detection: Detection
    null: Candidate
    best: Candidate
    ranking: tuple[Judged, ...]
    members: tuple[Judged, ...]
    better: Judged | None
    form: float | None
    sudden: SuddenChange | None
    confounded: tuple[tuple[str, str, float], ...]
    noise: OwnNoise
    power: Mapping[str, float]
    absorbed: tuple[str, ...]
    before: Misfit
    after: Misfit
    shape: ResidualShape
    validation: HeldOut | None
    experiments: tuple[Experiment, ...]
    thinned: Thinned | None = None

    @property
    def hypothesis(self) -> Hypothesis:
        """The model that the verdict asks for; the given one where nothing can be named."""
        return self.best.hypothesis if self.explains else self.null.hypothesis

    @property
    def explains(self) -> bool:
        """True if one model explains the curve: the one with what is named, or with the better energy."""
        return self.verdict in ("named", "material")


def thinning(whole: Measurement, part: Measurement) -> Thinned | None:
    """What is to be told where ``part`` has fewer readings than ``whole``."""
    return None if len(part) == len(whole) else Thinned(len(part), len(whole))
