"""CellScale UniVert (one axis) and BioTester (two axes): ``Time_S,XSize_um,XDisplacement_um,...,XForce_mN``."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from bayesmembrane.data.exports.blocks import NumberBlock, blocks_of
from bayesmembrane.data.exports.columns import PossibleColumn, read
from bayesmembrane.data.exports.film import Film
from bayesmembrane.data.exports.hints import Guess, Hints
from bayesmembrane.data.exports.sheets import Sheet
from bayesmembrane.data.exports.words import TRAVEL, Reading, unit_of
from bayesmembrane.data.importers.base import Imported, TableImporter, head
from bayesmembrane.ground.errors import DataError, SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.units import FORCE

_WORDS = re.compile(r"SetName|Time_S\b.*(?:Force_m?N|Displacement_[um]m)|[XY]Force_m?N")
"""As they are spelt there: ``time_s,deflection_mm,force_N`` is this program's own."""
_TWO = re.compile(r"XForce_\w+.*YForce_\w+|YForce_\w+.*XForce_\w+", re.IGNORECASE)


class CellScale(TableImporter):
    """Of two axes: stretch = 1 + displacement / size at first, stress = force / (size across x thickness)."""

    name: ClassVar[str] = "cellscale"
    title: ClassVar[str] = "CellScale UniVert and BioTester text"
    example: ClassVar[bytes] = (
        b"SetName,Cycle,Time_S,Size_mm,Displacement_mm,Force_N\n"
        b"Set1,1-Stretch,0.0,20.0,0.0,0.0001\nSet1,1-Stretch,1.0,21.0,1.0,0.0475\nSet1,1-Recover,2.0,22.0,2.0,0.1300\n"
    )

    @staticmethod
    def recognises(data: bytes) -> bool:
        return bool(_WORDS.search(head(data, 4000)))

    @classmethod
    def read_with(cls, data: bytes, file: str, hints: Hints) -> Imported:
        if not _TWO.search(head(data, 4000)) or hints.columns:
            return super().read_with(data, file, hints)
        if hints.rig not in ("", "biaxial"):
            raise SettingsError(
                f'the file has two axes, and the rig "{hints.rig}" has one',
                remedy='leave --rig out, or name one axis, --columns "travel=XDisplacement_um,force=XForce_mN"',
            )
        return _two_axes(cls.sheets(data, file, hints), file, hints)


def _two_axes(sheets: Sequence[Sheet], file: str, hints: Hints) -> Imported:
    if not hints.thickness:
        raise DataError("the forces cannot become stresses: the thickness is not known", file, "say --thickness-um")
    block = max((b for s in sheets for b in blocks_of(s)), key=lambda b: len(b.rows), default=None)
    if block is None:
        raise DataError("there are no lines of numbers", file, "export the readings again")
    size = {axis: float(_column(block, f"{axis}size", hints)[0]) for axis in "xy"}
    columns: dict[str, Array] = {}
    for k, (axis, across) in enumerate((("x", "y"), ("y", "x")), 1):
        if size[across] <= 0:
            raise DataError(f"the size {across.upper()} is not positive", block.place, "check the file")
        columns[f"stretch_{k}"] = 1.0 + _column(block, f"{axis}displacement", hints) / size[axis]
        columns[f"nominal_stress_{k}"] = _column(block, f"{axis}force", hints) / (size[across] * hints.thickness)
    if any(np.any(columns[f"stretch_{k}"] <= 0) for k in (1, 2)):
        raise DataError("a stretch below zero cannot be", block.place, "check the sizes and displacements")
    shown = f"{1e3 * size['x']:.5g} x {1e3 * size['y']:.5g} mm"
    why = "these are the sizes in the first reading; each force is carried over the size across it"
    guesses = (*block.sheet.guesses, Guess("size at rest", shown, why, "--columns"))
    film = Film(hints.name, hints.thickness, size["y"], size["x"])
    return Imported(columns, f"imported from {file}", (), guesses, (), film, "biaxial")


def _column(block: NumberBlock, name: str, hints: Hints) -> Array:
    """The values in SI of the column that begins with a name, ``XForce_mN`` with ``xforce``."""
    column = next((c for c in block.columns if c.header.lower().replace(" ", "").startswith(name)), None)
    if column is None:
        shown = ", ".join(c.header for c in block.columns)
        raise DataError(
            f"the column {name} is missing among {shown}", block.place, "export sizes, displacements and forces"
        )
    role = FORCE if name.endswith("force") else TRAVEL
    chosen = PossibleColumn(column, role, unit_of(column.unit), Reading(role), 20.0)
    return read(block, chosen, block.rows, hints).values
