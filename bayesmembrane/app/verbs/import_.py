"""``import``: what other programs export."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bayesmembrane.app.options import OptionGroup, OutputOptions
from bayesmembrane.app.terminal import answer, note, say

if TYPE_CHECKING:
    from bayesmembrane.data.exports.hints import Hints
    from bayesmembrane.data.importers.base import Written

place = 3


@dataclass(frozen=True)
class TableOptions(OptionGroup):
    """What is said of the file, where it does not say it itself."""

    layout: Annotated[
        str, typer.Option("--format", help="Importer by name, instead of the one that knows the file.")
    ] = ""
    encoding: Annotated[str, typer.Option("--encoding", help="utf-8, cp1252, cp1250, gbk, ...")] = ""
    delimiter: Annotated[str, typer.Option("--delimiter", help="tab, comma, semicolon, space, or the sign itself.")] = (
        ""
    )
    decimal: Annotated[str, typer.Option("--decimal", help="Decimal sign: point or comma.")] = ""
    columns: Annotated[
        str,
        typer.Option(
            "--columns",
            help='In their order, time_s,travel_mm,-,force_N (- is left out), or some: "force=Load 2,travel=3".',
        ),
    ] = ""
    units: Annotated[str, typer.Option("--units", help="Units that the file does not say: travel=mm,force=N.")] = ""
    sheet: Annotated[str, typer.Option("--sheet", help="Sheet of a workbook.")] = ""
    part: Annotated[str, typer.Option("--part", help="Which of several specimens, by number or name.")] = ""
    readings_per_s: Annotated[
        float | None, typer.Option("--readings-per-s", help="How often a file without times was read.")
    ] = None
    readings: Annotated[
        int | None, typer.Option("--readings", help="Keep so many at most, with all turning points.")
    ] = None


@dataclass(frozen=True)
class MeaningOptions(OptionGroup):
    """What its numbers mean."""

    zero: Annotated[str, typer.Option("--zero", help="What starts at zero: none, travel, force or travel,force.")] = ""
    sign: Annotated[str, typer.Option("--sign", help="keep, flip, flip-force or flip-travel.")] = ""
    strain: Annotated[str, typer.Option("--strain", help="A column of strain is engineering, true, or a stretch.")] = ""
    stress: Annotated[str, typer.Option("--stress", help="A column of stress is engineering or true.")] = ""


@dataclass(frozen=True)
class FilmAndRigOptions(OptionGroup):
    """Film and rig, where neither the file nor a specimen file says them."""

    specimen: Annotated[Path | None, typer.Option("--specimen", help="TOML with film and rig, if there is one.")] = None
    rig: Annotated[str, typer.Option("--rig", help="annulus, uniaxial, planar, compression or another.")] = ""
    name: Annotated[str, typer.Option("--name", help="Name of the specimen.")] = ""
    thickness_um: Annotated[float | None, typer.Option("--thickness-um", help="Thickness at rest.")] = None
    gauge_length_mm: Annotated[float | None, typer.Option("--gauge-length-mm", help="Length of a strip at rest.")] = (
        None
    )
    width_mm: Annotated[float | None, typer.Option("--width-mm", help="Width of a strip at rest.")] = None
    inner_radius_mm: Annotated[float | None, typer.Option("--inner-radius-mm", help="Radius of the disc.")] = None
    outer_radius_mm: Annotated[float | None, typer.Option("--outer-radius-mm", help="Radius of the clamp.")] = None


def verb(
    export: Annotated[Path, typer.Argument(help="The file that the machine wrote.", metavar="EXPORT")],
    output: OutputOptions,
    table: TableOptions,
    meaning: MeaningOptions,
    film: FilmAndRigOptions,
    curve: Annotated[Path, typer.Option("--out", help="Where the curve goes; a TOML is written beside it.")] = Path(
        "curve.csv"
    ),
) -> None:
    """The curve and the specimen file from another program's export; says every guess, refuses what it cannot read."""
    from bayesmembrane.data.importers.base import import_export

    written = import_export(export, curve, _hints(table, meaning, film), film.specimen)
    for guess in written.guesses:
        note(f"{export.name}: {guess}.")
    for left_aside in written.notes:
        note(f"{export.name}: {left_aside}.")
    for contradiction in written.contradictions:
        note(f"{export.name}: CONTRADICTION: {contradiction}.")
    document = {
        "curve": str(written.curve),
        "specimen": str(written.specimen),
        "importer": written.importer,
        "n_points": written.n_points,
        "complete": written.complete,
        "guesses": [guess._asdict() for guess in written.guesses],
        "contradictions": list(written.contradictions),
        "notes": list(written.notes),
    }
    answer(document, output.as_json, lambda: say(_sentence(written)))


def _hints(table: TableOptions, meaning: MeaningOptions, film: FilmAndRigOptions) -> Hints:
    from bayesmembrane.data.exports.hints import hints_of

    said = {**vars(table), **vars(meaning), **vars(film)}
    del said["specimen"]
    said["format"] = said.pop("layout")
    return hints_of(said)


def _sentence(written: Written) -> str:
    done = f"{written.n_points} points read as {written.importer}, written to {written.curve}"
    if not written.complete:
        return f"{done}; complete {written.specimen} with the film and the rig before using them."
    following = f"bayesmembrane fit {written.curve} --specimen {written.specimen} --material yeoh"
    return f"{done}, film and rig to {written.specimen}; next: {following}"
