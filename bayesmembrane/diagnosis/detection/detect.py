"""Is anything missing? Three tests, since each is blind where another sees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.detection.lack_of_fit import LackOfFit, lack_of_fit
from bayesmembrane.diagnosis.detection.periodicity import Periodicity, periodicity
from bayesmembrane.diagnosis.detection.scores import ScoreTest, Signature, score_test
from bayesmembrane.diagnosis.reference.noise import Whitened
from bayesmembrane.diagnosis.thresholds import DETECTION


@dataclass(frozen=True)
class Detection:
    """What the tests say of one model. ``p_value`` is the smallest, corrected for their number."""

    lack_of_fit: LackOfFit
    score: ScoreTest
    periodicity: Periodicity | None

    @property
    def p_value(self) -> float:
        every = [self.lack_of_fit.p_value, self.score.p_value]
        if self.periodicity is not None:
            every.append(self.periodicity.p_value)
        return float(min(1.0, len(every) * min(every)))

    @property
    def adequate(self) -> bool:
        """True if nothing is seen to be missing."""
        return self.p_value > DETECTION.level


def detect(
    measurement: Measurement, model: Whitened, found: Sequence[Signature], rng: np.random.Generator
) -> Detection:
    """Lack of fit, largest score and periodicity of one model, freed of a noise that allows for its own error."""
    return Detection(lack_of_fit(model), score_test(model, found, rng), periodicity(measurement, model))
