"""What a curve says of the model it was given: adequate, or what is missing, or that this cannot be told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.thinning import thinned
from bayesmembrane.diagnosis.candidates.candidate import Candidate, absorbed, unsought
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.detection.scores import confounded, smallest_sizes
from bayesmembrane.diagnosis.explanation.case import OpenCase, Question, Tell, opened
from bayesmembrane.diagnosis.explanation.total import Judged, set_name
from bayesmembrane.diagnosis.explanation.verdict import Verdict, adequate, explained, undoubted
from bayesmembrane.diagnosis.left.heldout import HeldOut, misfit_of, validate
from bayesmembrane.diagnosis.left.remaining import Remaining, remaining
from bayesmembrane.diagnosis.left.shape import residual_shape
from bayesmembrane.diagnosis.left.turning import at_a_turn
from bayesmembrane.diagnosis.reference.outliers import without_outliers
from bayesmembrane.diagnosis.result import Diagnosis, thinning
from bayesmembrane.diagnosis.separation import Experiment, experiments
from bayesmembrane.diagnosis.thresholds import VERDICT
from bayesmembrane.ground.threads import one_thread
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.mechanics import api


@one_thread
def diagnose(
    measurement: Measurement,
    hypothesis: Hypothesis | Question,
    *,
    seed: int = 0,
    solve: Solve = api.solve,
    tell: Tell | None = None,
) -> Diagnosis:
    """Whether ``hypothesis`` leaves structure in the residual, and how probable each explanation of it is.

    A `Question` says whether the energy was declared at all, and whether pairs of effects are to be looked at.
    A measurement of more readings than `thinning.MOST` is thinned, single outliers are set aside, and what the answer
    holds by reading is of those that are left. Raises `SettingsError` if there are too few points to tell a misfit
    from noise, or no film reaches the data.
    """
    question = hypothesis if isinstance(hypothesis, Question) else Question(hypothesis)
    part = thinned(measurement)
    kept, aside = without_outliers(part)
    found = _diagnosed(opened(kept, question, seed, solve, tell or (lambda _: None)))
    return replace(found, thinned=thinning(measurement, part), set_aside=aside)


def _diagnosed(case: OpenCase) -> Diagnosis:
    if case.sees_nothing:
        found = adequate(case)
        if undoubted(found.probabilities):
            return _concluded(case, case.search, found)
    search, found = explained(case)
    assert isinstance(search, Search)
    return _concluded(case, search, found)


def _concluded(case: OpenCase, search: Search, found: Verdict) -> Diagnosis:
    """The answer, with what was not needed to find it: power, errors on other points, what to measure next."""
    case.tell("checking on points that were set aside")
    validation = _validated(case, search, found)
    found, null = _predicting(found, validation), _null(case, found)
    answer = found.members[0].candidate if found.members else _nearest(found, null)
    left = remaining(search, answer, null)
    firm = _firm(search, found, left)
    found = _finished(search, found, left)
    known = found.verdict in ("named", "ambiguous", "material")
    found = replace(found, members=_adapted(search, found.members), ranking=_adapted(search, found.ranking))
    null = _null(case, found)
    best = found.members[0].candidate if known else null
    sd = search.noise.each
    given = set(null.names)
    effects = [n for j in found.members for n in sorted(set(j.candidate.names) - given)] if known else []
    return Diagnosis(
        verdict=found.verdict,
        effects=tuple(dict.fromkeys(effects)),
        material=best.hypothesis.material.name if found.verdict == "material" else "",
        declared=case.question.declared,
        probabilities=found.probabilities,
        remaining=left,
        rig=case.measurement.rig,
        thickness=case.measurement.specimen.thickness,
        measurement=case.measurement,
        detection=case.detection,
        null=null,
        best=best,
        ranking=found.ranking,
        members=found.members,
        foreign=found.foreign,
        confounded=confounded(case.signatures),
        noise=search.noise,
        power=smallest_sizes(case.signatures, case.detection.score.critical),
        absorbed=tuple(e.name for e in absorbed(case.measurement, null.hypothesis)),
        before=misfit_of(null.residual, sd, null.x.size, search.noise.white(null.residual)),
        after=misfit_of(best.residual, sd, best.x.size, search.noise.white(best.residual)),
        shape=residual_shape(case.measurement, null.residual),
        validation=validation,
        experiments=_experiments(search, found, null),
        unsought=tuple(e.name for e in unsought(case.measurement, null.hypothesis)),
        firm=firm,
    )


def _adapted(search: Search, every: Sequence[Judged]) -> tuple[Judged, ...]:
    """The same with the residuals of their best fits, which is what people call a residual."""
    return tuple(replace(j, candidate=replace(j.candidate, residual=search.adapted(j.candidate))) for j in every)


def _null(case: OpenCase, found: Verdict) -> Candidate:
    """The model as given, as the last noise weighs it."""
    same = [j.candidate for j in found.ranking if j.candidate.label == case.null.label]
    return same[0] if same else case.null


def _nearest(found: Verdict, null: Candidate) -> Candidate:
    """The most probable hypothesis, where none is given as the answer."""
    return found.ranking[0].candidate if found.verdict == "unknown" and found.ranking else null


def _predicting(found: Verdict, validation: HeldOut | None) -> Verdict:
    """A model that does not predict the points that were set aside explains nothing, and is not named."""
    if found.verdict not in ("named", "material", "ambiguous") or validation is None:
        return found
    if validation.covered_after >= VERDICT.least_coverage:
        return found
    return replace(found, verdict="unknown", rivals=())


def _firm(search: Search, found: Verdict, left: Remaining) -> tuple[str, ...]:
    """Effects that are together in all that is probable, and of which each explains more than what is ``left``."""
    if found.verdict not in ("named", "ambiguous"):
        return ()
    if at_a_turn(found.members[0].candidate, search.measurement) is not None:
        return ()
    p = found.probabilities
    names = sorted(left.firm(p.nearly_certain()), key=p.of_effect, reverse=True)
    while names and p.of_effect(*names) < VERDICT.nearly_certain:
        names.pop()
    return tuple(sorted(names))


def _finished(search: Search, found: Verdict, left: Remaining) -> Verdict:
    """An effect that leaves structure, which no small error of the forms carries, is not the whole of it: no name. Nor
    has one that comes where the test turns, beside a law of loops, or at its last turn, whatever is beside it.
    """
    if found.verdict != "named":
        return found
    doubtful = left.strange or at_a_turn(found.members[0].candidate, search.measurement) is not None
    return replace(found, verdict="unknown") if doubtful else found


def _validated(case: OpenCase, search: Search, found: Verdict) -> HeldOut | None:
    null = _null(case, found)
    if found.verdict not in ("named", "ambiguous", "material"):
        return validate(search, null, null, [])
    nulls = [j for j in found.ranking[3:] if j.candidate.label == null.label]
    rivals = [(j.candidate, j.believed) for j in (*found.ranking[:3], *nulls)]
    return validate(search, null, found.members[0].candidate, rivals)


def _experiments(search: Search, found: Verdict, null: Candidate) -> tuple[Experiment, ...]:
    """What to measure next, where rivals are left."""
    if found.verdict not in ("ambiguous", "unknown") or len(found.rivals) < 2:
        return ()
    given, p = null.names, found.probabilities
    return tuple(experiments(search, [(j.candidate, p.effects[set_name(j.candidate, given)]) for j in found.rivals]))
