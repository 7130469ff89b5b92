"""Sizes in the units that people read on a rig."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.thresholds import WORDS

Units = Mapping[str, tuple[float, str]]
"""By SI unit, (factor, unit) in which people read it: `Fixture.shown`."""

SCALES: Units = {"m": (1e3, "mm"), "m/N": (1e3, "mm/N"), "N": (1e3, "mN"), "N/s": (1e3, "mN/s")}
"""Those of a lifted disc."""


NOTHING_LEFT = 1e-30
"""Below it a size in any unit is what a search left at a bound: none."""


def read_as(shown: Units) -> dict[str, dict[str, float | str]]:
    """By SI unit, the factor and the unit in which this rig's numbers are read, as plain values."""
    return {unit: {"factor": factor, "unit": name} for unit, (factor, name) in shown.items()}


def read_as_by_test(tests: Iterable[tuple[str, Measurement]]) -> dict[str, dict[str, dict[str, float | str]]]:
    """`read_as` of each test of a joint answer, by its label: each has a rig and a thickness of its own."""
    return {label: read_as(m.rig.shown(m.specimen.thickness)) for label, m in tests}


def size_in_words(value: float, unit: str, shown: Units = SCALES, null: float | None = None) -> str:
    """A value in SI in the unit that people read; near a ``null`` of 1, as a stretch is, with more digits."""
    factor, name = shown.get(unit, (1.0, unit.removeprefix("-")))
    value = 0.0 if abs(value) < NOTHING_LEFT else value
    digits = 5 if null == 1.0 and abs(value - 1) < WORDS.near_one else 3
    return f"{factor * value:.{digits}g} {name}".strip()
