"""The export of a small tensile tester: lines of micrometres and millinewtons under a line with its name."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from bayesmembrane.data.importers.base import Imported, Importer
from bayesmembrane.data.tables import number
from bayesmembrane.ground.errors import DataError

HEAD = b"MICROTESTER 2\n"


class Micrometres(Importer):
    """``MICROTESTER 2``, then on each line a deflection in um and a force in mN, separated by a blank."""

    name: ClassVar[str] = "micrometres"
    title: ClassVar[str] = "lines of um and mN under the line MICROTESTER 2"
    example: ClassVar[bytes] = HEAD + b"1000 12.5\n2000 47.5\n3000 130\n"

    @staticmethod
    def recognises(data: bytes) -> bool:
        return data.startswith(HEAD)

    @staticmethod
    def read(data: bytes, file: str) -> Imported:
        rows = []
        for line, text in enumerate(data.decode("utf-8", errors="replace").splitlines()[1:], 2):
            values = [number(word) for word in text.split()]
            if len(values) != 2 or values[0] is None or values[1] is None:
                raise DataError("two numbers are expected", f"{file}, line {line}", "write deflection and force")
            rows.append((values[0], values[1]))
        if len(rows) < 2:
            raise DataError("a curve needs at least two points", file, "export the measurement again")
        deflection, force = np.array(rows).T
        return Imported({"deflection": 1e-6 * deflection, "force": 1e-3 * force}, f"imported from {file}")
