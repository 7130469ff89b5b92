"""The verbs as library calls: each computes its result, says it as the JSON answer, and stores both."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.app.answers import Answer, Asked, asked, held, in_pieces, kept
from bayesmembrane.app.documents import document
from bayesmembrane.calibration.beside_paper import BreakPoint
from bayesmembrane.calibration.fingerprint import fingerprint
from bayesmembrane.calibration.fit import Fit
from bayesmembrane.calibration.fit import fit as run_fit
from bayesmembrane.calibration.hierarchy.next_curve import population_of_runs
from bayesmembrane.calibration.hierarchy.population import Population
from bayesmembrane.calibration.joint.claim import Joint
from bayesmembrane.calibration.joint.fit import JointFit, fit_jointly
from bayesmembrane.calibration.joint.run import JointRun, sample_jointly
from bayesmembrane.calibration.predictions import Wanted, rest_of
from bayesmembrane.calibration.run import Run, RunSettings, predictions_of
from bayesmembrane.calibration.run import sample as run_sample
from bayesmembrane.calibration.sampling.walk import Progress, Settings
from bayesmembrane.comparison.compare import Range, compare_ranges
from bayesmembrane.comparison.jobs import Judging
from bayesmembrane.comparison.joint import compare_jointly
from bayesmembrane.comparison.result import Comparison
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.phases import phases_of
from bayesmembrane.data.published import read_published_table
from bayesmembrane.data.thinning import MOST, of_few
from bayesmembrane.diagnosis.diagnose import diagnose as run_diagnose
from bayesmembrane.diagnosis.explanation.case import Question
from bayesmembrane.diagnosis.joint.diagnose import JointDiagnosis, diagnose_jointly
from bayesmembrane.diagnosis.loop import Loop, LoopSettings
from bayesmembrane.diagnosis.loop import loop as run_loop
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.ground.interrupts import Stop, never
from bayesmembrane.ground.jobs import Submit, Tell, silent
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import components, ordinary_materials
from bayesmembrane.ground.stored import store
from bayesmembrane.physics.cache import CachedSolver
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.mechanics import api
from bayesmembrane.reconstruction.reconstruct import reconstruct as run_reconstruct
from bayesmembrane.reconstruction.result import Reconstruction
from bayesmembrane.valleys.beside import Beside, valleys_beside
from bayesmembrane.valleys.follow import RISE, valleys_of
from bayesmembrane.valleys.follow import valleys as run_valleys
from bayesmembrane.valleys.result import Valleys
from bayesmembrane.words.language import listed

CURVES = "curves"  # the folder beside the runs in which the solver keeps what it has computed
ADAPTING = LoopSettings(adapt_noise=True)


@dataclass(frozen=True)
class Work:
    """How a verb works.

    out : folder of all answers; None stores nothing
    ess : effective sample size of posteriors
    tell : is told (label, what is being done for it: a text, or the `Progress` of sampling)
    walk : how `sample` walks, instead of the usual way to ``ess``
    fork : folder of the run at whose end a new one begins
    stop : ends the walk of a run after its step, once true
    """

    seed: int = 0
    out: Path | None = None
    ess: float = 1000.0
    tell: Tell = silent
    walk: Settings | None = None
    fork: Path | None = None
    stop: Stop = never

    @property
    def solve(self) -> Solve:
        """The solver; with a folder one that remembers there what it has solved."""
        return api.solve if self.out is None else CachedSolver(self.out / CURVES)


def reconstruct(work: Work) -> Answer[Reconstruction]:
    """The measured curve behind the published losses of the paper."""
    mark = fingerprint(run_reconstruct.__module__, (), (), {}, work.seed)
    what = Asked("reconstruct", "published losses", "", float("nan"), mark)
    if (stored := held("reconstruction", what, work.out)) is not None:
        return stored
    found = run_reconstruct(read_published_table())
    return kept("reconstruction", found, document(found), what, work.out)


def fit(
    measurement: Measurement,
    claim: Hypothesis,
    work: Work,
    *,
    loss: str = "euclidean",
    starts: Sequence[Sequence[float]] = (),
) -> Answer[Fit]:
    """The least-squares optimum; ``starts`` are membrane parameters to search from as well."""
    found = run_fit(measurement, claim, loss=loss, seed=work.seed, starts=starts)
    settings = {"seed": work.seed, "loss": loss, "starts": [list(s) for s in starts]}
    what = asked("fit", run_fit, [measurement], [claim], settings)
    if work.out is not None:
        _keep_phases(measurement, work.out / what.name)
    return kept("fit", found, document(found), what, work.out)


def sample(
    measurement: Measurement,
    claim: Hypothesis,
    work: Work,
    *,
    name: str | None = None,
    whole: Measurement | None = None,
    breaks: Sequence[BreakPoint] = (),
) -> Answer[Run]:
    """The posterior with its predictions, in a folder of its own.

    name : of the folder; made of specimen, hypothesis, range and fingerprint unless given
    whole : the measurement whose first part ``measurement`` is; the rest is predicted and shown beside the prediction
    breaks : break points of other films of the same silicone, predicted likewise
    """

    def tell(progress: Progress) -> None:
        work.tell(claim.label(), progress)

    solve = work.solve
    how = RunSettings(work.seed, work.out, name, work.ess, settings=work.walk, predictions=False, fork=work.fork)
    run = run_sample(measurement, claim, how, progress=tell, solve=solve, stop=work.stop)
    rest = rest_of(measurement, whole)
    if run.path is not None:  # of an interrupted run, too: a report shows what there is, and solves nothing
        predictions_of(run, Wanted(rest=rest, breaks=tuple(breaks)) if breaks or rest is not None else None, solve)
        _keep_phases(measurement, run.path)
    return Answer(run, {**document(run), "stored": None if run.path is None else str(run.path)})


def _keep_phases(measurement: Measurement, folder: Path) -> None:
    """What was done to the film, beside the answer about it, if it was more than one pull."""
    found = phases_of(measurement)
    if found is not None:
        store(folder, "phases", found, {"phases": len(found.parts), "cycles": int(found.cycle.max())})


def compare(
    ranges: Mapping[str, Range],
    claims: Sequence[Hypothesis],
    work: Work,
    *,
    workers: int | None = None,
    submit: Submit | None = None,
) -> Answer[dict[str, Comparison]]:
    """The evidence for each hypothesis on each range; the result is by the names of the ranges.

    ``submit`` takes the jobs, if there are workers already.
    """
    parts = [r.measurement for r in ranges.values()]
    wholes = [None if r.whole is None else r.whole.data_hash for r in ranges.values()]
    settings = {"seed": work.seed, "ess": work.ess, "names": list(ranges), "wholes": wholes}
    what = asked("compare", compare_ranges, parts, claims, settings)
    if (stored := held("comparison", what, work.out)) is not None:
        return stored
    judging = Judging(work.seed, work.ess, out=work.out, processes=workers)
    found = compare_ranges(ranges, claims, judging, progress=work.tell, submit=submit)
    return kept("comparison", found, document(found), what, work.out)


def fit_joint(claim: Joint, work: Work) -> Answer[JointFit]:
    """Least squares on several tests of one material."""
    what = _asked_jointly("fit", fit_jointly, [claim], {"seed": work.seed})
    found = fit_jointly(claim, seed=work.seed)
    return kept("joint_fit", found, document(found), what, work.out)


def sample_joint(claim: Joint, work: Work) -> Answer[JointRun]:
    """The joint posterior, with that of every test and its predictions, in a folder of its own."""

    def tell(progress: Progress) -> None:
        work.tell(claim.label(), progress)

    how = RunSettings(work.seed, work.out, None, work.ess, settings=work.walk)
    run = sample_jointly(claim, how, progress=tell, solve=work.solve, stop=work.stop)
    return Answer(run, {**document(run), "stored": None if run.folder is None else str(run.folder)})


def compare_joint(claims: Sequence[Joint], work: Work) -> Answer[dict[str, Comparison]]:
    """The evidence for each energy on all tests together; the result is by the words for them."""
    settings = {"seed": work.seed, "ess": work.ess}
    what = _asked_jointly("compare", compare_jointly, claims, settings)
    if (stored := held("comparison", what, work.out)) is not None:
        return stored
    judged = compare_jointly(claims, Judging(work.seed, work.ess, out=work.out), progress=work.tell)
    found = {f"{listed(claims[0].labels)} together": judged}
    return kept("comparison", found, document(found), what, work.out)


def population(runs: Sequence[Run], work: Work, *, pool: Sequence[str] = ()) -> Answer[Population]:
    """The population behind the specimens of several runs; raises what `population_of_runs` raises."""
    found = population_of_runs(runs, pool, work.seed)
    settings = {"seed": work.seed, "pool": list(pool), "draws": [run.draws_name for run in runs]}
    by, tests = population_of_runs, [r.measurement for r in runs]
    what = asked("population", by, tests, [r.hypothesis for r in runs], settings)
    model = runs[0].hypothesis.label()
    named = replace(what, specimen="-".join(found.specimens.labels), model=model, end=float("nan"))
    return kept("population", found, document(found), named, work.out)


def _asked_jointly(
    verb: str,
    by: Callable[..., Any],
    claims: Sequence[Joint],
    settings: Mapping[str, Any],
    also: Sequence[type[Any]] = (),
) -> Asked:
    """As `asked`, about tests: the folder is called after them."""
    parts = [part for claim in claims for part in claim.parts]
    labels = {"labels": [list(claim.labels) for claim in claims]}
    measurements, hypotheses = [p.measurement for p in parts], [p.hypothesis for p in parts]
    what = asked(verb, by, measurements, hypotheses, {**settings, **labels}, list(also))
    model = "-".join(claim.label() for claim in claims)
    return replace(what, specimen="-".join(claims[0].labels), model=model, end=float("nan"))


def valleys(
    measurement: Measurement, claim: Hypothesis, work: Work, *, ends: Sequence[float] = (), rise: float = RISE
) -> Answer[Valleys | Beside]:
    """The valleys of the loss over ranges that end at ``ends`` (m), with effects also those without.

    Of more than `thinning.MOST` readings so many are used: a valley is mapped by thousands of films.
    """
    measurement = of_few(measurement, MOST)
    how = valleys_beside if claim.with_frame(measurement).in_question else run_valleys
    settings = {"seed": work.seed, "ends": list(ends), "rise": rise}
    what = asked("valleys", how, [measurement], [claim], settings)
    if (stored := held("valleys", what, work.out)) is not None:
        return stored
    with in_pieces(what, work.out):
        found: Valleys | Beside = how(measurement, claim, ends, rise=rise, seed=work.seed)
    return kept("valleys", found, document(found), what, work.out)


def valleys_with_draws(
    measurements: Sequence[Measurement], claim: Hypothesis, work: Work, draws: Sequence[Array]
) -> Answer[Valleys]:
    """`valleys` over measurements of one film, with posterior draws (B, k) of each."""
    settings = {"seed": work.seed, "draws": [_mark(d) for d in draws]}
    what = asked("valleys", valleys_of, measurements, [claim], settings)
    if (stored := held("valleys", what, work.out)) is not None:
        return stored
    with in_pieces(what, work.out):
        found = valleys_of(measurements, claim, seed=work.seed, draws=draws)
    return kept("valleys", found, document(found), what, work.out)


def diagnose(measurement: Measurement, claim: Hypothesis | Question, work: Work) -> Answer[Diagnosis]:
    """Whether the hypothesis misses something, and what; a `Question` may leave the energy open."""
    question = claim if isinstance(claim, Question) else Question(claim)
    label = question.label
    settings = {"seed": work.seed, "declared": question.declared, "quick": question.quick}
    what = asked("diagnose", run_diagnose, [measurement], [question.hypothesis], settings, library())
    if (stored := held("diagnosis", what, work.out)) is not None:
        return stored
    found = run_diagnose(measurement, question, seed=work.seed, tell=lambda text: work.tell(label, text))
    return kept("diagnosis", found, document(found), what, work.out)


def diagnose_joint(claim: Joint, work: Work, *, declared: bool = True, quick: bool = False) -> Answer[JointDiagnosis]:
    """Whether one energy describes several tests, and what is missing in which of them if not."""
    settings = {"seed": work.seed, "declared": declared, "quick": quick}
    what = _asked_jointly("diagnose", diagnose_jointly, [claim], settings, library())
    if (stored := held("joint_diagnosis", what, work.out)) is not None:
        return stored
    label = claim.label()
    found = diagnose_jointly(
        claim, declared=declared, quick=quick, seed=work.seed, tell=lambda text: work.tell(label, text)
    )
    return kept("joint_diagnosis", found, document(found), what, work.out)


def loop(
    measurement: Measurement, claim: Hypothesis | Question, work: Work, how: LoopSettings = ADAPTING
) -> Answer[Loop]:
    """Diagnose, add what is missing, calibrate again; its runs lie where ``how`` says, or where the answers do.

    ``how`` has what ``work`` does not say: seed and ESS are those of ``work``.
    """
    how = replace(how, seed=work.seed, ess=work.ess, out=how.out or work.out)
    question = claim if isinstance(claim, Question) else Question(claim)
    label = question.label
    settings: dict[str, Any] = {"seed": work.seed, "ess": work.ess, "adapt_noise": how.adapt_noise}
    settings["declared"] = question.declared
    if how.leaders:
        settings["rivals"] = how.leaders
    if how.predict:
        settings |= {"predict": [other.data_hash for other in how.predict], "scatter": how.scatter}
    what = asked("loop", run_loop, [measurement], [question.hypothesis], settings, library())
    if (stored := held("loop", what, work.out)) is not None:
        return stored
    with in_pieces(what, work.out):
        found = run_loop(measurement, question, how, tell=lambda text: work.tell(label, text))
    return kept("loop", found, document(found), what, work.out)


def library() -> list[type[Any]]:
    """Every effect and every material: what a search for something missing may try, and thus depends on."""
    return [*components("effects").values(), *ordinary_materials().values()]


def _mark(draws: Array) -> str:
    """What tells these draws from others."""
    return hashlib.sha256(np.ascontiguousarray(draws).tobytes()).hexdigest()


def loop_runs(found: Loop) -> list[Run]:
    """The posteriors on the way of a loop, each once."""
    every = [stage.run for r in found.rounds for stage in (r.before, r.after)]
    return list({id(run) if run.path is None else str(run.path): run for run in every}.values())
