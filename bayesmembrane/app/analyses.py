"""The verbs as library calls: each computes its result, says it as the JSON answer, and stores both.

``out`` is the folder of all answers; None stores nothing, unless runs are needed: then they are not kept either.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.app.answers import Answer, Asked, asked, kept
from bayesmembrane.app.documents import document
from bayesmembrane.calibration.beside_paper import BreakPoint
from bayesmembrane.calibration.fingerprint import fingerprint
from bayesmembrane.calibration.fit import Fit
from bayesmembrane.calibration.fit import fit as run_fit
from bayesmembrane.calibration.predictions import Wanted
from bayesmembrane.calibration.run import Run, predictions_of
from bayesmembrane.calibration.run import sample as run_sample
from bayesmembrane.calibration.sampling.walk import Callback
from bayesmembrane.comparison.compare import Range, compare_ranges
from bayesmembrane.comparison.jobs import Judging
from bayesmembrane.comparison.result import Comparison
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.published import read_published_table
from bayesmembrane.diagnosis.diagnose import diagnose as run_diagnose
from bayesmembrane.diagnosis.loop import Loop, LoopSettings, Watch
from bayesmembrane.diagnosis.loop import loop as run_loop
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.ground.jobs import Tell, silent
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.cache import CachedSolver
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.mechanics import api
from bayesmembrane.reconstruction.reconstruct import reconstruct as run_reconstruct
from bayesmembrane.reconstruction.result import Reconstruction
from bayesmembrane.valleys.beside import Beside, valleys_beside
from bayesmembrane.valleys.follow import RISE, valleys_of
from bayesmembrane.valleys.follow import valleys as run_valleys
from bayesmembrane.valleys.result import Valleys

Say = Callable[[str], None]
CURVES = "curves"  # the folder beside the runs in which the solver keeps what it has computed


def reconstruct(seed: int = 0, out: str | Path | None = None) -> Answer[Reconstruction]:
    """The measured curve behind the published losses of the paper."""
    found = run_reconstruct(read_published_table(), seed=seed)
    mark = fingerprint(run_reconstruct.__module__, (), (), {}, seed)
    what = Asked("reconstruct", "published losses", "", float("nan"), mark)
    return kept("reconstruction", found, document(found), what, out)


def fit(
    measurement: Measurement,
    claim: Hypothesis,
    *,
    loss: str = "euclidean",
    seed: int = 0,
    starts: Sequence[Sequence[float]] = (),
    out: str | Path | None = None,
) -> Answer[Fit]:
    """The least-squares optimum; ``starts`` are membrane parameters to search from as well."""
    found = run_fit(measurement, claim, loss=loss, seed=seed, starts=starts)
    settings = {"seed": seed, "loss": loss, "starts": [list(s) for s in starts]}
    what = asked("fit", run_fit, [measurement], [claim], settings)
    return kept("fit", found, document(found), what, out)


def sample(
    measurement: Measurement,
    claim: Hypothesis,
    *,
    ess: float = 1000.0,
    seed: int = 0,
    out: str | Path | None = None,
    name: str | None = None,
    whole: Measurement | None = None,
    breaks: Sequence[BreakPoint] = (),
    progress: Callback | None = None,
) -> Answer[Run]:
    """The posterior with its predictions, in a folder of its own.

    name : of the folder; made of specimen, hypothesis, range and fingerprint unless given
    whole : the measurement whose first part ``measurement`` is; the rest is predicted and shown beside the prediction
    breaks : break points of other films of the same silicone, predicted likewise
    """
    solve = api.solve if out is None else CachedSolver(Path(out) / CURVES)
    options: dict[str, Any] = {"seed": seed, "out": out, "name": name, "ess": ess, "progress": progress}
    run = run_sample(measurement, claim, solve=solve, predictions=False, **options)
    rest = _rest(measurement, whole)
    if run.path is not None and not run.interrupted:
        predictions_of(run, Wanted(rest=rest, breaks=tuple(breaks)) if breaks or rest is not None else None, solve)
    return Answer(run, {**document(run), "stored": None if run.path is None else str(run.path)})


def _rest(measurement: Measurement, whole: Measurement | None) -> Measurement | None:
    """The points of ``whole`` beyond the end of ``measurement``; None if there are none."""
    if whole is None or not whole.deflection.max() > measurement.deflection.max():
        return None
    return whole.select(whole.deflection > measurement.deflection.max())


def compare(
    ranges: Mapping[str, Range],
    claims: Sequence[Hypothesis],
    *,
    ess: float = 1000.0,
    seed: int = 0,
    out: str | Path | None = None,
    workers: int | None = None,
    progress: Tell = silent,
) -> Answer[dict[str, Comparison]]:
    """The evidence for each hypothesis on each range; the result is by the names of the ranges."""
    judging = Judging(seed, ess, out=out, processes=workers)
    found = compare_ranges(ranges, claims, judging, progress=progress)
    parts = [r.measurement for r in ranges.values()]
    wholes = [None if r.whole is None else r.whole.data_hash for r in ranges.values()]
    settings = {"seed": seed, "ess": ess, "names": list(ranges), "wholes": wholes}
    what = asked("compare", compare_ranges, parts, claims, settings)
    return kept("comparison", found, document(found), what, out)


def valleys(
    measurement: Measurement,
    claim: Hypothesis,
    *,
    ends: Sequence[float] = (),
    rise: float = RISE,
    seed: int = 0,
    out: str | Path | None = None,
) -> Answer[Valleys | Beside]:
    """The valleys of the loss over ranges that end at ``ends`` (m), with effects also those without."""
    how = valleys_beside if claim.effects else run_valleys
    found: Valleys | Beside = how(measurement, claim, ends, rise=rise, seed=seed)
    settings = {"seed": seed, "ends": list(ends), "rise": rise}
    what = asked("valleys", how, [measurement], [claim], settings)
    return kept("valleys", found, document(found), what, out)


def valleys_with_draws(
    measurements: Sequence[Measurement],
    claim: Hypothesis,
    draws: Sequence[Array],
    *,
    seed: int = 0,
    out: str | Path | None = None,
) -> Answer[Valleys]:
    """`valleys` over measurements of one film, with posterior draws (B, k) of each."""
    found = valleys_of(measurements, claim, seed=seed, draws=draws)
    what = asked("valleys", valleys_of, measurements, [claim], {"seed": seed, "draws": [_mark(d) for d in draws]})
    return kept("valleys", found, document(found), what, out)


def diagnose(
    measurement: Measurement,
    claim: Hypothesis,
    *,
    seed: int = 0,
    out: str | Path | None = None,
    tell: Say | None = None,
) -> Answer[Diagnosis]:
    """Whether the hypothesis misses something, and what."""
    found = run_diagnose(measurement, claim, seed=seed, tell=tell)
    what = asked("diagnose", run_diagnose, [measurement], [claim], {"seed": seed})
    return kept("diagnosis", found, document(found), what, out)


def loop(
    measurement: Measurement,
    claim: Hypothesis,
    *,
    ess: float = 1000.0,
    seed: int = 0,
    adapt_noise: bool = True,
    out: str | Path | None = None,
    runs: str | Path | None = None,
    tell: Say | None = None,
    watch: Watch | None = None,
) -> Answer[Loop]:
    """Diagnose, add what is missing, calibrate again; its runs lie beside it in ``out``, with their predictions."""
    settings = LoopSettings(seed, out, ess, adapt_noise)
    found = run_loop(measurement, claim, settings, tell=tell, watch=watch)
    what = asked("loop", run_loop, [measurement], [claim], {"seed": seed, "ess": ess, "adapt_noise": adapt_noise})
    return kept("loop", found, document(found), what, out)


def _mark(draws: Array) -> str:
    """What tells these draws from others."""
    return hashlib.sha256(np.ascontiguousarray(draws).tobytes()).hexdigest()


def loop_runs(found: Loop) -> list[Run]:
    """The posteriors on the way of a loop, each once."""
    every = [stage.run for r in found.rounds for stage in (r.before, r.after)]
    return list({id(run) if run.path is None else str(run.path): run for run in every}.values())
