"""What several tests of one material say together of the model that they were given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from bayesmembrane.calibration.joint.claim import Joint
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.thinning import thinned
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.detection.detect import Detection
from bayesmembrane.diagnosis.detection.scores import confounded
from bayesmembrane.diagnosis.explanation.case import Question, Tell, opened
from bayesmembrane.diagnosis.explanation.foreign import Foreign
from bayesmembrane.diagnosis.explanation.telling import NOTHING
from bayesmembrane.diagnosis.explanation.total import Judged, Probabilities
from bayesmembrane.diagnosis.explanation.verdict import Verdict, adequate, explained, undoubted
from bayesmembrane.diagnosis.joint.case import JointCase, opened_jointly
from bayesmembrane.diagnosis.joint.search import JointSearch
from bayesmembrane.diagnosis.left.heldout import Misfit, misfit_of
from bayesmembrane.diagnosis.left.remaining import Remaining, remaining
from bayesmembrane.diagnosis.reference.outliers import SetAside, without_outliers
from bayesmembrane.diagnosis.result import Thinned, thinning
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.showable import Showable
from bayesmembrane.ground.threads import one_thread
from bayesmembrane.physics.effects.base import AT
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.mechanics import api


@dataclass(frozen=True)
class JointMember:
    """A hypothesis about all tests.

    name : its effects joined by "+", those of one test as ``zero_offset@strip``; "none" without any
    material : the energy
    probability, gain, unexplained, reduced_chi2 : as `Judged` has them
    tests : what it claims of each test
    parameters : of the effects, by full name, SI
    energy_error, law_errors : relative errors of the forms
    at_bound : coordinates at a bound
    """

    name: str
    material: str
    probability: float
    gain: float
    unexplained: float
    reduced_chi2: float
    tests: tuple[Hypothesis, ...]
    parameters: Mapping[str, float]
    energy_error: float
    law_errors: Mapping[str, float]
    at_bound: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class DiagnosedTest:
    """One of the tests.

    label : which
    measurement : its readings that were diagnosed
    before, after : misfit of the model as given, and of the most probable one, fitted to all tests
    residual_before, residual_after : (N,) N
    noise_sd, stated : N; whether the measurement states it
    thinned, set_aside : what was left out
    """

    label: str
    measurement: Measurement
    before: Misfit
    after: Misfit
    residual_before: Array
    residual_after: Array
    noise_sd: float
    stated: bool
    thinned: Thinned | None
    set_aside: SetAside | None


@dataclass(frozen=True, eq=False, repr=False)
class JointDiagnosis(Showable):
    """The answer.

    verdict, effects, material, declared, probabilities, remaining : as `Diagnosis` has them, of all tests together
    detection : tests of the model as given, fitted to all tests
    null : the energy that was given, or the most probable one
    ranking : every hypothesis that was fitted, the most probable first
    members : those that the verdict rests on
    foreign : the most probable thing that is foreign, in the test of its label; None for nothing
    tests : one by one
    confounded : (effect, effect, degrees) that these tests cannot separate
    before, after : misfit of all readings
    """

    verdict: str
    effects: tuple[str, ...]
    material: str
    declared: bool
    probabilities: Probabilities
    remaining: Remaining
    detection: Detection
    null: str
    given: tuple[str, ...]
    ranking: tuple[JointMember, ...]
    members: tuple[JointMember, ...]
    foreign: Foreign | None
    tests: tuple[DiagnosedTest, ...]
    confounded: tuple[tuple[str, str, float], ...]
    before: Misfit
    after: Misfit

    @property
    def labels(self) -> tuple[str, ...]:
        """What the tests are called."""
        return tuple(t.label for t in self.tests)


@one_thread
def diagnose_jointly(
    joint: Joint,
    *,
    declared: bool = True,
    quick: bool = False,
    seed: int = 0,
    solve: Solve = api.solve,
    tell: Tell | None = None,
) -> JointDiagnosis:
    """Whether one energy and the given effects describe all tests, and how probable each explanation is if not.

    The tests share the energy. An effect of the material is at work in all tests that can show it, or in none, each
    time of its own size; one of a rig in a single test. What no test shows alone, several may show: that they need
    different films. Raises `SettingsError` if a test has too few points, or no film reaches the ends of all.
    """
    say = tell or (lambda _: None)
    alone, kept = [], []
    for part in joint.parts:
        short = thinned(part.measurement)
        used, aside = without_outliers(short)
        kept.append((thinning(part.measurement, short), aside))
        say(f"looking at {part.label}")
        alone.append(opened(used, Question(part.hypothesis, declared, quick), seed, solve, say))
    question = Question(replace(joint.parts[0].hypothesis, effects=()), declared, quick)
    case = opened_jointly(alone, joint.labels, question, say)
    search, found = _decided(case)
    return _concluded(case, search, found, kept)


def _decided(case: JointCase) -> tuple[JointSearch, Verdict]:
    if case.sees_nothing:
        found = adequate(case)
        if undoubted(found.probabilities):
            return case.search, found
    search, found = explained(case)
    assert isinstance(search, JointSearch)
    return search, found


def _concluded(
    case: JointCase,
    search: JointSearch,
    found: Verdict,
    kept: Sequence[tuple[Thinned | None, SetAside | None]],
) -> JointDiagnosis:
    null = next((j.candidate for j in found.ranking if j.candidate.label == case.null.label), case.null)
    first = found.members[0].candidate if found.members else found.ranking[0].candidate if found.ranking else null
    left = remaining(search, first, null)
    verdict = "unknown" if found.verdict == "named" and left.strange else found.verdict
    known = verdict in ("named", "ambiguous", "material")
    best = found.members[0].candidate if known else null
    given = set(null.names)
    effects = [n for j in found.members for n in sorted(set(j.candidate.names) - given)] if known else []
    return JointDiagnosis(
        verdict=verdict,
        effects=tuple(dict.fromkeys(effects)),
        material=best.hypothesis.material.name if verdict == "material" else "",
        declared=case.question.declared,
        probabilities=found.probabilities,
        remaining=left,
        detection=case.detection,
        null=null.hypothesis.material.name,
        given=tuple(sorted(given)),
        ranking=tuple(_member(case, search, j, given) for j in found.ranking),
        members=tuple(_member(case, search, j, given) for j in found.members),
        foreign=found.foreign,
        tests=tuple(_test(case, search, (null, best), i, k) for i, k in enumerate(kept)),
        confounded=confounded(case.signatures),
        before=_misfit(search, null),
        after=_misfit(search, best),
    )


def _misfit(search: JointSearch, c: Candidate) -> Misfit:
    residual = search.adapted(c)
    return misfit_of(residual, search.noise.each, c.x.size, search.noise.white(residual))


def _member(case: JointCase, search: JointSearch, j: Judged, given: set[str]) -> JointMember:
    c = j.candidate
    return JointMember(
        "+".join(sorted(set(c.names) - given)) or NOTHING,
        c.hypothesis.material.name,
        j.probability,
        j.gain,
        j.unexplained,
        j.reduced_chi2,
        tuple(search.of(c.hypothesis, i) for i in range(len(search.parts))),
        {_full(name, case.labels): v for name, v in c.parameters.items()},
        c.energy_error,
        c.law_errors,
        c.at_bound,
    )


def _full(name: str, labels: Sequence[str]) -> str:
    """``mullins@strip.softening`` of ``mullins.0.softening``; of one in a single test its own name."""
    effect, _, rest = name.partition(".")
    number, _, parameter = rest.partition(".")
    return f"{effect}{AT}{labels[int(number)]}.{parameter}" if parameter else name


def _test(
    case: JointCase,
    search: JointSearch,
    models: tuple[Candidate, Candidate],
    number: int,
    kept: tuple[Thinned | None, SetAside | None],
) -> DiagnosedTest:
    part, rows = search.parts[number], search.rows[number]
    misfits, residuals = [], []
    for c in models:
        residual = search.adapted(c)[rows]
        k = len(search.places(c.hypothesis, number))
        misfits.append(misfit_of(residual, part.noise.each, k, part.noise.white(residual)))
        residuals.append(residual)
    return DiagnosedTest(
        case.labels[number],
        part.measurement,
        misfits[0],
        misfits[1],
        residuals[0],
        residuals[1],
        part.noise.sd,
        part.noise.stated,
        *kept,
    )
