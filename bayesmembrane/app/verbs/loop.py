"""``loop``: calibrate, diagnose, add what is missing, calibrate again."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bayesmembrane.app.options import (
    CurveOptions,
    HypothesisOptionsAuto,
    PreferredMaterialOption,
    RangeOption,
    SamplingOptions,
    StoredOutputOptions,
    curves_with_specimens,
)
from bayesmembrane.app.terminal import answer, lines, resumable, say
from bayesmembrane.app.verbs.diagnose import say_thinning
from bayesmembrane.app.verbs.diagnose import show as show_diagnosis

if TYPE_CHECKING:
    from bayesmembrane.data.measurement import Measurement

place = 10


@dataclass(frozen=True)
class EndOptions(StoredOutputOptions):
    """What is made of the answer."""

    rivals: Annotated[
        int, typer.Option("--rivals", min=0, help="Members of an ambiguous answer that are sampled, too.")
    ] = 0
    predict: Annotated[
        list[str] | None,
        typer.Option(
            "--predict", help="Another test, CURVE:SPECIMEN, that is not fitted but predicted; may be given again."
        ),
    ] = None
    scatter: Annotated[
        float, typer.Option("--scatter", help="By how much forces of two specimens differ, relative: 0.05.")
    ] = 0.0
    report_folder: Annotated[Path, typer.Option("--report", help="Folder of the page.")] = Path("reports/loop")


def verb(
    curve: CurveOptions,
    material: PreferredMaterialOption,
    beside: HypothesisOptionsAuto,
    used: RangeOption,
    sampling: SamplingOptions,
    output: EndOptions,
) -> None:
    """Calibrate, diagnose, add what is missing, calibrate again, until adequate or abstaining; and report."""
    from bayesmembrane.app import analyses
    from bayesmembrane.diagnosis.explanation.case import Question
    from bayesmembrane.diagnosis.loop import LoopSettings
    from bayesmembrane.ground.files import ensure_writable
    from bayesmembrane.report.page import write_report

    adapt = beside.noise == "auto"
    claim = beside.with_material(material.name, noise="white" if adapt else "")
    measurement = used.of(curve.read())
    ensure_writable(output.report_folder, "the page")
    say_thinning(measurement)
    with resumable(output.folder), lines() as tell:
        work = analyses.Work(output.seed, output.folder, sampling.ess, tell)
        question = Question(claim, material.declared)
        others = tuple(curves_with_specimens(output.predict, "--predict"))
        how = LoopSettings(adapt_noise=adapt, leaders=output.rivals, predict=others, scatter=output.scatter)
        found = analyses.loop(measurement, question, work, how)
    page = write_report([*analyses.loop_runs(found.result), found.result], output.report_folder)
    document = {**found.document, "report": str(page)}
    answer(document, output.as_json, lambda: show(document, measurement))


def show(document: dict[str, Any], measurement: Measurement) -> None:
    """Every round, and where the page lies, on the terminal."""
    for number, round_ in enumerate(document["rounds"], 1):
        say(f"Round {number}")
        show_diagnosis(round_, measurement)
    for other in document["predicted"]:
        say(other["sentence"])
    say(f"The report lies in {document['report']}")
