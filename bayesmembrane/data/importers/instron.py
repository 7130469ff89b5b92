"""Instron Bluehill: tables of results, then the raw data of each specimen, units in brackets below their names."""

from __future__ import annotations

import re
from typing import ClassVar

from bayesmembrane.data.importers.base import TableImporter, head

_WORDS = re.compile(
    r"^\W*(?:results table|raw data|specimen raw data)\b|instron|bluehill", re.IGNORECASE | re.MULTILINE
)


class Instron(TableImporter):
    """Results are not readings; of several specimens one is chosen by ``--part``."""

    name: ClassVar[str] = "instron"
    title: ClassVar[str] = "Instron Bluehill text (Results Table, Raw Data)"
    example: ClassVar[bytes] = (
        b'"Results Table 1"\n"","Maximum Load","Extension at Break"\n"","(N)","(mm)"\n"1","1,130.00000","3.00000"\n\n'
        b'"Raw Data"\n"Time","Extension","Load"\n"(s)","(mm)","(N)"\n'
        b'"0.000","0.00000","0.00000"\n"1.000","1.00000","410.50000"\n"2.000","2.00000","1,000.06200"\n'
        b'"3.000","3.00000","1,130.00000"\n'
    )

    @staticmethod
    def recognises(data: bytes) -> bool:
        return bool(_WORDS.search(head(data)))
