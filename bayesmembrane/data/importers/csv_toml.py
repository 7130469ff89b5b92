"""This program's own layout, written by another hand: other units, delimiters, decimal signs and header styles."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import ClassVar

from bayesmembrane.data.exports.film import Film
from bayesmembrane.data.exports.hints import Hints
from bayesmembrane.data.fixture import Fixture, check_lifted
from bayesmembrane.data.importers.base import Imported, Importer, TableImporter
from bayesmembrane.data.reading import curve_columns
from bayesmembrane.data.tables import TextTable, decode, number, parse_table
from bayesmembrane.ground.errors import DataError, SettingsError
from bayesmembrane.ground.units import FORCE, RATIO, STRESS, split_header

_TABLE_HINTS = (
    "encoding",
    "delimiter",
    "decimal",
    "columns",
    "units",
    "sheet",
    "part",
    "zero",
    "sign",
    "strain",
    "stress",
    "readings_per_s",
)
_BIAXIAL = "biaxial"
_TWO_AXES = {"stretch_1": RATIO, "stretch_2": RATIO, "nominal_stress_1": STRESS, "nominal_stress_2": STRESS}
_NOISE = {
    "force_sd": FORCE,
    **dict.fromkeys(("nominal_stress_sd", "nominal_stress_1_sd", "nominal_stress_2_sd"), STRESS),
}
_BRACKETS = re.compile(r"(?P<name>[^\[\](),]+?)[\s_]*(?:\[(?P<a>[^\[\]]*)\]|\((?P<b>[^()]*)\))")


class CsvToml(Importer):
    """A header line with deflection and force in known units, or with both stretches and both stresses of a biaxial
    test, and numbers below; ``;``, tab or ``,`` between them.
    """

    name: ClassVar[str] = "csv_toml"
    title: ClassVar[str] = (
        "CSV with a header like deflection_mm;force_N or Deflection [mm];Force [N], "
        "separated by semicolons, tabs or commas, decimal points or commas"
    )

    example: ClassVar[bytes] = b"Time [s];Deflection [mm];Force [mN]\n0;1,5;10,25\n1;2,5;47,5\n2;3,5;130,0\n"

    @staticmethod
    def recognises(data: bytes) -> bool:
        if b"\0" in data:
            return False
        names = _names(data)
        return set(Fixture.columns) <= names or set(_TWO_AXES) <= names

    @classmethod
    def read_with(cls, data: bytes, file: str, hints: Hints) -> Imported:
        """As `read`; where more is said than film and rig, as any table is read."""
        said = (getattr(hints, name) for name in _TABLE_HINTS)
        if set(_TWO_AXES) <= _names(data) and not hints.columns:
            return cls._biaxial(data, file, hints)
        if any(said) or hints.rig not in ("", "annulus"):
            return TableImporter.read_with(data, file, hints)
        return super().read_with(data, file, hints)

    @staticmethod
    def read(data: bytes, file: str) -> Imported:
        text = decode(_text(data).encode(), file)
        header = next((x for x in text.split("\n") if x.strip() and not x.lstrip().startswith("#")), "")
        delimiter = next((d for d in ";\t" if d in header), ",")
        table = parse_table(text, file, delimiter)
        decimal = _decimal(table)
        table = replace(table, header=tuple(_plain(h) for h in table.header), decimal=decimal)
        if set(_TWO_AXES) <= _names(data):
            columns, notes = curve_columns(table, _TWO_AXES, _NOISE)
            return Imported(columns, f"imported from {file}", notes, rig=_BIAXIAL)
        columns, notes = curve_columns(table)
        check_lifted(columns, file, table.lines)
        return Imported(columns, f"imported from {file}", notes)

    @classmethod
    def _biaxial(cls, data: bytes, file: str, hints: Hints) -> Imported:
        """Both stretches and both stresses, which say the rig; nothing in them is to be guessed."""
        if hints.rig not in ("", _BIAXIAL):
            raise SettingsError(
                f'the file has two axes, and the rig "{hints.rig}" has one',
                remedy='leave --rig out, or name one axis, --columns "stretch=stretch_1,stress=nominal_stress_1_MPa"',
            )
        if odd := next((name for name in _TABLE_HINTS if getattr(hints, name)), None):
            option = f"--{odd.replace('_', '-')}"
            raise SettingsError("this layout says its columns and units itself", option, f"leave {option} out")
        film = Film(hints.name, hints.thickness, hints.width, hints.gauge_length)
        return replace(cls.read(data, file), film=film)


def _names(data: bytes) -> set[str]:
    """The quantities that the first line names."""
    lines = [x for x in _text(data).splitlines() if x.strip() and not x.lstrip().startswith("#")]
    header = re.split(r"[;\t,]", lines[0]) if lines else []
    return {split_header(_plain(h.strip(' "')))[0].lower() for h in header}


def _text(data: bytes) -> str:
    """Bytes -> text; what is not UTF-8 is read as Windows' western code page, where only signs like µ differ."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")


def _plain(header: str) -> str:
    """The header in this program's own style: ``Force [mN]``, ``Force (mN)`` -> ``force_mN``."""
    found = _BRACKETS.fullmatch(header.strip())
    if not found:
        return header.strip()
    name = re.sub(r"\s+", "_", found["name"].strip()).lower()
    unit = found["a"] if found["a"] is not None else found["b"]
    return f"{name}_{unit.strip()}".rstrip("_")


def _decimal(table: TextTable) -> str:
    """The decimal sign of a table; raises `DataError` at the first cell that contradicts the cells before it."""
    sign, place = "", ""
    for line, cells in zip(table.lines, table.rows, strict=True):
        for cell in cells:
            found = next((d for d in ".," if d in cell and number(cell, d) is not None), "")
            where = f"{table.file}, line {line}"
            if found and sign and found != sign:
                fault = f'"{cell}" has another decimal sign than the numbers before it ({place})'
                raise DataError(fault, where, "write all numbers with one sign")
            if found:
                sign, place = found, place or f'"{cell}" in line {line}'
    return sign or "."
