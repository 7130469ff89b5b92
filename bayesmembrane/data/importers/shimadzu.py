"""Shimadzu Trapezium: the readings of several specimens beside each other, their names above, units below."""

from __future__ import annotations

import re
from typing import ClassVar

from bayesmembrane.data.importers.base import TableImporter, head

_WORDS = re.compile(r"trapezium|shimadzu|autograph|^\W*1 ?_ ?1\W", re.IGNORECASE | re.MULTILINE)


class Shimadzu(TableImporter):
    """``"1 _ 1"`` names the first specimen of the first batch; one is chosen by ``--part``."""

    name: ClassVar[str] = "shimadzu"
    title: ClassVar[str] = "Shimadzu Trapezium text"
    example: ClassVar[bytes] = (
        b'"1 _ 1","",""\n"Time","Force","Stroke"\n"sec","N","mm"\n'
        b'"0","0.001","0"\n"0.5","0.0475","0.5"\n"1","0.130","1"\n'
    )

    @staticmethod
    def recognises(data: bytes) -> bool:
        return bool(_WORDS.search(head(data)))
