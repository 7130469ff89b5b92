"""MTS: the text of MTS 793, whose first line says its decimal sign, and of TestSuite and TestWorks."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

from bayesmembrane.data.exports.hints import Hints
from bayesmembrane.data.exports.sheets import Sheet
from bayesmembrane.data.importers.base import TableImporter, head

_WORDS = re.compile(r"\AMTS\d{3}\||MTS (?:TestSuite|TestWorks|Systems)|TestWorks \d", re.IGNORECASE)
_FIRST = re.compile(r"\AMTS\d{3}\|[^|\n]*\|[^|\n]*\|[^|\n]*\|[^|\n]*\|(?P<decimal>[.,])\|")


class Mts(TableImporter):
    """``MTS793|MPT|DEU|x|x|,|.|...``: decimal sign and thousands in the first line; a set point is no reading."""

    name: ClassVar[str] = "mts"
    title: ClassVar[str] = "MTS 793, TestSuite and TestWorks text"
    example: ClassVar[bytes] = (
        b"MTS793|MPT|DEU|x|x|,|.|:|49|1|1|A\n\nDatenerfassung\t\t\tZeit:\t3,5\ts\n"
        b"Laufzeit\tCh 1 Kraft Sollwert\tCh 1 Kraft\tCh 1 Weg\ns\tkN\tkN\tmm\n"
        b"79,5\t0\t0,0001\t0,01\n80,5\t0,4\t0,4105\t1,01\n81,5\t0,9\t0,9002\t2,01\n"
    )

    @staticmethod
    def recognises(data: bytes) -> bool:
        return bool(_WORDS.search(head(data)))

    @classmethod
    def sheets(cls, data: bytes, file: str, hints: Hints) -> Sequence[Sheet]:
        said = _FIRST.match(head(data, 200))
        if said is None or hints.decimal:
            return super().sheets(data, file, hints)
        decimal = "comma" if said["decimal"] == "," else "point"
        return [_by_first_line(s) for s in super().sheets(data, file, replace(hints, decimal=decimal))]


def _by_first_line(sheet: Sheet) -> Sheet:
    why = "the first line says so"
    return replace(sheet, guesses=tuple(g._replace(why=why) if g.what == "decimal sign" else g for g in sheet.guesses))
