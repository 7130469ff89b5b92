"""What an importer declares, and the way from an export to a curve that the other verbs read.

One file per layout; the registry finds it by its name.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import tomli_w

from bayesmembrane.data.tables import read_bytes
from bayesmembrane.data.writing import csv_text, write_new
from bayesmembrane.ground.errors import DataError, SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import components
from bayesmembrane.ground.units import to_si

_WRITTEN = {
    "time": ("time_s", 1.0),
    "deflection": ("deflection_mm", 1e3),
    "force": ("force_N", 1.0),
    "force_sd": ("force_sd_N", 1.0),
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


@dataclass(frozen=True)
class Imported:
    """What an export says.

    Attributes
    ----------
    columns : name -> (N,) in SI: deflection, force and, if known, time and force_sd
    origin : in words: which file, which machine, which day
    notes : what was left aside or had to be decided
    """

    columns: Mapping[str, Array]
    origin: str
    notes: tuple[str, ...] = field(default=())


class Importer(ABC):
    """Reads one layout of files. A subclass has two methods, and

    name, title : how answers call it, and in words what it reads
    example : a short file of this layout
    """

    name: ClassVar[str]
    title: ClassVar[str]
    example: ClassVar[bytes]

    @staticmethod
    @abstractmethod
    def recognises(data: bytes) -> bool:
        """Whether the content of a file has this layout, so that a fault in it is best explained by ``read``."""

    @staticmethod
    @abstractmethod
    def read(data: bytes, file: str) -> Imported:
        """What the content says; raises `DataError`, naming ``file``, line and column, for what it cannot read."""


@dataclass(frozen=True)
class Written:
    """What an import has written: the curve, the specimen file to be completed, and by which importer."""

    curve: Path
    specimen: Path
    importer: str
    n_points: int
    notes: tuple[str, ...]


def import_export(export: str | Path, out: str | Path | None = None) -> Written:
    """Write the curve in an export to ``out`` (default: ``<export>_curve.csv`` in this folder), and a TOML beside it.

    Raises `DataError` for what no importer can read, `SettingsError` if ``out`` is no .csv, and `StorageError` if a
    file exists already or cannot be written.
    """
    export = Path(export)
    out = Path(out) if out is not None else Path(f"{export.stem}_curve.csv")
    if out.suffix.lower() != ".csv":
        raise SettingsError(f'the curve is written as CSV, and "{out}" does not end in .csv', remedy="rename it")
    data = _bytes(export)
    importer = _importer(data, str(export))
    imported = importer.read(data, str(export))
    columns = {_WRITTEN[k][0]: to_si(imported.columns[k], _WRITTEN[k][1]) for k in _WRITTEN if k in imported.columns}
    specimen = out.with_suffix(".toml")
    write_new({out: csv_text(columns), specimen: _specimen_text(imported)})
    return Written(out, specimen, importer.name, len(imported.columns["force"]), imported.notes)


def _bytes(path: Path) -> bytes:
    try:
        return read_bytes(path)
    except FileNotFoundError:
        raise DataError("there is no such file", str(path), "check the path") from None
    except (OSError, ValueError) as error:
        raise DataError(f"the file cannot be read ({error})", remedy="check the path") from None


def _importer(data: bytes, file: str) -> type[Importer]:
    if not data.strip():
        raise DataError("the file is empty", file, "export the measurement again")
    known: dict[str, type[Importer]] = components("importers")
    for importer in known.values():
        if importer.recognises(data):
            return importer
    titles = "; ".join(i.title for i in known.values())
    raise DataError("no importer knows this layout", file, f"these are known: {titles}")


def _specimen_text(imported: Imported) -> str:
    return _TO_COMPLETE.lstrip() + "\n" + tomli_w.dumps({"measurement": {"origin": imported.origin}})
