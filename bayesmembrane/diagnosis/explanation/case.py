"""A case: one measurement with every energy fitted to it, its noise, and what the tests say of the given model."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bayesmembrane.calibration.posterior import enough_points, fixed_by_data
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates.candidate import Candidate, available
from bayesmembrane.diagnosis.candidates.sampled import checked
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.candidates.signatures import signatures
from bayesmembrane.diagnosis.candidates.weighing import Weighing
from bayesmembrane.diagnosis.detection.detect import Detection, detect
from bayesmembrane.diagnosis.detection.scores import Signature
from bayesmembrane.diagnosis.explanation.foreign import Foreign
from bayesmembrane.diagnosis.explanation.foreign_search import beside, the_only
from bayesmembrane.diagnosis.explanation.limit import log_evidence_alone
from bayesmembrane.diagnosis.explanation.twins import Pairs, twins, twins_in_time, twins_one_way
from bayesmembrane.diagnosis.reference.inferred import own_noise
from bayesmembrane.diagnosis.reference.noise import Whitened, orthonormal, whitened
from bayesmembrane.diagnosis.reference.smooth import smooth_reference
from bayesmembrane.diagnosis.thresholds import SEARCH
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import ordinary_materials
from bayesmembrane.physics.effects.base import Effect
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.materials.base import Material

Tell = Callable[[str], None]
"""Takes a line on what is being done."""


@dataclass(frozen=True)
class Question:
    """What is asked of a measurement.

    hypothesis : the energy that is preferred, effects that are known to be at work, noise and convexity
    declared : False if the energy was not named: all of them are as probable
    quick : True: one effect at most
    """

    hypothesis: Hypothesis
    declared: bool = True
    quick: bool = False

    @property
    def energy(self) -> str | None:
        """The name of the energy that was declared."""
        return self.hypothesis.material.name if self.declared else None

    @property
    def label(self) -> str:
        """What is asked about, as its progress is told under."""
        return self.hypothesis.label() if self.declared else "the curve"


@dataclass(frozen=True, eq=False)
class DiagnosisCase(ABC):
    """Everything that the steps of a diagnosis need, and what they have found so far.

    question : what is asked
    search : fits candidates; it has the readings and their noise
    smooth : (N, p) the reference that no physics could beat
    plain : by energy, the fit without any but the given effects
    null : the one of these that was asked about: with the declared energy, or else the most probable
    effects : of the library, that could be at work
    signatures : of these effects beside the null model, without the invisible ones
    elsewhere : names of those that are invisible there, and leave a trace beside another energy
    detection : tests of the null model
    rng : draws of the tests
    tell : what is being done
    """

    question: Question
    search: Weighing
    smooth: Array
    plain: Mapping[str, Candidate]
    null: Candidate
    effects: tuple[Effect, ...]
    signatures: tuple[Signature, ...]
    elsewhere: frozenset[str]
    detection: Detection
    rng: np.random.Generator
    tell: Tell

    @property
    def visible(self) -> list[Effect]:
        """Those of the effects that leave a trace in this test, beside one energy at least.

        An energy with many parameters may follow an effect wholly, and be an unlikely one for it.
        """
        names = {s.effect for s in self.signatures} | self.elsewhere
        return [e for e in self.effects if e.name in names]

    @property
    def best_plain(self) -> Candidate:
        """The most probable energy without any but the given effects."""
        return max(self.plain.values(), key=lambda c: c.log_evidence)

    @cached_property
    def sees_nothing(self) -> bool:
        """True if no test sees a misfit: of the null model, nor of the most probable energy.

        A declared energy may follow the curve by parameters that nobody would expect.
        """
        best = self.best_plain
        return self.detection.adequate and (self.null is best or self.tested(best).adequate)

    def tested(self, candidate: Candidate) -> Detection:
        """The tests of another model."""
        effects = [e for e in self.effects if e.name not in candidate.names]
        found = signatures(self.search, candidate, effects)
        white = whitened(candidate.residual, candidate.slopes, self.smooth, self.search.noise.cautious())
        return self.detected(white, found)

    @abstractmethod
    def detected(self, white: Whitened, found: Sequence[Signature]) -> Detection:
        """The tests of a model that is freed of noise."""

    @abstractmethod
    def renewed(self, search: Weighing, best: Candidate) -> Weighing:
        """The search with the noise that is left by the reference together with the slopes of the best candidate."""

    @abstractmethod
    def twins(self) -> Pairs:
        """The pairs of effects that cannot be told apart here."""

    @abstractmethod
    def foreign(self, search: Weighing, bases: Sequence[Candidate], others: Sequence[Candidate]) -> list[Foreign]:
        """What is foreign beside the ``bases``, and a limit beside the ``others`` too; the most probable first."""

    @abstractmethod
    def log_evidence_of_limit(self, search: Weighing, bases: Sequence[Candidate]) -> float:
        """ln Z of a limit of the load cell beside one of the ``bases`` that leaves noise alone; -inf if none does."""


@dataclass(frozen=True, eq=False)
class OpenCase(DiagnosisCase):
    """The case of one measurement."""

    search: Search

    @property
    def measurement(self) -> Measurement:
        return self.search.measurement

    def detected(self, white: Whitened, found: Sequence[Signature]) -> Detection:
        return detect(self.measurement, white, found, self.rng)

    def renewed(self, search: Weighing, best: Candidate) -> Search:
        assert isinstance(search, Search)
        return renewed(search, self.smooth, best)

    def twins(self) -> Pairs:
        of_motion = twins_in_time(self.effects, self.measurement) | twins_one_way(self.effects, self.measurement)
        return twins(self.effects, self.signatures) | of_motion

    def foreign(self, search: Weighing, bases: Sequence[Candidate], others: Sequence[Candidate]) -> list[Foreign]:
        assert isinstance(search, Search)
        return beside(the_only(search), bases, others)

    def log_evidence_of_limit(self, search: Weighing, bases: Sequence[Candidate]) -> float:
        assert isinstance(search, Search)
        return max(log_evidence_alone(search, base) for base in bases)


def opened(measurement: Measurement, question: Question, seed: int, solve: Solve, tell: Tell) -> OpenCase:
    """Every energy fitted, the null model tested; first with the reference's noise, then with one that knows slopes.

    Raises `SettingsError` if there are too few points to tell a misfit from noise, or no film reaches the data.
    """
    question = replace(question, hypothesis=question.hypothesis.with_frame(measurement))
    hypothesis = question.hypothesis
    _check_size(measurement, question)
    smooth = smooth_reference(measurement)
    search = Search(measurement, own_noise(measurement, smooth), seed, solve)
    plain = _energies(search, question, tell)
    best = max(plain.values(), key=lambda c: c.log_evidence)
    search = renewed(search, smooth, best)
    rng = np.random.default_rng([seed, 7])
    plain = {name: checked(search, search.weighed_anew(c)) for name, c in plain.items()}
    best = max(plain.values(), key=lambda c: c.log_evidence)
    null = plain[hypothesis.material.name] if question.declared else best
    tell("testing the residual")
    effects = tuple(available(measurement, hypothesis))
    found = signatures(search, null, effects)
    elsewhere = seen_elsewhere(search, plain, effects, {s.effect for s in found})
    seen = whitened(null.residual, null.slopes, smooth, search.noise.cautious())
    detection = detect(measurement, seen, found, rng)
    return OpenCase(question, search, smooth, plain, null, effects, tuple(found), elsewhere, detection, rng, tell)


def seen_elsewhere(
    search: Weighing, plain: Mapping[str, Candidate], effects: Sequence[Effect], seen: Collection[str]
) -> frozenset[str]:
    """Names of the effects that are not ``seen``, and leave a trace beside one of the plain fits."""
    hidden = {e.name: e for e in effects if e.name not in seen}
    for c in sorted(plain.values(), key=lambda c: c.x.size):
        for s in signatures(search, c, list(hidden.values())):
            hidden.pop(s.effect, None)
    return frozenset(e.name for e in effects if e.name not in seen and e.name not in hidden)


def renewed(search: Search, smooth: Array, best: Candidate) -> Search:
    """The search with the noise that the reference leaves together with the slopes of the best candidate so far.

    Misfit looks like noise that remembers: what the best model leaves is closer to the truth.
    """
    basis = np.column_stack([smooth, best.slopes])
    if orthonormal(basis).shape[1] >= len(search.measurement):
        return search  # few points: what the best model leaves is nothing at all, and says nothing of noise
    return search.with_noise(own_noise(search.measurement, basis))


def _energies(search: Search, question: Question, tell: Tell) -> dict[str, Candidate]:
    """Every energy with the given effects; raises `SettingsError` if the declared one, or none, reaches the data."""
    asked = question.hypothesis.material
    found = {}
    for name, hypothesis in _every_energy(question).items():
        if len(search.measurement) < hypothesis.curve_size + SEARCH.spare_points:
            continue
        tell(f"fitting {hypothesis.label()}")
        candidate = _reaching(search, hypothesis, needed=question.declared and hypothesis.material is asked)
        if candidate is not None:
            found[name] = candidate
    if not found:
        if not np.any(search.measurement.force):
            raise SettingsError("all forces are zero", remedy="use a curve that was measured")
        raise SettingsError("no film of any energy reaches the data", remedy="use a shorter range")
    return found


def _every_energy(question: Question) -> dict[str, Hypothesis]:
    """Every energy with the given effects, in an order of its own: which of them was asked about must not matter."""
    asked = question.hypothesis.material
    kinds: dict[str, type[Material]] = ordinary_materials() | {asked.name: asked}
    return {name: replace(question.hypothesis, material=kind) for name, kind in kinds.items()}


def _reaching(search: Search, hypothesis: Hypothesis, needed: bool) -> Candidate | None:
    """The fit of one energy; None if none of its films reaches the data, and it is not ``needed``."""
    try:
        starts = search.material_starts(hypothesis)
    except SettingsError:
        if needed:
            raise
        return None
    found = search.fit(hypothesis, starts)
    if found is None and needed:
        raise SettingsError(
            f"no {hypothesis.label()} film reaches the data", remedy="use a shorter range or another material"
        )
    return found


def _check_size(measurement: Measurement, question: Question) -> None:
    asked = question.hypothesis
    if not question.declared:
        asked = min(_every_energy(question).values(), key=lambda h: h.curve_size)
    enough_points(asked, measurement)
    least = fixed_by_data(asked) + SEARCH.spare_points
    if len(measurement) < least:
        what = f"{asked.label()} misses" if question.declared else "is missing"
        raise SettingsError(
            f"{len(measurement)} points leave too little to tell what {what}",
            remedy=f"use at least {least} points, or a material with fewer parameters",
        )
