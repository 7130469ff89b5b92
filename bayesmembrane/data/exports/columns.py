"""Which column is the time, the travel, the force, and in which unit: said, named by the file, or refused."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesmembrane.data.exports.blocks import ExportColumn, NumberBlock
from bayesmembrane.data.exports.cells import NOT_MEASURED, Cell, Marks, clock, like_number
from bayesmembrane.data.exports.hints import Guess, Hints, pairs_of
from bayesmembrane.data.exports.words import (
    CYCLE,
    QUANTITY,
    ROLES,
    STRAIN,
    STRETCH,
    TRAVEL,
    Reading,
    named,
    plain,
    reading_of,
    unit_of,
)
from bayesmembrane.ground.errors import DataError, SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.units import FORCE, LENGTH, RATIO, STRESS, TIME, UNITS, factor, to_si

TRUE, ENGINEERING = "true", "engineering"
_BARE = ("time", "zeit", "temps", "tiempo", "czas", "时间", "時間")
_OTHER_ROLE = {
    (TRAVEL, RATIO): STRAIN,
    (STRAIN, LENGTH): TRAVEL,
    (STRETCH, LENGTH): TRAVEL,
    (FORCE, STRESS): STRESS,
    (STRESS, FORCE): FORCE,
}
_ROLE_OF = {TIME: TIME, LENGTH: TRAVEL, FORCE: FORCE, STRESS: STRESS}
_ALIASES = {"displacement": TRAVEL, "deflection": TRAVEL, "extension": TRAVEL, "load": FORCE, "nominal_stress": STRESS}
_ALIKE = 1e-3
"""Columns that differ by no more than this part of their range are two copies of one signal."""


def example(width: int) -> str:
    """How ``--columns`` names so many columns."""
    return f"--columns {'travel_mm,force_N' if width == 2 else 'time_s,travel_mm,force_N'}"


@dataclass(frozen=True)
class PossibleColumn:
    """A column with what it seems to be: ``role``, unit as `ground.units` spells it ("" unknown), and how well."""

    column: ExportColumn
    role: str
    unit: str
    reading: Reading
    score: float

    @property
    def kind(self) -> str:
        """`TRUE`, `ENGINEERING` or "" if the name does not say."""
        return self.reading.kind


@dataclass(frozen=True)
class Read:
    """A column that is used, in SI, with the lines its values stand in."""

    column: ExportColumn
    unit: str
    kind: str
    values: Array


def candidates(block: NumberBlock, hints: Hints) -> list[PossibleColumn]:
    """What the columns of a block seem to be; by ``--columns`` if that says so."""
    if hints.columns and "=" not in hints.columns:
        return _by_position(block, hints)
    found = [c for c in (_candidate(column, hints) for column in block.columns) if c is not None]
    if not hints.columns:
        return [c for c in found if not _empty(c.column, block)]
    said = {k: _pointed(v, block) for k, v in pairs_of(hints.columns, "--columns").items()}
    return _replaced(found, said, hints)


def left_over(block: NumberBlock, used: Iterable[int], hints: Hints) -> list[PossibleColumn]:
    """The columns that are known and not ``used``, in their own units; none if ``--columns`` goes by their places."""
    if hints.columns and "=" not in hints.columns:
        return []
    rest = [c for c in block.columns if c.at not in used]
    found = []
    for column in rest:
        said = not column.unit or column.header.lower() in hints.pairs
        found.append(_candidate(column, hints if said else replace(hints, units="")))
    return [c for c in found if c is not None]


def has_curve(found: Iterable[PossibleColumn]) -> bool:
    """Whether there is something of how far and something of how hard."""
    roles = {c.role for c in found}
    return bool(roles & {TRAVEL, STRAIN, STRETCH}) and bool(roles & {FORCE, STRESS})


def best(
    found: Sequence[PossibleColumn], role: str, block: NumberBlock, kind: str | None = None
) -> PossibleColumn | None:
    """The column of a role, None if there is none; raises `DataError` where two serve as well."""
    of_role = [c for c in found if c.role == role and (kind is None or c.kind in kind.split("|"))]
    if not of_role:
        return None
    top = max(c.score for c in of_role)
    equal = [c for c in of_role if c.score == top]
    if len(equal) > 1 and role == TIME:  # "Time" beside "Video Time": the clock that needs no other word
        bare = [c for c in equal if plain(c.column.name) in _BARE]
        equal = bare if len(bare) == 1 else equal
    if len(equal) > 1 and not _alike(equal, block):
        names = " and ".join(f'"{c.column.header or c.column.at + 1}"' for c in equal[:4])
        first = equal[0].column
        raise DataError(
            f"the columns {names} may each be the {role}",
            block.place,
            f'say which, --columns "{role}={first.header or first.at + 1}"',
        )
    return equal[0]


def read(block: NumberBlock, chosen: PossibleColumn, rows: Sequence[int], hints: Hints) -> Read:
    """The values of a column in SI; raises `DataError` at the first cell that is no number, or for want of a unit."""
    quantity = QUANTITY[chosen.role]
    raw, is_clock = _numbers(block, chosen.column, rows)
    unit = "s" if is_clock and chosen.role == TIME else chosen.unit
    if not unit and chosen.role in (STRETCH, CYCLE):
        unit = "one"
    if not unit:
        _refuse_unit(chosen, block)
    scale = 1.0 if unit == "one" else factor(unit, quantity)
    return Read(chosen.column, "1" if unit == "one" else unit, chosen.kind, to_si(raw, scale))


def trimmed(block: NumberBlock, chosen: Iterable[PossibleColumn]) -> Sequence[int]:
    """The rows of a block without those at its end in which no chosen column has anything: others go on there."""
    at = [c.column.at for c in chosen]
    rows, end = block.rows, len(block.rows)
    while end > 0 and not any(_at(block.sheet.cells(rows[end - 1]), j) for j in at):
        end -= 1
    _check_width(block, rows[:end])
    return rows[:end]


def _check_width(block: NumberBlock, rows: Sequence[int]) -> None:
    """Raise `DataError` at a row with more cells than there are columns: two lines in one, or a sign too much."""
    if isinstance(block.sheet.raw[rows[0]] if rows else "", str) and block.header is not None:
        width = max(block.width, len(block.sheet.cells(block.header)))
        for row in rows:
            cells = block.sheet.cells(row)
            if len(cells) > width and any(c != "" for c in cells[width:]):
                fault = f"the line has {len(cells)} cells, and there are {width} columns"
                raise DataError(fault, block.sheet.place(row), "correct or remove the line")


def guess_of(role: str, chosen: PossibleColumn, hints: Hints) -> list[Guess]:
    """What was taken for a role, in which unit, and why."""
    header = chosen.column.header or f"column {chosen.column.at + 1}"
    said = bool(hints.columns)
    why = "--columns says so" if said else "its name says so" if chosen.score > 3 else "it alone has such a unit"
    unit = "1" if chosen.unit in ("", "one") else chosen.unit
    return [Guess(f"column of {role}", f'"{header}" in {unit}', why, f"--columns {role}=...")]


# ---- what a column seems to be ---------------------------------------------------------------------------------------


def _candidate(column: ExportColumn, hints: Hints) -> PossibleColumn | None:
    reading = reading_of(column.name)
    role = reading.role
    unit = _unit(column, role, hints)
    quantity = UNITS[unit].quantity if unit and unit in UNITS else RATIO if unit == "one" else ""
    if reading.aside:
        return None
    if role and quantity and QUANTITY[role] != quantity:
        role = _OTHER_ROLE.get((role, quantity), "")
    by_name = bool(role)
    if not role and quantity and not reading.role:
        role = _ROLE_OF.get(quantity, "")
    if not role:
        return None
    score = 10.0 + 3 * reading.standard - 3 * reading.absolute if by_name else 2.0
    if role == TIME and by_name and any(w in plain(column.name) for w in ("cycle", "segment", "step")):
        score -= 1
    if (
        role == TRAVEL
        and by_name
        and any(w in plain(column.name) for w in ("crosshead", "cross head", "traverse", "stroke"))
    ):
        score -= 1
    return PossibleColumn(column, role, unit, reading, score)


def _unit(column: ExportColumn, role: str, hints: Hints) -> str:
    said = {**hints.pairs}
    text = said.get(column.header.lower()) or said.get(role) or column.unit
    if not text:
        return ""
    return unit_of(text, QUANTITY[role] if role in (FORCE,) else "") or unit_of(text)


def _by_position(block: NumberBlock, hints: Hints) -> list[PossibleColumn]:
    names = [n.strip() for n in hints.columns.split(",")]
    if len(names) > len(block.columns):
        raise SettingsError(
            f"--columns names {len(names)} columns, and the file has {len(block.columns)}",
            remedy=f"write {example(len(block.columns))}",
        )
    found = []
    for name, column in zip(names, block.columns, strict=False):
        if name in ("", "-", "_"):
            continue
        said = named(name)
        role, kind = _role(said.name)
        unit = unit_of(said.unit, QUANTITY[role]) or _unit(column, role, hints)
        found.append(
            PossibleColumn(column._replace(header=column.header or name), role, unit, Reading(role, kind), 20.0)
        )
    return found


def _role(name: str) -> tuple[str, str]:
    low = name.strip().lower()
    reading = reading_of(low)
    role = low if low in ROLES else _ALIASES.get(low, reading.role)
    if not role:
        raise SettingsError(
            f'"{name}" in --columns is no kind of column', remedy=f"known: {', '.join(ROLES)}, - for none"
        )
    return role, reading.kind


def _pointed(text: str, block: NumberBlock) -> ExportColumn:
    """The column that a header or a number from 1 names."""
    exact = [c for c in block.columns if text.lower() in (c.header.lower(), c.name.lower())]
    if not exact and text.isdecimal():
        exact = [c for c in block.columns if c.at == int(text) - 1]
    if len(exact) != 1:
        shown = ", ".join(c.header or str(c.at + 1) for c in block.columns[:12])
        fault = "stands there more than once" if exact else "is none of its columns"
        raise SettingsError(f'"{text}" in --columns {fault}', remedy=f"name one of {shown}, or say its number from 1")
    return exact[0]


def _replaced(found: list[PossibleColumn], said: dict[str, ExportColumn], hints: Hints) -> list[PossibleColumn]:
    roles = {_role(name): column for name, column in said.items()}
    taken = {column.at for column in roles.values()}
    rest = [c for c in found if c.column.at not in taken and c.role not in {r for r, _ in roles}]
    out = []
    for (role, kind), column in roles.items():
        unit = _unit(column, role, hints)
        fits = unit == "one" or (unit in UNITS and UNITS[unit].quantity == QUANTITY[role])
        reading = reading_of(column.name)
        out.append(PossibleColumn(column, role, unit if fits else "", Reading(role, kind or reading.kind), 20.0))
    return rest + out


def _alike(equal: Sequence[PossibleColumn], block: NumberBlock) -> bool:
    """Whether columns hold the same signal, so that it does not matter which is taken."""
    columns = [[_at(block.sheet.cells(r), c.column.at) for r in block.rows] for c in equal]
    if len({c.unit for c in equal}) > 1:
        return False
    if all(c == columns[0] for c in columns[1:]):
        return True
    numbers = [[block.sheet.marks.number(cell) for cell in column] for column in columns]
    if any(value is None for column in numbers for value in column):
        return False
    values = np.array(numbers, dtype=float)
    return bool(np.max(np.abs(values - values[0])) <= _ALIKE * np.ptp(values[0]))


def _empty(column: ExportColumn, block: NumberBlock) -> bool:
    """True for a column that is named and has nothing in any row: a channel that was not connected."""
    return not any(_at(block.sheet.cells(row), column.at) for row in block.rows)


def _refuse_unit(chosen: PossibleColumn, block: NumberBlock) -> None:
    header = chosen.column.header or f"column {chosen.column.at + 1}"
    example = {TIME: "s", TRAVEL: "mm", FORCE: "N", STRESS: "MPa", STRAIN: "percent"}.get(chosen.role, "1")
    named_unit = f', and "{chosen.column.unit}" is none of it' if chosen.column.unit else ""
    fault = f'the column "{header}" names no unit of {QUANTITY[chosen.role]}{named_unit}'
    others = "mm/mm, 1 or ratio, whichever it is" if QUANTITY[chosen.role] == RATIO else "what it is"
    raise DataError(fault, block.place, f"say --units {chosen.role}={example}, or {others}")


# ---- numbers ---------------------------------------------------------------------------------------------------------


def _at(cells: Sequence[Cell], index: int) -> Cell:
    return cells[index] if index < len(cells) else ""


def _numbers(block: NumberBlock, column: ExportColumn, rows: Sequence[int]) -> tuple[Array, bool]:
    """The numbers of a column, and whether they are clock times in s."""
    sheet, marks = block.sheet, block.sheet.marks
    out = np.empty(len(rows))
    plain_large = grouped = -1
    first = _at(sheet.cells(rows[0]), column.at) if rows else ""
    is_clock = clock(first) is not None
    for k, row in enumerate(rows):
        cell = _at(sheet.cells(row), column.at)
        if sheet.doubt is not None and isinstance(cell, str) and like_number(cell) and not is_clock:
            raise sheet.doubt
        value = clock(cell) if is_clock else marks.number(cell)
        if value is None:
            raise _no_number(cell, f"{sheet.place(row)}, column {column.header or column.at + 1}", marks.decimal)
        out[k] = value
        if isinstance(cell, str) and abs(value) >= 1000 and not is_clock:
            if any(c in cell for c in ("." if marks.decimal == "," else ",", " ", "'", "\u00a0", "\u202f")):
                grouped = row
            elif "e" not in cell.lower():
                plain_large = row
    if grouped >= 0 and plain_large >= 0:
        cell = _at(sheet.cells(grouped), column.at)
        fault = f'"{cell}" has a sign between thousands, and other numbers of its column have none'
        raise DataError(fault, f"{sheet.place(grouped)}, column {column.header}", "correct it, or say --decimal")
    return out, is_clock


def _no_number(cell: Cell, where: str, decimal: str) -> DataError:
    shown = str(cell) if len(str(cell)) <= 40 else str(cell)[:37] + "..."
    if shown == "":
        return DataError("the cell is empty", where, "fill it or remove the line")
    if shown.lower() in NOT_MEASURED:
        return DataError(f'"{shown}" is not a measured value', where, "remove the line")
    wanted, other = ("1.5", "comma") if decimal == "." else ("1,5", "point")
    if Marks("." if other == "point" else ",").number(cell) is not None:
        remedy = f"say --decimal {other} if all are written so, or correct the line"
        return DataError(f'"{shown}" is not a number like {wanted}', where, remedy)
    return DataError(f'"{shown}" is not a number', where, f"numbers here are like {wanted}: correct or remove the line")
