"""Cyclic tests of VHB 4910, read where they lie: nominal stress and stretch of strips, as force and deflection."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.reading import curve_columns
from bayesmembrane.data.tables import parse_table, read_text
from bayesmembrane.diagnosis.reference.noise import orthonormal
from bayesmembrane.diagnosis.reference.smooth import smooth_reference
from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.rigs.uniaxial import Uniaxial

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "data" / "effects"
FAST = "vhb4910_miles.csv"
RIG, TAPE = Uniaxial(), Specimen("VHB 4910", 1e-3)
"""The tape is 1 mm thick. Length and width of the strips are not told; stresses and stretches do not depend on them."""

_NAME = re.compile(r"loading_(\d)d(\d+)_unloading_(\d)d(\d+)\.xlsx")


@dataclass(frozen=True, eq=False)
class Cycle:
    """One loading and unloading of a strip to the stretch ``peak``, both at ``rate`` 1/s."""

    peak: float
    rate: float
    measurement: Measurement


def cycles(folder: Path = FOLDER) -> list[Cycle]:
    """All cycles of a folder, by peak and rate."""
    found = [read_cycle(p) for p in folder.glob("*.xlsx") if _NAME.fullmatch(p.name)]
    return sorted(found, key=lambda c: (c.peak, c.rate))


def read_cycle(path: Path) -> Cycle:
    """A workbook without a header: time s, stretch, nominal stress kPa; its name tells peak and rate.

    Raises `DataError` if the name or the columns are others.
    """
    name = _NAME.fullmatch(path.name)
    if name is None:
        raise DataError("the name does not tell peak and rate", str(path), "loading_1d5_unloading_0d03.xlsx means 1.5")
    table = pd.read_excel(path, header=None, engine="openpyxl").to_numpy(dtype=float)
    if table.shape[1] != 3 or not np.all(np.isfinite(table)):
        raise DataError("three columns of numbers are expected", str(path))
    time, stretch, stress = table.T
    found = RIG.from_columns({"stretch": stretch, "nominal_stress": 1e3 * stress}, TAPE.thickness)
    a, b, c, d = name.groups()
    return Cycle(float(f"{a}.{b}"), float(f"{c}.{d}"), Measurement(rig=RIG, specimen=TAPE, time=time, **found))


def fast_cycle(folder: Path = FOLDER) -> Measurement:
    """The quick cycle to a stretch of 5.4 of another laboratory."""
    path = folder / FAST
    found, _ = curve_columns(parse_table(read_text(path), str(path)), RIG.columns)
    return Measurement(rig=RIG, specimen=TAPE, **RIG.from_columns(found, TAPE.thickness))


def kPa(force: Array | float) -> Array:
    """Nominal stress in kPa of forces in N."""
    return np.asarray(force) / (RIG.width * TAPE.thickness) / 1e3


def scatter(measurement: Measurement) -> float:
    """kPa: standard deviation of what a saturated reference leaves, correlation left aside."""
    q = orthonormal(smooth_reference(measurement))
    rest = measurement.force - q @ (q.T @ measurement.force)
    return float(kPa(np.sqrt(np.sum(rest**2) / (rest.size - q.shape[1]))))


def even(cycle: Cycle) -> float:
    """Largest |dt rate / |d stretch| - 1| of all steps: 0 where times were calculated from the stretch."""
    m = cycle.measurement
    assert m.time is not None
    return float(np.max(np.abs(cycle.rate * np.diff(m.time) * RIG.length / np.abs(np.diff(m.deflection)) - 1)))


def loading(measurement: Measurement) -> tuple[Array, Array]:
    """(stretch, nominal stress in kPa) of the loading leg."""
    up = measurement.leg > 0
    return 1 + measurement.deflection[up] / RIG.length, kPa(measurement.force[up])


def difference(a: Measurement, b: Measurement, points: int = 100) -> float:
    """kPa: root mean square difference of two loading legs over the stretches that both have."""
    (x, p), (y, q) = loading(a), loading(b)
    at = np.linspace(max(x.min(), y.min()), min(x.max(), y.max()), points)
    return float(np.sqrt(np.mean((np.interp(at, x, p) - np.interp(at, y, q)) ** 2)))
