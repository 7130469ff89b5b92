"""Numbers as machines write them: decimal marks, thousands, clock times; and what two marks say about a whole file."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

Cell = str | float
"""A cell of a text file, or a number of a workbook."""

LARGEST = 1e15
_SPACES = "\u00a0\u202f\u2009"
_LIKE_NUMBER = re.compile(
    r"[+-]?[\d][\d.,' \u00a0\u202f\u2009]*([eE][+-]?\d{1,4})?|[+-]?[.,]\d+([eE][+-]?\d{1,4})?", re.ASCII
)
_MINUS = str.maketrans({"\u2212": "-", "\u2013": "-", "\uff0c": ",", "\uff0e": "."})
_CLOCK = re.compile(r"(?:(\d{1,3}):)?([0-5]?\d):([0-5]?\d)(?:[.,](\d+))?", re.ASCII)
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(?:([., '])\d{3}(?:\1\d{3})*)", re.ASCII)
NOT_MEASURED = {"nan", "na", "n/a", "#n/a", "inf", "+inf", "-inf", "infinity", "null", "none", "---", "--", "-"}


@dataclass(frozen=True)
class Marks:
    """The decimal sign, and what may stand between thousands."""

    decimal: str = "."

    @cached_property
    def _pattern(self) -> re.Pattern[str]:
        d = re.escape(self.decimal)
        t = "[,' " if self.decimal == "." else "[.' "
        grouped = rf"\d{{1,3}}(?:({t}{_SPACES}])\d{{3}}(?:\1\d{{3}})*)?"
        return re.compile(rf"[+-]?(?:{grouped}|\d+)?(?:(?<=\d){d}\d*|{d}\d+)?(?:[eE][+-]?\d{{1,4}})?", re.ASCII)

    @cached_property
    def _plain(self) -> re.Pattern[str]:
        d = re.escape(self.decimal)
        return re.compile(rf"[+-]?(?:\d+{d}?\d*|{d}\d+)(?:[eE][+-]?\d{{1,4}})?", re.ASCII)

    def number(self, cell: Cell) -> float | None:
        """The finite number in a cell; None if there is none, or one beyond 1e15."""
        if isinstance(cell, float):
            return cell if math.isfinite(cell) and abs(cell) <= LARGEST else None
        if not self._plain.fullmatch(cell):
            cell = cell.translate(_MINUS)
            if not any(c.isdigit() for c in cell) or not self._pattern.fullmatch(cell):
                return None
            cell = re.sub(rf"[{',' if self.decimal == '.' else '.'}' {_SPACES}]", "", cell)
        value = float(cell.replace(",", ".") if self.decimal == "," else cell)
        return value if abs(value) <= LARGEST else None


POINT = Marks()
"""Numbers with a decimal point."""


def like_number(cell: Cell) -> bool:
    """True for a cell that is a number under some decimal sign."""
    return isinstance(cell, float) or bool(_LIKE_NUMBER.fullmatch(cell.translate(_MINUS)))


def clock(cell: Cell) -> float | None:
    """Seconds of a clock time, ``1:02:03.4`` or ``02:03,4``; None for anything else."""
    found = _CLOCK.fullmatch(cell) if isinstance(cell, str) else None
    if not found:
        return None
    hours, minutes, seconds, rest = found.groups()
    return 3600.0 * float(hours or 0) + 60.0 * float(minutes) + float(f"{seconds}.{rest or 0}")


def evidence(cells: Iterable[str]) -> tuple[dict[str, str], bool]:
    """(first cell that needs a decimal sign, by sign; whether some cell is open between decimals and thousands).

    ``0,5`` can only have a decimal comma and ``1.234,5`` too; ``1,234`` may have thousands; a date says nothing.
    """
    found: dict[str, str] = {}
    unclear = False
    for text in cells:
        last = max(text.rfind("."), text.rfind(","))
        if last < 0:
            continue
        sign, other = text[last], "," if text[last] == "." else "."
        if other in text[:last]:
            found.setdefault(sign, text)
        elif _GROUPED.fullmatch(text) and text.count(sign) > 1:  # 1.234.567
            found.setdefault(other, text)
        elif _GROUPED.fullmatch(text):
            unclear = True
        elif text.count(sign) == 1:
            found.setdefault(sign, text)
    return found, unclear
