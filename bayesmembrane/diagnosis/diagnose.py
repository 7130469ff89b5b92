"""What a curve says of the model it was given: adequate, or what is missing, or that this cannot be told."""

from __future__ import annotations

from dataclasses import replace

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.thinning import thinned
from bayesmembrane.diagnosis.candidates.candidate import absorbed
from bayesmembrane.diagnosis.candidates.sudden import SuddenChange, sudden_change
from bayesmembrane.diagnosis.detection.scores import confounded, smallest_sizes
from bayesmembrane.diagnosis.explanation.case import OpenCase, Tell, opened
from bayesmembrane.diagnosis.explanation.refits import left_by_form
from bayesmembrane.diagnosis.explanation.verdict import Verdict, adequate, explained
from bayesmembrane.diagnosis.left.heldout import HeldOut, misfit_of, validate
from bayesmembrane.diagnosis.left.shape import residual_shape
from bayesmembrane.diagnosis.result import Diagnosis, thinning
from bayesmembrane.diagnosis.separation import Experiment, experiments
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.mechanics import api


def diagnose(
    measurement: Measurement,
    hypothesis: Hypothesis,
    *,
    seed: int = 0,
    solve: Solve = api.solve,
    tell: Tell | None = None,
) -> Diagnosis:
    """Whether ``hypothesis`` leaves structure in the residual, and which effect, pair or other energy explains it.

    A measurement of more readings than `thinning.MOST` is thinned, and so is what the answer holds by reading. Raises
    `SettingsError` if there are too few points to tell a misfit from noise, or no film reaches the data.
    """
    part = thinned(measurement)
    found = _diagnosed(opened(part, hypothesis, seed, solve, tell or (lambda _: None)))
    return replace(found, thinned=thinning(measurement, part))


def _diagnosed(case: OpenCase) -> Diagnosis:
    if case.detection.adequate:
        return _concluded(case, adequate(case))
    form = left_by_form(case)
    if form is not None:
        return _concluded(case, adequate(case, form))
    return _concluded(*explained(case))


def _concluded(case: OpenCase, found: Verdict) -> Diagnosis:
    """The answer, with what was not needed to find it: power, errors on other points, what to measure next."""
    known = found.verdict in ("named", "ambiguous", "material")
    null, best = case.null, found.members[0].candidate if known else case.null
    sd = case.search.noise.each
    effects = [n for j in found.members for n in j.candidate.names] if known else []
    return Diagnosis(
        verdict=found.verdict,
        effects=tuple(dict.fromkeys(effects)),
        material=best.hypothesis.material.name if found.verdict == "material" else "",
        rig=case.measurement.rig,
        thickness=case.measurement.specimen.thickness,
        detection=case.detection,
        null=null,
        best=best,
        ranking=found.ranking,
        members=found.members,
        better=found.better,
        form=found.form,
        sudden=_sudden(case, found),
        confounded=confounded(case.signatures),
        noise=case.search.noise,
        power=smallest_sizes(case.signatures, case.detection.score.critical),
        absorbed=tuple(e.name for e in absorbed(case.measurement, null.hypothesis)),
        before=misfit_of(null.residual, sd, null.x.size),
        after=misfit_of(best.residual, sd, best.x.size),
        shape=residual_shape(case.measurement, null.residual),
        validation=_validated(case, found, known),
        experiments=_experiments(case, found),
    )


def _validated(case: OpenCase, found: Verdict, known: bool) -> HeldOut | None:
    case.tell("checking on points that were set aside")
    if not known:
        return validate(case.search, case.null, case.null, [])
    return validate(case.search, case.null, found.members[0].candidate, [j.candidate for j in found.ranking[:3]])


def _experiments(case: OpenCase, found: Verdict) -> tuple[Experiment, ...]:
    """What to measure next, where rivals are left."""
    if found.verdict != "ambiguous" or len(found.members) < 2:
        return ()
    rivals = [j.candidate for j in found.members]
    return tuple(experiments(case.measurement, rivals, case.search.noise.sd, case.search.solve))


def _sudden(case: OpenCase, found: Verdict) -> SuddenChange | None:
    """The sudden change that the verdict knows of, or that comes nearest where nothing explains the curve."""
    if found.sudden is not None or found.verdict != "unknown":
        return found.sudden
    nearest = sudden_change(case.search, case.null)
    return nearest if nearest is not None and nearest.gain > found.ranking[0].gain else None
