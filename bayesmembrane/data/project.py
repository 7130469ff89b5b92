"""A project: a TOML file that lists the tests of one material, each with its files and what is claimed of it alone."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.data.settings import TomlSection, load_toml
from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.units import LENGTH

TABLES = "test"


@dataclass(frozen=True, eq=False)
class Listed:
    """One test of a project; None where the file says nothing.

    label : its name, "" to call it after its specimen
    measurement : up to the deflection that the file asks for
    effects, noise : of this test, instead of what is claimed of all
    """

    label: str
    measurement: Measurement
    effects: str | None = None
    noise: str | None = None


def read_project(path: str | Path) -> tuple[Listed, ...]:
    """The tests in the tables ``[[test]]`` of a TOML file; paths are relative to it.

    Each has ``curve`` and ``specimen``, and may have ``name``, ``effects`` ("a,b", or "" for none), ``noise`` and
    ``max_deflection_mm``. Raises `DataError` for a file without such tables, a key that it does not know, and all that
    `read_measurement` raises.
    """
    path = Path(path)
    root = load_toml(path)
    tables = root.table.get(TABLES)
    if not isinstance(tables, list) or not all(isinstance(t, dict) for t in tables) or not tables:
        raise DataError(
            "the project lists no tests", str(path), "write a table [[test]] with curve and specimen for each"
        )
    if odd := sorted(set(root.table) - {TABLES}):
        raise DataError(f'the key "{odd[0]}" is unknown', str(path), "a project holds [[test]] tables and nothing else")
    return tuple(_listed(TomlSection(t, str(path), f"{TABLES} {i}"), path.parent) for i, t in enumerate(tables, 1))


def _listed(section: TomlSection, folder: Path) -> Listed:
    curve, specimen = section.text("curve", required=True), section.text("specimen", required=True)
    label, noise = section.text("name"), section.text("noise")
    end = section.measure("max_deflection", LENGTH, "max_deflection_mm", required=False)
    effects = section.table.get("effects")
    section.all_known("effects")
    section.finish()
    if effects is not None and not isinstance(effects, str):
        raise DataError('effects must be a text like "zero_offset,prestretch"', section.where)
    assert curve is not None
    assert specimen is not None
    measured = read_measurement(folder / curve, folder / specimen)
    return Listed(label or "", measured if end is None else measured.up_to(end), effects, noise)
