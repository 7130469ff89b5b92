"""Zwick testXpert: ``"key"<sep>value<sep>"unit"`` lines, names and units in quotes, then numbers (.TRA, .csv)."""

from __future__ import annotations

import re
from typing import ClassVar

from bayesmembrane.data.importers.base import TableImporter, head

_WORDS = re.compile(
    r"testxpert|\"Standard ?(?:weg|kraft|travel|force|course)"
    r"|\"(?:Course|Force|Allongement|Recorrido|Fuerza) (?:standard|est)",
    re.IGNORECASE,
)


class Zwick(TableImporter):
    """The standard travel and force are those that testXpert evaluates; ``Traverse abs.`` is a position."""

    name: ClassVar[str] = "zwick"
    title: ClassVar[str] = "Zwick testXpert text (.TRA, .csv)"
    example: ClassVar[bytes] = (
        b'"Probendicke a0"\t0.05\t"mm"\n"Pr\xfcfgeschwindigkeit"\t60\t"mm/min"\n'
        b'"Pr\xfcfzeit"\t"Standardweg"\t"Standardkraft"\t"Traverse abs."\n"s"\t"mm"\t"N"\t"mm"\n'
        b"0.00\t0\t0.001\t785.1\n1.00\t1.001\t0.0475\t786.1\n2.00\t2.001\t0.130\t787.1\n"
    )

    @staticmethod
    def recognises(data: bytes) -> bool:
        return bool(_WORDS.search(head(data)))
