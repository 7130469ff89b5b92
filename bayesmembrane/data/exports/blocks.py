"""Where the numbers of a sheet stand, what stands above them, and what the rest of a file says of the specimen."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from bayesmembrane.data.exports.cells import Cell, clock, like_number
from bayesmembrane.data.exports.sheets import Sheet
from bayesmembrane.data.exports.words import FACTS, NAME, area_of, fact_of, named, plain, reading_of, unit_of
from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.units import factor, to_si

ABOVE = 4
"""Rows above the numbers among which their names and units are looked for."""


class ExportColumn(NamedTuple):
    """A column: where it stands, its header as it is, its name and its unit ("" if the file names none)."""

    at: int
    header: str
    name: str
    unit: str


@dataclass(frozen=True)
class NumberBlock:
    """Numbers that belong together.

    sheet, rows : where they stand
    columns : what stands above them
    header : row of the names, None if there are none
    label : what the file calls these readings, "" if nothing
    numbers : in which columns of the sheet its rows have numbers
    """

    sheet: Sheet
    rows: Sequence[int]
    columns: tuple[ExportColumn, ...]
    header: int | None
    label: str = ""
    numbers: frozenset[int] = frozenset()

    @property
    def width(self) -> int:
        """How many columns the sheet has here, those of other specimens included."""
        return max((len(self.sheet.cells(r)) for r in self.rows[:20]), default=0)

    @property
    def place(self) -> str:
        """File and line of the header, or of the first number."""
        return self.sheet.place(self.header if self.header is not None else self.rows[0])


class Fact(NamedTuple):
    """What a line says of specimen or test: one of `FACTS`, its value in SI, its words, and where it stands."""

    name: str
    value: float
    words: str
    place: str


@dataclass(frozen=True)
class _RunOfRows:
    start: int
    stop: int
    at: frozenset[int]


def blocks_of(sheet: Sheet) -> list[NumberBlock]:
    """The blocks of numbers of a sheet, in its order; raises `DataError` for text within one."""
    found: list[NumberBlock] = []
    runs = list(_runs(sheet))
    for k, run in enumerate(runs):
        above = runs[k - 1].stop if k else 0
        header, columns, label = _above(sheet, run, above)
        block = NumberBlock(sheet, range(run.start, run.stop), columns, header, label, run.at)
        before = found[-1] if found else None
        if before is not None and k and header is None and _goes_on(runs[k - 1], run):
            _refuse_text(sheet, runs[k - 1].stop)
        found.append(block)
    return [part for block in _joined(found) for part in _side_by_side(block)]


def names_beyond(block: NumberBlock) -> list[str]:
    """What the names call the columns of text to the right of all numbers."""
    if block.header is None or block.sheet.delimiter == " " or not any(c.header for c in block.columns):
        return []
    return [str(c) for c in block.sheet.cells(block.header)[max(block.numbers) + 1 :] if c != ""]


def _runs(sheet: Sheet) -> Iterator[_RunOfRows]:
    """Rows of numbers that follow each other."""
    start, at = 0, frozenset[int]()
    for row in range(len(sheet)):
        cells = sheet.cells(row)
        numbers = frozenset(j for j, c in enumerate(cells) if c != "" and _numeric(sheet, c))
        others = sum(1 for c in cells if c != "") - len(numbers)
        is_data = len(numbers) >= 2 and others <= len(numbers)
        goes_on = is_data and bool(at) and len(numbers & at) >= max(2, 0.5 * min(len(at), len(numbers)))
        if goes_on:
            at |= numbers
            continue
        if at:
            yield _RunOfRows(start, row, at)
        start, at = row, (numbers if is_data else frozenset())
    if at:
        yield _RunOfRows(start, len(sheet), at)


def _numeric(sheet: Sheet, cell: Cell) -> bool:
    return (
        isinstance(cell, float) or sheet.marks.number(cell) is not None or like_number(cell) or clock(cell) is not None
    )


def _goes_on(before: _RunOfRows, run: _RunOfRows) -> bool:
    return before.stop - before.start >= 2 and run.stop - run.start >= 1 and before.at == run.at


def _refuse_text(sheet: Sheet, row: int) -> None:
    shown = " ".join(str(c) for c in sheet.cells(row) if c != "")[:60]
    raise DataError(f'"{shown}" stands within the numbers', sheet.place(row), "correct or remove the line")


def _above(sheet: Sheet, run: _RunOfRows, top: int) -> tuple[int | None, tuple[ExportColumn, ...], str]:
    """(row of the names, columns, label) of a run, from the rows between ``top`` and its first."""
    row, units = run.start - 1, None
    if row >= top and _is_units(sheet.cells(row)):
        units, row = row, row - 1
    names = next((r for r in range(row, max(top, row - ABOVE) - 1, -1) if _knows(sheet.cells(r))), None)
    if names is None and row >= top and _could_name(sheet.cells(row)):
        names = row
    if names is not None and units is None and names - 1 >= top and _is_units(sheet.cells(names - 1)):
        units = names - 1
    width = max(run.at) + 1
    head = _padded(_names(sheet, names, width), width) if names is not None else [""] * width
    beside = _padded(sheet.cells(units), width) if units is not None else [""] * width
    columns = tuple(_column(j, str(head[j]), str(beside[j])) for j in range(width) if head[j] != "" or j in run.at)
    label = _label(sheet, names, top)
    return (names if names is not None else units), columns, label


def _names(sheet: Sheet, row: int, width: int) -> Sequence[Cell]:
    """The names above ``width`` columns of numbers; raises `DataError` where it is open which name is whose."""
    cells, raw = sheet.cells(row), sheet.raw[row]
    if sheet.delimiter == " " and isinstance(raw, str) and len(cells) != width:
        cells = [c.strip() for c in re.split(r"\t+|\s{2,}", raw.strip("# \t"))]
    fewer = len(cells) < width
    if fewer or (sheet.delimiter == " " and len(cells) != width):
        commas = ", as decimal commas would cause" if sheet.delimiter == "," and width == 2 * len(cells) else ""
        fault = f"{len(cells)} names stand above {width} columns of numbers{commas}"
        raise DataError(
            fault, sheet.place(row), "name them in their order, --columns time_s,travel_mm,force_N; or say --delimiter"
        )
    return cells


def _column(index: int, header: str, beside: str) -> ExportColumn:
    name, unit = named(header)
    beside = beside.strip("[]() ")
    if unit_of(beside) and not unit_of(unit):  # "Tensile strain (Extension)" above "(mm/mm)"
        return ExportColumn(index, header, name, beside)
    return ExportColumn(index, header, name, unit or beside)


def _padded(cells: Sequence[Cell], width: int) -> list[Cell]:
    return [*cells, *[""] * (width - len(cells))]


def _is_units(cells: Sequence[Cell]) -> bool:
    """True for a row of units: more than half of its cells are, or all stand in brackets."""
    full = [c for c in cells if isinstance(c, str) and c]
    units = sum(bool(unit_of(c) or (c[0] in "[(" and c[-1] in ")]")) for c in full)
    return len(full) == sum(1 for c in cells if c != "") and units > 0.5 * len(full)


def _knows(cells: Sequence[Cell]) -> bool:
    """True for a row that names two things, or one beside a known unit."""
    known = 0
    for cell in cells:
        if isinstance(cell, str) and cell and len(cell) < 80:
            name = named(cell)
            known += bool(reading_of(name.name).role) or bool(name.unit and unit_of(name.unit))
    return known >= 2


def _could_name(cells: Sequence[Cell]) -> bool:
    """True for two words or more and no number."""
    full = [c for c in cells if c != ""]
    return len(full) >= 2 and not any(isinstance(c, float) or like_number(c) for c in full)


def _label(sheet: Sheet, names: int | None, top: int) -> str:
    """What stands above the names, if it is one word for all columns."""
    if names is None or names - 1 < top:
        return ""
    full = {str(c) for c in sheet.cells(names - 1) if c != ""}
    return full.pop()[:60] if len(full) == 1 else ""


def _joined(blocks: list[NumberBlock]) -> list[NumberBlock]:
    """Blocks under the same header and label, one after the other, are pages of one table."""
    out: list[NumberBlock] = []
    for block in blocks:
        same = bool(out) and block.header is not None and out[-1].columns == block.columns
        if same and out[-1].label == block.label and _pages(out[-1], block):
            out[-1] = replace(out[-1], rows=[*out[-1].rows, *block.rows])
        else:
            out.append(block)
    return out


def _pages(first: NumberBlock, second: NumberBlock) -> bool:
    """Whether the time goes on from the one to the other."""
    sheet = first.sheet
    at = next((c.at for c in first.columns if reading_of(c.name).role == "time"), None)
    if at is None:
        return False
    before, after = (_padded(sheet.cells(r), at + 1)[at] for r in (first.rows[-1], second.rows[0]))
    a, b = sheet.marks.number(before), sheet.marks.number(after)
    return a is not None and b is not None and b > a


def _side_by_side(block: NumberBlock) -> list[NumberBlock]:
    """The groups of columns of several specimens beside each other; the block itself if there is one."""
    names = [plain(c.name) for c in block.columns]
    starts = [k for k, name in enumerate(names) if name and name == names[0]]
    if len(starts) < 2:
        return [block]
    groups = [block.columns[a:b] for a, b in zip(starts, [*starts[1:], len(names)], strict=True)]
    if len({tuple(plain(c.name) for c in g if c.name) for g in groups}) != 1:
        return [block]
    labels = _group_labels(block, groups)
    return [replace(block, columns=g, label=label) for g, label in zip(groups, labels, strict=True)]


def _group_labels(block: NumberBlock, groups: list[tuple[ExportColumn, ...]]) -> list[str]:
    if block.header is None or block.header == 0:
        return [f"columns {g[0].at + 1} to {g[-1].at + 1}" for g in groups]
    above = _padded(block.sheet.cells(block.header - 1), groups[-1][-1].at + 1)
    labels = [next((str(above[c.at]) for c in g if above[c.at] != ""), "") for g in groups]
    if len(set(labels)) == len(labels) and all(labels):
        return labels
    return [f"columns {g[0].at + 1} to {g[-1].at + 1}" for g in groups]


# ---- what the rest says ----------------------------------------------------------------------------------------------


def facts_of(sheet: Sheet, used: set[int], labels: Sequence[str] = ()) -> tuple[list[Fact], list[str]]:
    """(facts, remarks on what names no unit) of the rows that are not ``used``; ``labels`` of the specimen, if any."""
    rows = [r for r in range(len(sheet)) if r not in used][:2000]
    facts: list[Fact] = []
    remarks: list[str] = []
    for r in rows:
        for fact in _of_line(sheet, r):
            if isinstance(fact, Fact):
                facts.append(fact)
            else:
                remarks.append(fact)
        facts.extend(_of_table(sheet, r, labels))
    return facts, remarks


def name_in(sheet: Sheet, used: set[int]) -> str:
    """The name of the specimen, if a line of the preamble says it."""
    for r in range(min(len(sheet), 200)):
        if r in used:
            continue
        cells = [str(c) for c in sheet.cells(r) if c != ""]
        if len(cells) == 1 and ":" in cells[0]:
            cells = [x.strip() for x in cells[0].split(":", 1)]
        words = [plain(w) for w in (cells[0], cells[0].rpartition(" : ")[2])] if len(cells) == 2 else []
        if any(NAME.fullmatch(w) for w in words) and cells[1].strip():
            return cells[1].strip()[:60]
    return ""


def _of_line(sheet: Sheet, row: int) -> Iterator[Fact | str]:
    cells = [c for c in sheet.cells(row) if c != ""]
    if cells and len(cells) == 1 and isinstance(cells[0], str) and (":" in cells[0] or "=" in cells[0]):
        cells = [x.strip() for x in cells[0].replace("=", ":").split(":", 1)]
    if not (2 <= len(cells) <= 4) or not isinstance(cells[0], str):
        return
    name = fact_of(cells[0])
    if not name:
        return
    value, unit = _value(sheet, cells[1])
    unit = unit or (str(cells[2]) if len(cells) > 2 else "") or named(cells[0]).unit
    if value is None or value <= 0:
        return
    scale = _scale(name, unit)
    if scale is None:
        yield f'"{cells[0].strip(": ")} {value:g}" names no unit that is known and is not used'
        return
    yield Fact(name, to_si(value, scale), f"{cells[0].strip(': ')} {value:g} {unit}".strip(), sheet.line(row))


def _of_table(sheet: Sheet, row: int, labels: Sequence[str]) -> Iterator[Fact]:
    """Facts of a table of results: names in this row, units in it or below, one line of values or that of a label."""
    cells = sheet.cells(row)
    wanted = {j: fact_of(c) for j, c in enumerate(cells) if isinstance(c, str) and c and fact_of(c)}
    if not wanted or row + 1 >= len(sheet) or sum(isinstance(c, str) and c != "" for c in cells) < 2:
        return
    width = len(cells)
    below = _padded(sheet.cells(row + 1), width)
    has_units = any(isinstance(below[j], str) and _scale(n, str(below[j])) for j, n in wanted.items())
    first = row + 2 if has_units else row + 1
    values = [(r, _padded(sheet.cells(r), width)) for r in range(first, min(first + 50, len(sheet)))]
    values = [(r, v) for r, v in values if any(_value(sheet, v[j])[0] is not None for j in wanted)]
    named_so = [(r, v) for label in labels for r, v in values if label in [str(c) for c in v]]
    chosen = named_so or (values if len(values) == 1 else [])
    for r, v in chosen[:1]:
        for j, name in wanted.items():
            value, unit = _value(sheet, v[j])
            unit = unit or named(str(cells[j])).unit or (str(below[j]) if has_units else "")
            scale = _scale(name, unit)
            if value is not None and value > 0 and scale is not None:
                yield Fact(name, to_si(value, scale), f"{cells[j]} {value:g} {unit}".strip(), sheet.line(r))


def _value(sheet: Sheet, cell: Cell) -> tuple[float | None, str]:
    """(number, unit) of a cell like ``25`` or ``25 mm``."""
    if isinstance(cell, float):
        return sheet.marks.number(cell), ""
    words = cell.split()
    number = sheet.marks.number(words[0]) if words else None
    if number is None and words and like_number(words[0]):  # preambles may differ from tables in their decimal sign
        text = words[0].replace(",", ".")
        number = float(text) if text.count(".") == 1 and text.replace(".", "").isdigit() else None
    return (number, words[1]) if number is not None and len(words) == 2 else (number if len(words) == 1 else None, "")


def _scale(name: str, unit: str) -> float | None:
    """Factor of a unit to SI, None if it is none of the fact's quantity."""
    quantity = FACTS[name][0]
    if quantity == "area":
        return area_of(unit)
    spelled = unit_of(unit, quantity)
    return factor(spelled, quantity) if spelled and spelled != "one" else None
