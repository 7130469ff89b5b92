"""Which table of a file is the test: by its sheet, its names, its length, or as the user says."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from bayesmembrane.data.exports.blocks import Fact, NumberBlock, blocks_of, facts_of, name_in
from bayesmembrane.data.exports.columns import PossibleColumn, candidates, example, has_curve
from bayesmembrane.data.exports.hints import Hints
from bayesmembrane.data.exports.sheets import Sheet
from bayesmembrane.data.exports.words import STRAIN, STRETCH, TRAVEL, names_result
from bayesmembrane.ground.errors import DataError, SettingsError
from bayesmembrane.ground.units import FORCE, STRESS

RESULTS = 30
"""Fewer lines with a maximum, a modulus or a break among their names are results, one line a specimen."""


def part(
    sheets: Sequence[Sheet], file: str, hints: Hints
) -> tuple[NumberBlock, list[PossibleColumn], list[NumberBlock]]:
    """(the table of the test, what its columns seem to be, all tables); raises `DataError` where that is open."""
    if hints.sheet:
        sheets = [s for s in sheets if s.name == hints.sheet] or _no_sheet(sheets, hints.sheet)
    blocks = [block for sheet in sheets for block in blocks_of(sheet)]
    blocks_with_rows = [b for b in blocks if len(b.rows) >= 2]
    if not blocks_with_rows:
        line = f", line {sheets[0].lines[0]}" if sheets and len(sheets[0]) else ""
        fault = "no two lines with at least two numbers follow each other"
        raise DataError(fault, f"{file}{line}", "export the readings, not only the results; or say --delimiter")
    largest = max(blocks_with_rows, key=lambda b: len(b.rows))
    judged = [(b, _judged(b, hints, b is largest)) for b in blocks_with_rows]
    parts = [(b, c) for b, c in judged if has_curve(c) and len(b.rows) >= 0.02 * len(largest.rows)]
    if not parts or len(largest.rows) > 5 * max(len(b.rows) for b, _ in parts):
        _refuse_columns(largest, hints)
    if len(parts) > 1:
        return *_chosen(parts, file, hints), blocks
    return *parts[0], blocks


def _judged(block: NumberBlock, hints: Hints, largest: bool) -> list[PossibleColumn]:
    """Candidates; ``--columns`` is about the blocks that it fits."""
    if not hints.columns:
        return candidates(block, hints)
    try:
        return candidates(block, hints)
    except SettingsError:
        if largest:
            raise
        return []


def _chosen(
    parts: list[tuple[NumberBlock, list[PossibleColumn]]], file: str, hints: Hints
) -> tuple[NumberBlock, list[PossibleColumn]]:
    labels = _labels([b for b, _ in parts])
    numbers = [str(k) for k in range(1, len(parts) + 1)]
    for names in (numbers, labels, [b.sheet.name for b, _ in parts]):
        if hints.part and names.count(hints.part) == 1:
            return parts[names.index(hints.part)]
    shown = ", ".join(f"{k}: {label}" for k, label in enumerate(labels[:20], 1))
    fault = f'there is no part "{hints.part}"' if hints.part else f"the file has {len(parts)} sets of readings"
    raise DataError(f"{fault} ({shown})", file, "say which, --part 1 or its name")


def _labels(blocks: list[NumberBlock]) -> list[str]:
    labels = [b.label or b.sheet.name or f"line {b.sheet.lines[b.rows[0]]}" for b in blocks]
    if len(set(labels)) == len(labels):
        return labels
    return [f"{label}, line {b.sheet.lines[b.rows[0]]}" for label, b in zip(labels, blocks, strict=True)]


def _no_sheet(sheets: Sequence[Sheet], name: str) -> Any:
    raise SettingsError(f'there is no sheet "{name}"', remedy=f"known: {', '.join(s.name for s in sheets)}")


def _refuse_columns(block: NumberBlock, hints: Hints) -> None:
    names = [c.header for c in block.columns if c.header]
    n = len(block.columns)
    if not names:
        fault = f"nothing above the {n} columns of numbers names them"
        raise DataError(
            fault, block.place, f"name them in their order, {example(n)}, with - for one that is not needed"
        )
    found = candidates(block, hints)
    roles = {c.role for c in found}
    missing = "how far the film was pulled" if roles & {FORCE, STRESS} else "the force or stress"
    missing = missing if roles & {FORCE, STRESS, TRAVEL, STRAIN, STRETCH} else "travel and force"
    shown = ", ".join(names[:12])
    if len(block.rows) < RESULTS and sum(names_result(c.name) for c in block.columns) >= 2:
        fault = f"the {len(block.rows)} lines of numbers seem to be results of whole tests ({shown})"
        raise DataError(fault, block.place, f"export the readings of a test (raw data), or name them, {example(n)}")
    fault = f"no column is known to hold {missing} among {shown}"
    raise DataError(fault, block.place, f"name them, {example(n)}")


def facts_beside(
    sheets: Sequence[Sheet], blocks: Sequence[NumberBlock], block: NumberBlock
) -> tuple[list[Fact], list[str], str]:
    """(facts, remarks, name of the specimen) of all that is no table of readings, the test's own sheet first."""
    facts: list[Fact] = []
    remarks: list[str] = []
    name = ""
    labels = [label for label in (block.label, block.sheet.name) if label]
    for sheet in sorted(sheets, key=lambda s: s is not block.sheet):
        used = {r for b in blocks if b.sheet is sheet and len(b.rows) > 1 and b.header is not None for r in b.rows}
        used |= set(block.rows) if sheet is block.sheet else set()
        more, said = facts_of(sheet, used, labels)
        facts += more
        remarks += said
        name = name or name_in(sheet, used)
    return facts, remarks, block.label if not name and block.label and "column" not in block.label else name
