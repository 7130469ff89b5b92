"""``compare``: which hypotheses the data support."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from bayesmembrane.app.options import (
    HypothesisOptionsWeighed,
    MaterialsOption,
    RangeOrRangesOption,
    SamplingOptions,
    StoredOutputOptions,
    TestsOptions,
)
from bayesmembrane.app.terminal import answer, lines, resumable, say, say_few, table
from bayesmembrane.ground.errors import SettingsError

if TYPE_CHECKING:
    from bayesmembrane.calibration.joint.claim import Joint
    from bayesmembrane.comparison.result import Comparison
    from bayesmembrane.data.project import Listed

place = 8

# What a terminal of 80 characters has room for; a report shows all columns.
COLUMNS = {
    "evidence": ("hypothesis", "nested", "nested_sd", "bridge", "bridge_sd", "probability", "mass"),
    "prediction": ("hypothesis", "elpd_loo", "loo_se", "refits", "held_rmse"),
}


def verb(
    curve: TestsOptions,
    materials: MaterialsOption,
    beside: HypothesisOptionsWeighed,
    used: RangeOrRangesOption,
    sampling: SamplingOptions,
    output: StoredOutputOptions,
) -> None:
    """Which materials the data support, by two estimators of the evidence, with prediction beside it."""
    from bayesmembrane.app import analyses
    from bayesmembrane.comparison.compare import claimed, ranges_of

    if curve.several:
        if used.ranges_mm:
            raise SettingsError("several tests have no ranges in common", "--ranges-mm", "leave it out")
        names = [name.strip() for name in materials.materials.split(",") if name.strip()]
        tests = [_of_few(test) for test in curve.listed(used)]
        together = [_together(name, beside, tests) for name in names]
        with resumable(output.folder), lines() as tell:
            both = analyses.compare_joint(together, analyses.Work(output.seed, output.folder, sampling.ess, tell))
        answer(both.document, output.as_json, lambda: show(both.result))
        return
    claims = claimed(materials.materials, beside.effects, beside.noise, beside.convexity)
    measurement = curve.read()
    end = used.end_on(measurement)
    if used.ranges_mm and end is not None:
        twice = "--max-deflection-mm" if used.max_stretch is None else "--max-stretch"
        raise SettingsError("the range is given twice", f"--ranges-mm, {twice}", "give one of them")
    say_few(len(measurement), "Energies are weighed")
    ranges = ranges_of(measurement, used.ends or ([] if end is None else [end]))
    with resumable(output.folder), lines() as tell:
        work = analyses.Work(output.seed, output.folder, sampling.ess, tell)
        found = analyses.compare(ranges, claims, work)
    answer(found.document, output.as_json, lambda: show(found.result))


def _of_few(test: Listed) -> Listed:
    """The test with as many readings as a comparison uses, and a note where those are not all."""
    from dataclasses import replace

    from bayesmembrane.data.thinning import MOST, of_few

    say_few(len(test.measurement), "Energies are weighed")
    return replace(test, measurement=of_few(test.measurement, MOST))


def _together(name: str, beside: HypothesisOptionsWeighed, tests: Sequence[Listed]) -> Joint:
    """The claim "yeoh+prestretch" about all tests."""
    from dataclasses import replace

    material, *own = name.split("+")
    return replace(beside, effects=",".join([*own, beside.effects])).joint(material, tests)


def show(found: dict[str, Comparison]) -> None:
    """Evidence and prediction of each range, on the terminal."""
    from bayesmembrane.report.sections.evidence.tables import evidence_table, noises_table
    from bayesmembrane.words.comparison import remark, sentences

    for name, comparison in found.items():
        shown = evidence_table({name: comparison})
        for text, part in COLUMNS.items():
            columns = [i for i, c in enumerate(shown.columns) if c.key in part]
            rows = [[row[i] for i in columns] for row in shown.cells()]
            table(f"{name}: {text}", [shown.columns[i].head for i in columns], rows)
        if (sums := noises_table({name: comparison})) is not None:
            table(f"{name}: whatever the noise", [c.head for c in sums.columns[1:]], [r[1:] for r in sums.cells()])
        for row in comparison.rows:
            if not row.fitted:
                say(f"{row.label}: {remark(row)}")
        for sentence in sentences(comparison):
            say(sentence)
