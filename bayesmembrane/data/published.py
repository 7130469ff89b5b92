"""The published table behind a reconstruction: parameter sets, their losses, the ranges, the rig."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bayesmembrane.data.settings import load_toml
from bayesmembrane.data.shipped import shipped
from bayesmembrane.data.tables import TextTable, number, parse_table, read_text
from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import material
from bayesmembrane.ground.units import LENGTH


@dataclass(frozen=True)
class PrintedSet:
    """One printed parameter set with one printed loss per range; the texts keep the printed digits.

    Attributes
    ----------
    material, column : which energy, and which column of the table (`INI`, `OP1`, `OP2`)
    names : names of the membrane parameters
    parameters : printed parameters, N/m or dimensionless, in the order of ``names``
    losses : printed losses in N, in the order of the table's ranges
    """

    material: str
    column: str
    names: tuple[str, ...]
    parameters: tuple[str, ...]
    losses: tuple[str, ...]

    @property
    def label(self) -> str:
        """Material and column, for people."""
        return f"{self.material} {self.column}"

    @property
    def values(self) -> tuple[float, ...]:
        """The parameters as numbers."""
        return tuple(float(v) for v in self.parameters)

    @property
    def loss(self) -> Array:
        """(n_ranges,) the losses as numbers, N."""
        return np.array([float(v) for v in self.losses])


@dataclass(frozen=True)
class PublishedTable:
    """Losses |y - F_k| of n_rows parameter sets over n_ranges sets of training deflections.

    Attributes
    ----------
    rows : the printed parameter sets
    ranges : names of the ranges
    ends : (n_ranges,) last training deflection of each, m
    inner_radius, outer_radius, thickness : the rig and the film, m
    step : recording step of the measurement, m
    """

    rows: tuple[PrintedSet, ...]
    ranges: tuple[str, ...]
    ends: tuple[float, ...]
    inner_radius: float
    outer_radius: float
    thickness: float
    step: float

    def __post_init__(self) -> None:
        if len(self.rows) < 4:
            raise DataError(f"a curve cannot be located from {len(self.rows)} parameter sets", remedy="give at least 4")
        if not all(np.isfinite(e) and e > 0 for e in self.ends):
            raise DataError("the last deflection of each range must be positive")
        for row in self.rows:
            if not np.all(row.loss > 0):
                raise DataError("a loss is a distance and must be positive", row.label)

    @property
    def losses(self) -> Array:
        """(n_ranges, n_rows) printed losses, N."""
        return np.array([row.loss for row in self.rows]).T

    def with_row(self, index: int, row: PrintedSet) -> PublishedTable:
        """The table with another row at ``index``."""
        rows = list(self.rows)
        rows[index] = row
        return replace(self, rows=tuple(rows))


def read_published_table(
    parameters: Path | None = None, losses: Path | None = None, facts: Path | None = None
) -> PublishedTable:
    """The table in two CSV files and a TOML file; those of the source paper unless others are given.

    Columns: ``material,column,parameter,value`` and ``material,column,range,loss_N``. The TOML has ``[geometry]`` with
    radii and thickness, and ``[ranges]`` with ``<range>_end_mm``, ``[protocol]`` with ``step_mm``.
    Raises `DataError` with file and line.
    """
    sets = _parameter_sets(_load(parameters or shipped("paper_parameters.csv")))
    printed = _losses(_load(losses or shipped("paper_losses.csv")))
    root = load_toml(facts or shipped("paper.toml"))
    geometry, ends = root.section("geometry"), root.section("ranges")
    ranges = tuple(dict.fromkeys(name for _, _, name in printed))
    rows = []
    for (kind, column), constants in sets.items():
        names = material(kind).field_names()
        for name in names:
            if name not in constants:
                raise DataError(f"the parameter {name} of {kind} {column} is missing", "the table of parameters")
        for name in ranges:
            if (kind, column, name) not in printed:
                raise DataError(f"the loss of {kind} {column} over {name} is missing", "the table of losses")
        loss = tuple(printed[kind, column, name] for name in ranges)
        rows.append(PrintedSet(kind, column, names, tuple(constants[name] for name in names), loss))
    return PublishedTable(
        tuple(rows),
        ranges,
        tuple(ends.measure(f"{name}_end", LENGTH, f"{name}_end_mm") or 0.0 for name in ranges),
        geometry.measure("inner_radius", LENGTH, "inner_radius_mm") or 0.0,
        geometry.measure("outer_radius", LENGTH, "outer_radius_mm") or 0.0,
        geometry.measure("thickness", LENGTH, "thickness_um") or 0.0,
        root.section("protocol").measure("step", LENGTH, "step_mm") or 0.0,
    )


def _load(path: Path) -> TextTable:
    return parse_table(read_text(path), str(path))


def _parameter_sets(table: TextTable) -> dict[tuple[str, str], dict[str, str]]:
    sets: dict[tuple[str, str], dict[str, str]] = {}
    for kind, column, name, value in _cells(table, ("material", "column", "parameter", "value")):
        sets.setdefault((kind, column), {})[name] = value
    return sets


def _losses(table: TextTable) -> dict[tuple[str, str, str], str]:
    return {(m, c, r): v for m, c, r, v in _cells(table, ("material", "column", "range", "loss_N"))}


def _cells(table: TextTable, names: tuple[str, ...]) -> list[tuple[str, ...]]:
    """The named columns as printed; the last of them must hold numbers."""
    for name in names:
        if name not in table.header:
            raise DataError(f'the column "{name}" is missing', f"{table.file}, line {table.header_line}")
    at = [table.header.index(name) for name in names]
    found = []
    for line, row in zip(table.lines, table.rows, strict=True):
        cells = tuple(row[i] if i < len(row) else "" for i in at)
        if number(cells[-1]) is None:
            raise DataError(f'"{cells[-1]}" is not a number', f"{table.file}, line {line}, column {names[-1]}")
        found.append(cells)
    return found
