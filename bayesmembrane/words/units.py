"""Sizes in the units that people read on a rig."""

from __future__ import annotations

from collections.abc import Mapping

from bayesmembrane.diagnosis.thresholds import WORDS

Units = Mapping[str, tuple[float, str]]
"""By SI unit, (factor, unit) in which people read it: `Fixture.shown`."""

SCALES: Units = {"m": (1e3, "mm"), "m/N": (1e3, "mm/N"), "N": (1e3, "mN"), "N/s": (1e3, "mN/s")}
"""Those of a lifted disc."""


def size_in_words(value: float, unit: str, shown: Units = SCALES) -> str:
    """A value in SI in the unit that people read."""
    factor, name = shown.get(unit, (1.0, unit.removeprefix("-")))
    digits = 5 if unit == "-" and abs(value - 1) < WORDS.near_one else 3
    return f"{factor * value:.{digits}g} {name}".strip()
