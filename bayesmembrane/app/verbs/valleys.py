"""``valleys``: where many films fit nearly as well as the best one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bayesmembrane.app.options import (
    CHAINS,
    CurveOptions,
    HypothesisOptions,
    MaterialOption,
    OutputOptions,
    RangesOption,
)
from bayesmembrane.app.terminal import answer, say, say_few, status, table

if TYPE_CHECKING:
    from bayesmembrane.valleys.beside import Beside as BesideValleys
    from bayesmembrane.valleys.result import Valleys

place = 7

COLUMNS = ("material", "end_mm", "loss_N", "length", "unit", "condition_number", "open")
TESTS = 5


@dataclass(frozen=True)
class WrittenOptions(OutputOptions):
    """Where the answer is stored, and its figure beside it."""

    folder: Annotated[
        Path | None,
        typer.Option("--out", help="Folder of the answer; JSON and figure are written here too. Without: chains."),
    ] = None


def verb(
    curve: CurveOptions,
    material: MaterialOption,
    beside: HypothesisOptions,
    ranges: RangesOption,
    output: WrittenOptions,
    loss_rise: Annotated[float, typer.Option(help="A valley fits within this part of the least loss.")] = 0.1,
) -> None:
    """How long the valley of the loss is, over one range or several, whether they meet, and what to measure next.

    With --effects also the valley without them, and how far the two lie apart.
    """
    claim = beside.with_material(material.material)
    measurement = curve.read()
    from bayesmembrane.app import analyses  # last: what can be refused is refused at once
    from bayesmembrane.report.sections.valleys import write_valleys

    say_few(len(measurement), "Valleys are followed")
    with status(f"Following the valleys of {claim.label()}"):
        work = analyses.Work(output.seed, output.folder or CHAINS)
        found = analyses.valleys(measurement, claim, work, ends=ranges.ends, rise=loss_rise)
    document = found.document
    if output.folder is not None:
        name = "valleys" if found.folder is None else found.folder.name  # no other answer in there is written over
        document |= {"files": [str(f) for f in write_valleys(found.result, output.folder, name)]}
    title = f"Valleys of {claim.material.title} on {curve.shown}"
    answer(document, output.as_json, lambda: show(found.result, title))


def show(found: Valleys | BesideValleys, title: str) -> None:
    """The valleys, what is said of them, and what would shorten them, on the terminal."""
    from bayesmembrane.report.sections.valleys.tables import valley_table
    from bayesmembrane.valleys.beside import Beside as BesideValleys
    from bayesmembrane.words.next_test import spoken_test
    from bayesmembrane.words.valleys import sentences, up_to

    parts = [found.without, found.added] if isinstance(found, BesideValleys) else [found]
    whole = valley_table(parts)
    shown = [i for i, c in enumerate(whole.columns) if c.key in COLUMNS]
    table(title, [whole.columns[i].head for i in shown], [[row[i] for i in shown] for row in whole.cells()])
    for sentence in sentences(found):
        say(sentence)
    for valley in parts[-1].ranges:
        rows = [[spoken_test(t.test), f"{100 * t.reduction:.0f} %"] for t in valley.next_tests[:TESTS]]
        table(f"What to measure next, from data {up_to(valley)}", ["test", "shorter by"], rows)
