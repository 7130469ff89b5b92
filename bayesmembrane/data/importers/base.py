"""What an importer declares, and the way from an export to a curve that the other verbs read.

One file per layout; the registry finds it by its name.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

import tomli_w

from bayesmembrane.data.exports.curve import curve_of
from bayesmembrane.data.exports.film import UNKNOWN, Film
from bayesmembrane.data.exports.hints import Guess, Hints
from bayesmembrane.data.exports.sheets import Sheet, guessed_encoding, is_workbook, text_sheet, workbook_sheets
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.reading import NAMES_FILES, read_measurement
from bayesmembrane.data.settings import TomlSection, load_specimen
from bayesmembrane.data.tables import read_bytes
from bayesmembrane.data.writing import csv_text, write_new
from bayesmembrane.ground.errors import DataError, SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import component, components
from bayesmembrane.ground.units import LENGTH, to_si

_WRITTEN = {
    "time": ("time_s", 1.0),
    "deflection": ("deflection_mm", 1e3),
    "force": ("force_N", 1.0),
    "force_sd": ("force_sd_N", 1.0),
    "stretch": ("stretch", 1.0),
    "nominal_stress": ("nominal_stress_MPa", 1e-6),
    "cycle": ("cycle", 1.0),
    "direction": ("direction", 1.0),
    "stretch_1": ("stretch_1", 1.0),
    "stretch_2": ("stretch_2", 1.0),
    "nominal_stress_1": ("nominal_stress_1_MPa", 1e-6),
    "nominal_stress_2": ("nominal_stress_2_MPa", 1e-6),
    "nominal_stress_sd": ("nominal_stress_sd_MPa", 1e-6),
    "nominal_stress_1_sd": ("nominal_stress_1_sd_MPa", 1e-6),
    "nominal_stress_2_sd": ("nominal_stress_2_sd_MPa", 1e-6),
}

_TO_COMPLETE = """
# To be completed: remove the "# " and write what is true of the film and the rig.
# [specimen]
# thickness_um = 50.0
# [rig]
# kind = "annulus"
# inner_radius_mm = 10.0
# outer_radius_mm = 35.0
"""
_EXAMPLES = {
    "thickness_um": 50.0,
    "inner_radius_mm": 10.0,
    "outer_radius_mm": 35.0,
    "length_mm": 50.0,
    "width_mm": 10.0,
}


@dataclass(frozen=True)
class Imported:
    """What an export says.

    Attributes
    ----------
    columns : name -> (N,) in SI: deflection and force, or stretch and nominal_stress; time and force_sd if known
    origin : in words: which file, which machine, which day
    notes : what was left aside or had to be decided
    guesses : what the file does not say outright, and how it was taken
    contradictions : where the file says a thing twice, and differently
    film, rig : what is known of the specimen, and the name of the rig, "" if it is not known
    """

    columns: Mapping[str, Array]
    origin: str
    notes: tuple[str, ...] = field(default=())
    guesses: tuple[Guess, ...] = ()
    contradictions: tuple[str, ...] = ()
    film: Film = UNKNOWN
    rig: str = ""


class Importer(ABC):
    """Reads one layout of files. A subclass has two methods, and

    name, title : how answers call it, and in words what it reads
    example : a short file of this layout
    last : it is asked only if no other recognises the file
    """

    name: ClassVar[str]
    title: ClassVar[str]
    example: ClassVar[bytes]
    last: ClassVar[bool] = False

    @staticmethod
    @abstractmethod
    def recognises(data: bytes) -> bool:
        """Whether the content of a file has this layout, so that a fault in it is best explained by ``read``."""

    @staticmethod
    @abstractmethod
    def read(data: bytes, file: str) -> Imported:
        """What the content says; raises `DataError`, naming ``file``, line and column, for what it cannot read."""

    @classmethod
    def read_with(cls, data: bytes, file: str, hints: Hints) -> Imported:
        """The same, with what the user said of the file; a layout that leaves nothing open takes the film from it."""
        found = cls.read(data, file)
        film = Film(hints.name, hints.thickness, hints.width, hints.gauge_length)
        return replace(found, film=film, rig=hints.rig)


class TableImporter(Importer):
    """Reads tables of numbers below their names. A subclass says how it knows its layout."""

    @staticmethod
    def read(data: bytes, file: str) -> Imported:
        return TableImporter.read_with(data, file, Hints())

    @classmethod
    def read_with(cls, data: bytes, file: str, hints: Hints) -> Imported:
        try:
            curve = curve_of(cls.sheets(data, file, hints), file, hints)
        except (DataError, SettingsError) as error:
            raise _naming_encoding(error, guessed_encoding(data, hints)) from None
        return Imported(
            curve.columns,
            f"imported from {file}",
            tuple(curve.notes),
            tuple(curve.guesses),
            tuple(curve.contradictions),
            curve.film,
            curve.rig,
        )

    @classmethod
    def sheets(cls, data: bytes, file: str, hints: Hints) -> Sequence[Sheet]:
        """The rows of a file."""
        return workbook_sheets(data, file, hints) if is_workbook(data) else [text_sheet(data, file, hints)]


def _naming_encoding(error: DataError | SettingsError, encoding: str) -> DataError | SettingsError:
    """The error; its remedy names the encoding of the file if that was guessed, for it may be what is wrong."""
    remedy = error.remedy or ""
    if not encoding or "--encoding" in remedy:
        return error
    guess = f"the text was read as {encoding}, and --encoding says another"
    return type(error)(error.what, error.where, f"{remedy.rstrip('. ')}; {guess}" if remedy else guess)


def head(data: bytes, length: int = 20_000) -> str:
    """The beginning of a file for words to be looked for in it, whatever its encoding."""
    return "" if is_workbook(data) else data[:length].replace(b"\0", b"").decode("latin-1")


@dataclass(frozen=True)
class Written:
    """What an import has written.

    curve, specimen : the files
    importer : by which importer
    complete : the specimen file says all that the other verbs ask for
    """

    curve: Path
    specimen: Path
    importer: str
    n_points: int
    notes: tuple[str, ...]
    guesses: tuple[Guess, ...] = ()
    contradictions: tuple[str, ...] = ()
    complete: bool = False


@dataclass(frozen=True)
class _Files:
    """An export as the two files that the other verbs read."""

    importer: str
    imported: Imported
    curve: str
    specimen: str
    complete: bool


def import_export(
    export: str | Path, out: str | Path | None = None, hints: Hints | None = None, specimen: str | Path | None = None
) -> Written:
    """Write the curve in an export to ``out`` (default: ``<export>_curve.csv`` in this folder), and a TOML beside it.

    ``hints`` say what the file does not, ``specimen`` is a TOML with film and rig. Raises `DataError` for what no
    importer can read, `SettingsError` if ``out`` is no .csv, and `StorageError` if a file exists already or cannot be
    written.
    """
    export = Path(export)
    out = Path(out) if out is not None else Path(f"{export.stem}_curve.csv")
    if out.suffix.lower() != ".csv":
        raise SettingsError(f'the curve is written as CSV, and "{out}" does not end in .csv', remedy="rename it")
    made = _files(export, hints or Hints(), specimen)
    toml = out.with_suffix(".toml")
    if made.complete:
        _measured(made, str(export))
    write_new({out: made.curve, toml: made.specimen})
    found = made.imported
    n = len(next(iter(found.columns.values())))
    return Written(out, toml, made.importer, n, found.notes, found.guesses, found.contradictions, made.complete)


def read_export(export: str | Path, hints: Hints | None = None, specimen: str | Path | None = None) -> Measurement:
    """The measurement in an export, as `import_export` and `read_measurement` would give it, with no file written.

    Raises `SettingsError` where film or rig are not known.
    """
    made = _files(Path(export), hints or Hints(), specimen)
    if not made.complete:
        missing = [x.removeprefix("# ") for x in made.specimen.split("\n") if x.startswith("# ") and "=" in x]
        raise SettingsError(
            f"{export} does not say all of film and rig", remedy=f"give a specimen file, or {', '.join(missing)}"
        )
    found = _measured(made, str(export))
    guessed = tuple(str(g) for g in made.imported.guesses)
    return replace(
        found, provenance=replace(found.provenance, notes=(*found.provenance.notes, *made.imported.notes, *guessed))
    )


def _measured(made: _Files, file: str) -> Measurement:
    """The files as a measurement; errors call them by the export."""
    with TemporaryDirectory() as folder:
        curve, toml = Path(folder) / "curve.csv", Path(folder) / "curve.toml"
        curve.write_text(made.curve, encoding="utf-8")
        toml.write_text(made.specimen, encoding="utf-8")
        try:
            found = read_measurement(curve, toml)
        except DataError as error:
            where = (error.where or "").replace(str(curve), f"{file}, as imported").replace(str(toml), "film and rig")
            raise DataError(error.what, where, error.remedy) from None
    return replace(found, provenance=replace(found.provenance, curve=Path(file).name, specimen=""))


def _files(export: Path, hints: Hints, specimen: str | Path | None) -> _Files:
    data = _bytes(export)
    template = _template(specimen)
    hints = _completed(hints, template)
    importer = _importer(data, str(export), hints.format)
    imported = importer.read_with(data, str(export), hints)
    columns = {_WRITTEN[k][0]: to_si(imported.columns[k], _WRITTEN[k][1]) for k in _WRITTEN if k in imported.columns}
    text, complete = _specimen_text(imported, hints, importer.name, template)
    return _Files(importer.name, imported, csv_text(columns), text, complete)


def _bytes(path: Path) -> bytes:
    try:
        return read_bytes(path)
    except FileNotFoundError:
        raise DataError("there is no such file", str(path), "check the path") from None
    except (OSError, ValueError) as error:
        raise DataError(f"the file cannot be read ({error})", remedy="check the path") from None


def _importer(data: bytes, file: str, name: str = "") -> type[Importer]:
    if name:
        chosen: type[Importer] = component("importers", name)
        return chosen
    if not data.strip():
        raise DataError("the file is empty", file, "export the measurement again")
    return recognising(data) or _refuse_layout(file)


def recognising(data: bytes) -> type[Importer] | None:
    """The importer that knows the layout of a file, None if there is none."""
    known: dict[str, type[Importer]] = components("importers")
    for importer in sorted(known.values(), key=lambda i: i.last):
        if importer.recognises(data):
            return importer
    return None


def _refuse_layout(file: str) -> Any:
    known: dict[str, type[Importer]] = components("importers")
    titles = "; ".join(i.title for i in known.values())
    raise DataError("no importer knows this layout", file, f"these are known: {titles}")


# ---- film and rig ----------------------------------------------------------------------------------------------------


def _template(specimen: str | Path | None) -> TomlSection | None:
    return None if specimen is None else load_specimen(Path(specimen))


def _completed(hints: Hints, template: TomlSection | None) -> Hints:
    """The hints, with what a specimen file says of film and rig where they say nothing."""
    if template is None:
        return hints
    film, rig = template.section("specimen", required=False), template.section("rig", required=False)
    found: dict[str, Any] = {
        "rig": rig.text("kind") or "",
        "name": film.text("name") or "",
        "thickness": film.measure("thickness", LENGTH, "thickness_um", required=False),
        "gauge_length": rig.measure("length", LENGTH, "length_mm", required=False),
        "width": rig.measure("width", LENGTH, "width_mm", required=False),
        "inner_radius": rig.measure("inner_radius", LENGTH, "inner_radius_mm", required=False),
        "outer_radius": rig.measure("outer_radius", LENGTH, "outer_radius_mm", required=False),
    }
    return replace(hints, **{k: v for k, v in found.items() if v and not getattr(hints, k)})


def _specimen_text(imported: Imported, hints: Hints, importer: str, template: TomlSection | None) -> tuple[str, bool]:
    """(TOML, whether it is complete): film and rig as far as they are known, and how the export was understood."""
    content = _said_of_the_test(imported, template)
    understood = {g.what.replace(" ", "_"): str(g).split(": ", 1)[1] for g in imported.guesses}
    listed = {"contradictions": imported.contradictions, "notes": imported.notes}
    if understood or imported.contradictions:
        content["import"] = {"format": importer, **understood, **{k: list(v) for k, v in listed.items() if v}}
    rest = tomli_w.dumps(content)
    if not imported.rig and not imported.film.thickness:
        return f"{_TO_COMPLETE.lstrip()}\n{rest}", False
    film = {"name": imported.film.name, "thickness_um": _in(imported.film.thickness, 1e6)}
    rig: dict[str, Any] = {"kind": imported.rig}
    if imported.rig:
        cls = component("rigs", imported.rig)
        lengths = {"length": imported.film.length, "width": imported.film.width}
        lengths |= {"inner_radius": hints.inner_radius, "outer_radius": hints.outer_radius}
        rig |= {f"{k}_mm": _in(lengths.get(k), 1e3) for k in cls.length_names()}
        optional = {f"{k}_mm" for k in cls.length_names() if cls.has_default(k)}
    else:
        rig |= {"inner_radius_mm": _in(hints.inner_radius, 1e3), "outer_radius_mm": _in(hints.outer_radius, 1e3)}
        optional = set()
    texts = [_section("specimen", film, {"name"}), _section("rig", rig, optional)]
    text = "\n".join([*texts, rest])
    complete = not any(line.startswith("# ") for t in texts for line in t.split("\n"))
    return (text if complete else f"{_TO_COMPLETE.lstrip().splitlines()[0]}\n{text}"), complete


def _said_of_the_test(imported: Imported, template: TomlSection | None) -> dict[str, Any]:
    """Sections of the measurement and its origin: what a specimen file says stays; what was reconstructed is still so.

    Files that it names from where it lies are named whole: what is written will lie elsewhere.
    """
    content: dict[str, Any] = {"measurement": {"origin": imported.origin}}
    if template is None:
        return content
    if isinstance(measured := template.table.get("measurement"), dict):
        beside = Path(template.file).resolve().parent
        files = {k: str(beside / measured[k]) for k in NAMES_FILES if isinstance(measured.get(k), str)}
        content["measurement"] |= measured | files
    if "origin" in template.table:
        content["origin"] = template.table["origin"]
    return content


def _section(name: str, known: Mapping[str, Any], optional: set[str]) -> str:
    """A section of TOML: what is known, and lines to be completed for what is not and is needed."""
    lines = [f"[{name}]"]
    for key, value in known.items():
        if value:
            lines.append(tomli_w.dumps({key: value}).rstrip("\n"))
        elif key not in optional:
            lines.append("# " + tomli_w.dumps({key: _EXAMPLES.get(key, "annulus")}).rstrip("\n"))
    return "\n".join(lines) + "\n"


def _in(value: float | None, scale: float) -> float | None:
    return None if value is None else float(f"{scale * value:.15g}")
