"""What a diagnosis came to, as values: `words.diagnosis` says it in sentences."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from bayesmembrane.data.fixture import Fixture
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.detection.detect import Detection
from bayesmembrane.diagnosis.explanation.foreign import Foreign
from bayesmembrane.diagnosis.explanation.total import Judged, Probabilities
from bayesmembrane.diagnosis.left.heldout import HeldOut, Misfit
from bayesmembrane.diagnosis.left.remaining import Remaining
from bayesmembrane.diagnosis.left.shape import ResidualShape
from bayesmembrane.diagnosis.reference.noise import OwnNoise
from bayesmembrane.diagnosis.reference.outliers import SetAside
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
    effects : names of those beyond the given ones; of a set all, of an ambiguous answer all of its sets
    material : the better energy if that is the verdict, else ""
    declared : False if no energy was declared
    probabilities : of sets of effects, of energies, of what is foreign, each summed over the others
    remaining : what the answer leaves; where there is none, what the most probable hypothesis does
    rig, thickness : of the measurement; m
    measurement : the readings that were diagnosed: without outliers, of a long one those that were taken
    detection : tests of the model as given
    null, best : the model as given, and the most probable one
    ranking : every hypothesis that was fitted, the most probable first
    members : the hypotheses that the verdict rests on
    foreign : the most probable thing that is foreign, or None where none was found
    confounded : (effect, effect, degrees) that this protocol cannot separate
    noise : the measurement's own
    power : by effect, the smallest |size| that this measurement would have shown, SI
    absorbed : names of the effects that the material absorbs without trace
    before, after : misfit in sample
    shape : of the residual before
    validation : misfit on points that were set aside, or None
    experiments : what to measure next where rivals are left
    thinned : what was diagnosed of a measurement with too many readings, and what all of the above is about; else None
    set_aside : single readings that were left out as outliers, of those; else None
    unsought : names of the effects that were not looked for, since a test that only goes one way hides them
    firm : names of effects beyond the given ones that are together in all that is probable, and explain clearly more
        than what is left, whatever else is at work: what a loop may go on with, though there is no name
    """

    verdict: str
    effects: tuple[str, ...]
    material: str
    declared: bool
    probabilities: Probabilities
    remaining: Remaining
    rig: Fixture
    thickness: float
    measurement: Measurement
    detection: Detection
    null: Candidate
    best: Candidate
    ranking: tuple[Judged, ...]
    members: tuple[Judged, ...]
    foreign: Foreign | None
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
    set_aside: SetAside | None = None
    unsought: tuple[str, ...] = ()
    firm: tuple[str, ...] = ()

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
