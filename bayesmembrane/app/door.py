"""What ``import bayesmembrane as bm`` offers: the verbs as functions from values to values.

Every verb takes ``out``, a folder of answers: there the result is stored whole, to be read by `load` and `report`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, cast, overload

from bayesmembrane.app import analyses, documents
from bayesmembrane.app.folders import lying
from bayesmembrane.calibration.fit import Fit
from bayesmembrane.calibration.hierarchy.population import Population
from bayesmembrane.calibration.joint.claim import Joint
from bayesmembrane.calibration.joint.claim import joint as joint_of
from bayesmembrane.calibration.joint.fit import JointFit
from bayesmembrane.calibration.joint.run import JointRun
from bayesmembrane.calibration.run import Run, predictions_of
from bayesmembrane.comparison.compare import Range
from bayesmembrane.comparison.result import Comparison
from bayesmembrane.data.exports.hints import hints_of
from bayesmembrane.data.importers.base import read_export
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.sequence import read_one_after_another
from bayesmembrane.diagnosis.explanation.case import Question
from bayesmembrane.diagnosis.joint.diagnose import JointDiagnosis
from bayesmembrane.diagnosis.loop import Loop, LoopSettings
from bayesmembrane.diagnosis.other_tests import OtherTest, predicted
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.registry import ordinary_materials
from bayesmembrane.ground.threads import one_thread
from bayesmembrane.physics import hypothesis as hypotheses
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.reconstruction.result import Reconstruction
from bayesmembrane.report.page import write_report
from bayesmembrane.report.runs import read as read_run
from bayesmembrane.valleys.beside import Beside
from bayesmembrane.valleys.result import Valleys

Folder = str | Path
Tests = Mapping[str, Measurement] | Sequence[Measurement]
Claim = Hypothesis | str
"""A hypothesis, or the name of an energy without effects, with white noise."""
Claims = Claim | Mapping[str, Hypothesis]


def read(curve: Folder, specimen: Folder, then: Sequence[Folder] = (), rest_s: float = 0.0) -> Measurement:
    """The measured curve (CSV) of a specimen (TOML), in SI; raises `DataError` that says what is wrong where.

    ``then``: further tests of the same film, not taken out in between, each after ``rest_s`` s of rest.
    """
    return read_one_after_another([curve, *then], specimen, rest_s)


def read_measurement(export: Folder, specimen: Folder | None = None, **said: Any) -> Measurement:
    """The measurement in a testing machine's export, in SI, as the verb ``import`` reads it; nothing is written.

    ``specimen`` is a TOML with film and rig, if there is one; ``said`` are the options of ``import`` with underscores:
    ``rig="uniaxial", thickness_um=500, gauge_length_mm=50, columns="time_s,travel_mm,force_N"``. What was guessed, and
    what the export contradicts, stands in ``.provenance.notes``. Raises `DataError` for what cannot be read with
    confidence, `SettingsError` for options that there are not, and where film or rig are not known.
    """
    return read_export(export, hints_of(said), specimen)


def hypothesis(
    material: str, effects: Iterable[str] = (), noise: str = "white", convexity: str = "reached"
) -> Hypothesis:
    """y = F(delta; material, effects) + noise, by names; raises `SettingsError` for one that nobody declared.

    ``effects`` may also be one text, with commas: "zero_offset,prestretch".
    """
    names = effects.split(",") if isinstance(effects, str) else effects
    return hypotheses.hypothesis(material, [n.strip() for n in names if n.strip()], noise, convexity)


def joint(measurements: Mapping[str, Measurement] | Sequence[Measurement], hypothesis: Claims) -> Joint:
    """Several tests of one material for `fit`, `sample` and `compare`, by label or in an order.

    ``hypothesis`` is claimed of all of them, or is one for each label: effects and noise may differ, the energy may
    not. Raises `SettingsError` where they do not go together.
    """
    return joint_of(measurements, _named(hypothesis))


@overload
def fit(
    measurement: Measurement, hypothesis: Claim, *, loss: str = ..., seed: int = ..., out: Folder | None = ...
) -> Fit: ...


@overload
def fit(measurement: Tests, hypothesis: Claims, *, seed: int = ..., out: Folder | None = ...) -> JointFit: ...


@one_thread
def fit(
    measurement: Measurement | Tests,
    hypothesis: Claims,
    *,
    loss: str = "euclidean",
    seed: int = 0,
    out: Folder | None = None,
) -> Fit | JointFit:
    """The global minimum of |F(x) - y| ("euclidean", N) or of the same in standard deviations of the noise
    ("weighted"), with standard errors, with and without the convexity prior.

    Of several measurements (a list, or a dict by label) of one material the joint minimum, each test weighed by the
    noise that it states, or else by its own residual; ``loss`` plays no part.
    """
    if not isinstance(measurement, Measurement):
        return analyses.fit_joint(joint_of(measurement, _named(hypothesis)), _work(seed, out)).result
    hypothesis = _single(hypothesis)
    return analyses.fit(measurement, hypothesis, _work(seed, out), loss=loss).result


@overload
def sample(
    measurement: Measurement,
    hypothesis: Claim,
    *,
    ess: float = ...,
    seed: int = ...,
    out: Folder | None = ...,
    whole: Measurement | None = ...,
) -> Run: ...


@overload
def sample(
    measurement: Tests, hypothesis: Claims, *, ess: float = ..., seed: int = ..., out: Folder | None = ...
) -> JointRun: ...


@one_thread
def sample(
    measurement: Measurement | Tests,
    hypothesis: Claims,
    *,
    ess: float = 1000.0,
    seed: int = 0,
    out: Folder | None = None,
    whole: Measurement | None = None,
) -> Run | JointRun:
    """Draws of p(parameters | measurement) worth ``ess`` independent ones; ``.data`` is an arviz InferenceData.

    With ``out`` the run is stored, and read back or continued if it is there; ``whole`` is the measurement whose first
    part ``measurement`` is, so that the rest is shown beside its prediction.

    Of several measurements (a list, or a dict by label) of one material the joint posterior: the energy is shared,
    each test has its own effects and noise; ``whole`` plays no part.
    """
    if not isinstance(measurement, Measurement):
        return analyses.sample_joint(joint_of(measurement, _named(hypothesis)), _work(seed, out, ess)).result
    hypothesis = _single(hypothesis)
    return analyses.sample(measurement, hypothesis, _work(seed, out, ess), whole=whole).result


@one_thread
def compare(
    measurement: Measurement | Tests,
    hypotheses: Sequence[Claim],
    *,
    ess: float = 1000.0,
    seed: int = 0,
    out: Folder | None = None,
    workers: int | None = 1,
) -> Comparison:
    """ln Z of every hypothesis by two estimators, leave-one-out beside it, and their ranking if the estimators agree.

    ``workers`` processes share the work (None: one for each core; scripts then need ``if __name__ == "__main__"``).
    Of several measurements of one material the joint evidence, hypothesis after hypothesis.
    """
    if not isinstance(measurement, Measurement):
        claims = [joint_of(measurement, _named(h)) for h in hypotheses]
        (both,) = analyses.compare_joint(claims, _work(seed, out, ess)).result.values()
        return both
    ranges = {f"up to {1e3 * float(measurement.deflection.max()):.4g} mm": Range(measurement)}
    (found,) = analyses.compare(
        ranges, [_single(h) for h in hypotheses], _work(seed, out, ess), workers=workers
    ).result.values()
    return found


@one_thread
def population(
    runs: Sequence[Run], *, pool: Sequence[str] = (), seed: int = 0, out: Folder | None = None
) -> Population:
    """Mean and scatter of the specimens behind ``runs`` of `sample`, one run each, and what the next one will be.

    ``pool`` are coordinates: ``ln_modulus`` and the others of the material unless given; of effects by full names, as
    ``thickness.error``. What is alike is drawn together, what differs is not (partial pooling).
    """
    several: list[object] = [runs] if isinstance(runs, Run) else list(runs)
    if odd := [r for r in several if not isinstance(r, Run)]:
        raise SettingsError(f"{odd[0]!r:.40} is no run", remedy="give what sample returns, or load its folder")
    return analyses.population(cast("list[Run]", several), _work(seed, out), pool=pool).result


@one_thread
def valleys(
    measurement: Measurement,
    hypothesis: Claim,
    ranges_mm: Sequence[float] = (),
    *,
    loss_rise: float = 0.1,
    seed: int = 0,
    out: Folder | None = None,
) -> Valleys | Beside:
    """What fits within the part ``loss_rise`` of the least loss, on the ranges that end at ``ranges_mm``.

    With effects also what it is without them (`Beside`).
    """
    ends = [1e-3 * end for end in ranges_mm]
    return analyses.valleys(measurement, _single(hypothesis), _work(seed, out), ends=ends, rise=loss_rise).result


@overload
def diagnose(
    measurement: Measurement, hypothesis: Claim | None = ..., *, seed: int = ..., out: Folder | None = ...
) -> Diagnosis: ...


@overload
def diagnose(
    measurement: Tests, hypothesis: Claims | None = ..., *, seed: int = ..., out: Folder | None = ...
) -> JointDiagnosis: ...


def diagnose(
    measurement: Measurement | Tests,
    hypothesis: Claims | None = None,
    *,
    seed: int = 0,
    out: Folder | None = None,
) -> Diagnosis | JointDiagnosis:
    """How probable it is that nothing, an effect, another energy or something foreign is behind the curve.

    ``hypothesis`` has the energy that is preferred beforehand; without one all are as probable. Several measurements
    (a list, or a dict by label) of one material share the energy: what is missing then has a test where it is missing.
    """
    if not isinstance(measurement, Measurement):
        claim = _asked(None).hypothesis if hypothesis is None else hypothesis
        both = joint_of(measurement, _named(claim))
        return analyses.diagnose_joint(both, _work(seed, out), declared=hypothesis is not None).result
    hypothesis = None if hypothesis is None else _single(hypothesis)
    return analyses.diagnose(measurement, _asked(hypothesis), _work(seed, out)).result


@one_thread
def loop(
    measurement: Measurement,
    hypothesis: Claim | None = None,
    *,
    ess: float = 1000.0,
    seed: int = 0,
    adapt_noise: bool = True,
    out: Folder | None = None,
) -> Loop:
    """Diagnose, sample, add what is missing, and again, until adequate or abstaining.

    Without a ``hypothesis`` it begins with the most probable energy. ``adapt_noise`` samples with correlated noise
    where neighbouring readings turn out to be correlated. Of an ambiguous answer nothing more is sampled: its members
    are hypotheses that `sample` takes.
    """
    how = LoopSettings(adapt_noise=adapt_noise)
    return analyses.loop(
        measurement, _asked(None if hypothesis is None else _single(hypothesis)), _work(seed, out, ess), how
    ).result


@one_thread
def predict(
    found: Diagnosis | Loop, other: Measurement | Sequence[Measurement], *, scatter: float = 0.0, seed: int = 0
) -> list[OtherTest]:
    """What all that a diagnosis, or the first of a loop, holds probable predicts of other tests of the same material.

    ``scatter`` : relative standard deviation by which forces of two specimens differ. Each has the curves before and
    after (N), the ends of the 90 % band, and which part of the readings it holds.
    """
    first = found.rounds[0].diagnosis if isinstance(found, Loop) else found
    others = [other] if isinstance(other, Measurement) else other
    return [predicted(first, o, scatter, seed) for o in others]


def _asked(hypothesis: Hypothesis | None) -> Question:
    """The question of a diagnosis, about an energy that is preferred or about none."""
    if hypothesis is not None:
        return Question(hypothesis)
    return Question(hypotheses.hypothesis(min(ordinary_materials())), declared=False)


@one_thread
def reconstruct(*, seed: int = 0, out: Folder | None = None) -> Reconstruction:
    """The measured curve behind the losses that the paper prints, with its covariance."""
    return analyses.reconstruct(_work(seed, out)).result


def report(*shown: Any, out: Folder, title: str | None = None) -> Path:
    """Write ``out/index.html`` about results, and about all that lies in folders, and return its path.

    A stored answer that cannot be read is left out with a warning. Raises `SettingsError` if there is nothing to show,
    `StorageError` for a folder that holds nothing.
    """
    every = [one for result in shown for one in _with_parts(result)]
    return write_report([_predicted(result) for result in every], Path(out), title)


def load(folder: Folder) -> Any:
    """The result stored in ``folder``: a `Run`, a `Fit`, a `Diagnosis`, ...; of several, a dict by folder and kind.

    Raises `StorageError` if there is none, or one is damaged.
    """
    found = lying([Path(folder)])
    return found[0].read() if len(found) == 1 else {(each.folder.name, each.kind): each.read() for each in found}


def as_dict(result: Any) -> dict[str, Any]:
    """A result as plain values, the ones that ``--json`` prints: for JSON, pandas or a notebook of one's own."""
    return documents.document(result)


def _with_parts(result: Any) -> list[Any]:
    """A joint run and those of its tests; any other result as it is."""
    return [result, *result.parts] if isinstance(result, JointRun) else [result]


def _predicted(result: Any) -> Any:
    """A run with its predictions, which are made here where none are stored; any other result as it is."""
    return read_run(result, predictions_of(result)) if isinstance(result, Run) else result


def _named(claims: Claims) -> Hypothesis | Mapping[str, Hypothesis]:
    """Claims, of which a name is that of an energy; raises `SettingsError` for one that nobody declared."""
    return hypotheses.hypothesis(claims) if isinstance(claims, str) else claims


def _single(claims: Claims) -> Hypothesis:
    """The claim about one measurement."""
    hypothesis = _named(claims)
    if not isinstance(hypothesis, Hypothesis):
        raise SettingsError(
            "one measurement has one hypothesis", remedy="give the measurements as a dict by label, too"
        )
    return hypothesis


def _work(seed: int, out: Folder | None, ess: float = 1000.0) -> analyses.Work:
    return analyses.Work(seed, None if out is None else Path(out), ess)
