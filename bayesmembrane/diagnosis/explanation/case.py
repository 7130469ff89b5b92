"""A case: one measurement and the model that is asked about, with all that is known so far; and how candidates fare."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bayesmembrane.calibration.posterior import enough_points
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates.candidate import Candidate, available
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.candidates.signatures import signatures
from bayesmembrane.diagnosis.detection.detect import Detection, detect
from bayesmembrane.diagnosis.detection.lack_of_fit import LackOfFit, lack_of_fit
from bayesmembrane.diagnosis.detection.periodicity import periodicity
from bayesmembrane.diagnosis.detection.scores import Signature
from bayesmembrane.diagnosis.reference.inferred import own_noise
from bayesmembrane.diagnosis.reference.noise import Whitened, whitened
from bayesmembrane.diagnosis.reference.smooth import smooth_reference
from bayesmembrane.diagnosis.thresholds import EXPLANATION, SEARCH
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.effects.base import Effect
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.hypothesis import Hypothesis

Tell = Callable[[str], None]
"""Takes a line on what is being done."""


@dataclass(frozen=True, eq=False)
class OpenCase:
    """Everything that the steps of a diagnosis need, and what they have found so far.

    search : fits candidates; it has the measurement, its noise, the seed and the solver
    smooth : (N, p) the reference that no physics could beat
    null : the model as given, fitted
    effects : of the library, that could be at work
    signatures : of these effects beside the null model, without the invisible ones
    detection : tests of the null model
    rng : draws of the tests
    tell : what is being done
    """

    search: Search
    smooth: Array
    null: Candidate
    effects: tuple[Effect, ...]
    signatures: tuple[Signature, ...]
    detection: Detection
    rng: np.random.Generator
    tell: Tell

    @property
    def measurement(self) -> Measurement:
        return self.search.measurement

    @property
    def visible(self) -> list[Effect]:
        """Those of the effects that leave a trace in this test."""
        names = {s.effect for s in self.signatures}
        return [e for e in self.effects if e.name in names]

    @cached_property
    def before(self) -> LackOfFit:
        """Of the null model."""
        return lack_of_fit(self.whitened(self.null.residual, self.null.slopes))

    def whitened(self, residual: Array, slopes: Array) -> Whitened:
        """What a model with these slopes (N, k) leaves (N,), freed of noise that allows for its own error."""
        return whitened(residual, slopes, self.smooth, self.search.noise.cautious())


@dataclass(frozen=True, eq=False)
class Judged:
    """A candidate and how well it fits.

    unexplained : part of the null model's misfit that is left
    p_value : of what is left, if as much of the null model's misfit may be as `leaves_little` allows
    gain : ln of the Bayes factor over the null model
    ripples : True if waves are left that weigh as much as what it takes away
    explains : True if the null model is no rival of it, and it leaves noise, or little beside what was there
    """

    candidate: Candidate
    fit: LackOfFit
    unexplained: float
    p_value: float
    gain: float
    ripples: bool
    explains: bool

    @property
    def log_evidence(self) -> float:
        return self.candidate.log_evidence


def opened(measurement: Measurement, hypothesis: Hypothesis, seed: int, solve: Solve, tell: Tell) -> OpenCase:
    """The model as given, fitted and tested; first with the reference's noise, then with one that knows its slopes.

    Raises `SettingsError` if there are too few points to tell a misfit from noise, or no film reaches the data.
    """
    _check_size(measurement, hypothesis)
    tell(f"fitting {hypothesis.label()}")
    smooth = smooth_reference(measurement)
    search = Search(measurement, own_noise(measurement, smooth), seed, solve)
    null = search.fit(hypothesis, search.material_starts(hypothesis))
    if null is None:
        raise SettingsError(
            f"no {hypothesis.label()} film reaches the data", remedy="use a shorter range or another material"
        )
    search = replace(search, noise=own_noise(measurement, np.column_stack([smooth, null.slopes])))
    null = search.fit(hypothesis, [null.x]) or null
    tell("testing the residual")
    effects = tuple(available(measurement, hypothesis))
    rng = np.random.default_rng([seed, 7])
    found = signatures(search, null, effects)
    seen = whitened(null.residual, null.slopes, smooth, search.noise.cautious())
    return OpenCase(search, smooth, null, effects, tuple(found), detect(measurement, seen, found, rng), rng, tell)


def reopened(case: OpenCase, null: Candidate) -> OpenCase:
    """The same case with another null model: one that has more effects, or other parameters."""
    effects = tuple(e for e in case.effects if e.name not in null.names)
    found = signatures(case.search, null, effects)
    detection = detect(case.measurement, case.whitened(null.residual, null.slopes), found, case.rng)
    return replace(case, null=null, effects=effects, signatures=tuple(found), detection=detection)


def _check_size(measurement: Measurement, hypothesis: Hypothesis) -> None:
    enough_points(hypothesis, measurement)
    least = hypothesis.curve_size + SEARCH.spare_points
    if len(measurement) < least:
        raise SettingsError(
            f"{len(measurement)} points leave too little to tell what {hypothesis.label()} misses",
            remedy=f"use at least {least} points, or a material with fewer parameters",
        )


def judged(case: OpenCase, candidate: Candidate) -> Judged:
    """Its lack of fit, the part of the null model's that is left, and whether it explains the curve."""
    white = case.whitened(candidate.residual, candidate.slopes)
    fit = lack_of_fit(white)
    left, p_value = fit.part_left_of(case.before), fit.p_if_left(EXPLANATION.unexplained_large, case.before)
    gain = candidate.log_evidence - case.null.log_evidence
    wave = periodicity(case.measurement, white)
    taken = EXPLANATION.wave_share * max(case.before.chi2 - fit.chi2, 0.0)
    ripples = wave is not None and wave.p_value < EXPLANATION.wave_level and wave.squares > taken
    explains = _is_little(fit, left, p_value) and gain > EXPLANATION.probable and not ripples
    return Judged(candidate, fit, left, p_value, gain, ripples, explains)


def leaves_little(case: OpenCase, residual: Array, slopes: Array) -> bool:
    """True if what a model with these slopes (N, k) leaves (N,) is noise, or little of the null model's misfit."""
    fit = lack_of_fit(case.whitened(residual, slopes))
    left, p_value = fit.part_left_of(case.before), fit.p_if_left(EXPLANATION.unexplained_large, case.before)
    return _is_little(fit, left, p_value)


def _is_little(fit: LackOfFit, unexplained: float, p_value: float) -> bool:
    small = fit.reduced_chi2 <= EXPLANATION.small_chi2
    allowed = EXPLANATION.unexplained if small else EXPLANATION.unexplained_large
    return p_value > EXPLANATION.level or unexplained <= allowed
