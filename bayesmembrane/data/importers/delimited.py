"""Any table of numbers below the names of its columns: what machines have in common."""

from __future__ import annotations

from typing import ClassVar

from bayesmembrane.data.exports.sheets import is_text
from bayesmembrane.data.importers.base import TableImporter
from bayesmembrane.ground.registry import components


class Delimited(TableImporter):
    """Names, perhaps units below them, then lines of numbers; whatever stands above is searched for film and test."""

    name: ClassVar[str] = "delimited"
    title: ClassVar[str] = "text with named columns, whatever separates them, in any of six languages"
    example: ClassVar[bytes] = b"Zeit [s];Weg [mm];Kraft [mN]\n0;0;0,25\n1;1,5;47,5\n2;2,5;130,0\n"
    last: ClassVar[bool] = True

    @staticmethod
    def recognises(data: bytes) -> bool:
        if not data.strip() or not is_text(data):
            return False
        others = (i for i in components("importers").values() if i is not Delimited)
        return not any(importer.recognises(data) for importer in others)
