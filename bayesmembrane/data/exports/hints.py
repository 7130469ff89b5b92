"""What a user says about an export, and what is guessed where nothing is said."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

from bayesmembrane.ground.errors import SettingsError, unknown_name
from bayesmembrane.ground.units import to_si


class Guess(NamedTuple):
    """Something that the file does not say outright: ``what`` is taken as ``value``, ``why``, and an override."""

    what: str
    value: str
    why: str
    option: str = ""

    def __str__(self) -> str:
        settled = f" ({self.option} overrides)" if self.option else ""
        return f"{self.what}: {self.value}, since {self.why}{settled}"


_CHOICES = {
    "decimal": ("point", "comma"),
    "zero": ("none", "travel", "force", "travel,force"),
    "sign": ("keep", "flip", "flip-force", "flip-travel"),
    "strain": ("engineering", "true", "stretch"),
    "stress": ("engineering", "true"),
}


@dataclass(frozen=True)
class Hints:
    """What is said of an export beforehand; "" or None where nothing is. The options of ``import`` have these names.

    format : an importer, instead of the one that recognises the file
    encoding, delimiter, decimal : of a text; the delimiter by name (tab, comma, semicolon, space) or as it is
    columns : names in the order of the file, "time_s,travel_mm,-,force_N", or "force=Load 2,travel=3"
    units : "travel=mm,force=N", where the file says none, or others
    sheet, part : of a workbook; which of several specimens, by number or name
    zero, sign : see `_CHOICES`
    strain, stress : what a column of strain or stress holds, see `_CHOICES`
    readings_per_s : Hz, of a file without times
    readings : so many are kept at most, with all turning points
    rig, thickness, gauge_length, width, inner_radius, outer_radius, name : the film and what holds it, m

    Raises `SettingsError` for a choice that there is not, and for a length that is not positive.
    """

    format: str = ""
    encoding: str = ""
    delimiter: str = ""
    decimal: str = ""
    columns: str = ""
    units: str = ""
    sheet: str = ""
    part: str = ""
    zero: str = ""
    sign: str = ""
    strain: str = ""
    stress: str = ""
    readings_per_s: float | None = None
    readings: int | None = None
    rig: str = ""
    thickness: float | None = None
    gauge_length: float | None = None
    width: float | None = None
    inner_radius: float | None = None
    outer_radius: float | None = None
    name: str = ""

    def __post_init__(self) -> None:
        for name, choices in _CHOICES.items():
            value = getattr(self, name)
            if value and value not in choices:
                raise SettingsError(f'--{name} cannot be "{value}"', remedy=f"choose {', '.join(choices)}")
        if self.readings is not None and self.readings < 20:
            raise SettingsError("--readings must be at least 20")
        for f in fields(self):
            value = getattr(self, f.name)
            if isinstance(value, float) and not 0 < value < float("inf"):
                raise SettingsError(f"{f.name.replace('_', ' ')} must be positive, and {value:g} is not")

    @property
    def pairs(self) -> dict[str, str]:
        """``units`` by column."""
        return pairs_of(self.units, "--units")


def pairs_of(text: str, option: str) -> dict[str, str]:
    """``a=b,c=d`` by name; raises `SettingsError` for anything else."""
    found = {}
    for part in filter(None, (p.strip() for p in text.split(","))):
        name, sign, value = part.partition("=")
        if not sign or not name.strip():
            raise SettingsError(f'"{part}" in {option} is no pair', remedy=f"write {option} name=value,name=value")
        found[name.strip().lower()] = value.strip()
    return found


_LENGTHS = {"um": 1e-6, "mm": 1e-3}


def hints_of(said: Mapping[str, Any]) -> Hints:
    """Hints by the names of the options, with underscores and lengths in their units: ``thickness_um``, ``width_mm``.

    Raises `SettingsError` for a name that there is not.
    """
    known = {f.name for f in fields(Hints)}
    found: dict[str, Any] = {}
    for option, value in said.items():
        name, _, unit = option.rpartition("_")
        if unit in _LENGTHS and name in known:
            found[name] = None if value is None else to_si(float(value), _LENGTHS[unit])
        elif option in known and option not in ("thickness", "gauge_length", "width", "inner_radius", "outer_radius"):
            found[option] = value
        else:
            raise unknown_name("option of import", option, known)
    return Hints(**found)
