"""From a CSV file and the TOML file beside it to a `Measurement`, or to one sentence that says why not."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np

from bayesmembrane.data.corners import with_corners
from bayesmembrane.data.fixture import Fixture
from bayesmembrane.data.measurement import Measurement, Provenance, Specimen, check_blank_run, check_covariance
from bayesmembrane.data.motion import Motion, contradicted
from bayesmembrane.data.settings import TomlSection, load_specimen
from bayesmembrane.data.tables import TextTable, parse_table, read_matrix, read_text
from bayesmembrane.data.thinning import READ, of_few
from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import components
from bayesmembrane.ground.units import FORCE, LENGTH, RATIO, STRESS, TIME, split_header

# What lies beyond these is a wrong unit, not a film.
THINNEST = 1e-8  # m
RIG_SIZES = (1e-6, 1.0)  # m
LARGEST_LIFT = 20.0  # largest deflection relative to the size of the rig
LEAST_SD = 1e-12  # N
MOST_OF_TRAVEL = 0.8  # of the test's: what yields as much is no frame, but a wrong unit, or the film itself
BLANK_REACHES = 0.8  # of the largest force of the test: below that it is told, for the frame is extrapolated
FINEST_SD = 1e-7
"""Of the largest force: a noise below it would be less than the error of a solved film."""
NAMES_FILES = ("covariance", "blank_run")
"""Of the section of the measurement: names of files, from where the specimen file lies."""
_USUAL = {FORCE: "N", STRESS: "MPa", LENGTH: "mm"}
PHASES = MappingProxyType({"cycle": RATIO, "direction": RATIO})
"""Columns by which whoever measured says cycles (1, 2, ...) and legs (1 loading, -1 unloading)."""

T = TypeVar("T")


def read_measurement(curve_csv: str | Path, specimen_toml: str | Path) -> Measurement:
    """The measurement in a CSV file and the TOML file beside it, in SI.

    Raises `DataError`, and nothing else, whatever the files hold: one sentence with file, line and column.
    """
    curve_csv, specimen_toml = Path(curve_csv), Path(specimen_toml)
    table = parse_table(read_text(curve_csv), str(curve_csv))
    root = load_specimen(specimen_toml)
    rig = _rig(root.section("rig"))
    _check_kind(rig, table, root.section("rig").where)
    specimen = _specimen(root.section("specimen"), rig, curve_csv.stem)
    options = root.section("measurement", required=False)
    columns, notes = curve_columns(table, rig.columns, rig.noise, PHASES if rig.has_path else {})
    _check_width(root, rig, columns)
    rig = rig.as_read(columns)
    found = _at(table.file, rig.from_columns, columns, specimen.thickness)
    deflection, force, across = found["deflection"], found["force"], found.get("across")
    motion = _said_motion(table, found)
    rig.check_readings(found, table.file, table.lines)
    _check_size(deflection, table, rig)
    single = _stated(options, rig, specimen.thickness)
    sd, covariance, covariance_file = _noise(options, single, found.get("force_sd"), force.size)
    blank_run, blank_notes = _blank_run(options, rig, float(np.max(np.abs(deflection))), float(np.max(np.abs(force))))
    origin = [options.text("origin"), root.section("origin", required=False).all_text()]
    understood = root.section("import", required=False)  # how an export was understood, for people
    understood.all_text()
    doubts = understood.table.get("contradictions", [])
    notes = (*notes, *(f"export: {d}" for d in doubts if isinstance(d, str))) if isinstance(doubts, list) else notes
    for section in (options, root):
        section.finish()
    provenance = Provenance(
        curve_csv.name,
        specimen_toml.name,
        covariance_file,
        "; ".join(o for o in origin if o),
        (*notes, *blank_notes, *rig.remarks(found), *(contradicted(motion) if motion else ())),
    )
    if sd is not None and (np.min(sd) < LEAST_SD or np.max(sd) < FINEST_SD * np.max(np.abs(force))):
        fault = f"a standard deviation of {np.min(sd):g} N looks like a wrong unit"
        raise DataError(fault, options.where, "check the unit of the noise")
    measured = Measurement(
        deflection,
        force,
        rig,
        specimen,
        found.get("time"),
        sd,
        covariance,
        provenance,
        across=across,
        blank_run=blank_run,
    )
    moved = measured if motion is None else replace(measured, motion=motion, places=np.arange(force.size))
    return with_corners(of_few(moved, READ))


def _rig(section: TomlSection) -> Fixture:
    kind = section.text("kind", required=True)
    known = components("rigs")
    if kind not in known:
        supported = f"supported: {', '.join(known)}"
        raise DataError(f'there is no rig of the kind "{kind}"', section.where, supported)
    cls: type[Fixture] = known[kind]
    usual = cls.example().lengths
    lengths = {
        name: section.positive(name, LENGTH, f"{name}_mm", not cls.has_default(name), 1e3 * usual[name])
        for name in cls.length_names()
    }
    section.finish()
    rig = _at(section.where, partial(cls, **{k: v for k, v in lengths.items() if v is not None}))
    if not RIG_SIZES[0] <= rig.size() <= RIG_SIZES[1]:
        raise DataError(f"a rig of {rig.size():g} m looks like a wrong unit", section.where, "check the units")
    return rig


def _check_width(root: TomlSection, rig: Fixture, columns: Mapping[str, Array]) -> None:
    """Raise `DataError` if the noise of a stress is stated in newtons, and nothing says of what width."""
    given, options = root.section("rig").table, root.section("measurement", required=False)
    newtons = ["covariance", *(name for name, quantity in rig.noise.items() if quantity == FORCE)]
    stated = [n for n in newtons if n in columns or any(n in (k, split_header(k)[0]) for k in options.table)]
    if STRESS in rig.columns.values() and stated and not any(split_header(k)[0] == "width" for k in given):
        fault = f"{stated[0]} is in newtons, the readings are stresses, and no width says how the two go together"
        instead = [f"{name}_MPa" for name, quantity in rig.noise.items() if quantity == STRESS]
        raise DataError(fault, root.where, f"add width_mm to [rig], or state {' or '.join(instead)} instead")


def _check_kind(rig: Fixture, table: TextTable, where: str) -> None:
    """Raise `DataError` if the curve has the columns of other kinds of rig, and not those of this one."""
    names = {split_header(h)[0].lower() for h in table.header}
    if names >= set(rig.columns):
        return
    others = {kind: cls.columns for kind, cls in components("rigs").items() if names >= set(cls.columns)}
    if others:
        theirs = ", ".join(next(iter(others.values())))
        fault = f'a rig of the kind "{rig.name}" reads {", ".join(rig.columns)}, and the curve has {theirs}'
        raise DataError(fault, where, f"write a kind that reads these: {', '.join(others)}")


def _specimen(section: TomlSection, rig: Fixture, default_name: str) -> Specimen:
    name = section.text("name") or default_name
    thickness = section.measure("thickness", LENGTH, "thickness_um", like=50)
    section.finish()
    specimen = _at(section.where, Specimen, name, thickness)
    if not THINNEST <= specimen.thickness <= rig.thickest:
        fault = f"a specimen {1e3 * specimen.thickness:g} mm thick looks like a wrong unit"
        raise DataError(fault, section.where, "check the unit in the name of the key")
    return specimen


def _at(where: str, cls: Callable[..., T], *values: Any) -> T:
    """``cls(*values)``, with the place in front of what it complains about."""
    try:
        return cls(*values)
    except DataError as error:
        raise DataError(error.what, where, error.remedy) from None


def curve_columns(
    table: TextTable,
    required: Mapping[str, str] = Fixture.columns,
    noise: Mapping[str, str] = Fixture.noise,
    phases: Mapping[str, str] = MappingProxyType({}),
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """The columns of a curve in SI, (N,) each, by name: ``required``, time, ``noise``, ``phases``; a note on the rest.

    They map names to quantities. Raises `DataError` if one is missing or holds what is no number, and for
    fewer than two points.
    """
    places = {name: table.require(name, quantity) for name, quantity in required.items()}
    for name, quantity in (("time", TIME), *noise.items(), *phases.items()):
        if (place := table.find(name, quantity)) is not None:
            places[name] = place
    if len(table.rows) < 2:
        raise DataError(f"a curve needs at least two points, and this one has {len(table.rows)}", table.file)
    used = {index for index, _ in places.values()}
    ignored = [h for i, h in enumerate(table.header) if i not in used and h]
    notes = (f"ignored columns: {', '.join(ignored)}",) if ignored else ()
    return {name: table.column(*place) for name, place in places.items()}, notes


def _said_motion(table: TextTable, found: Mapping[str, Array]) -> Motion | None:
    """The path with the legs and cycles that columns say, None if there are no such columns."""
    leg, cycle = found.get("direction"), found.get("cycle")
    if leg is None and cycle is None:
        return None
    if leg is not None and not np.all(good := np.abs(leg) == 1):
        k = int(np.argmin(good))
        raise _no_phase(table, k, "direction", f"{leg[k]:g} is no direction", "1 while loading and -1 while unloading")
    if cycle is not None:
        _check_cycles(table, cycle)
    reach = float(np.max(found["deflection"]))
    return Motion(found["deflection"], found.get("time"), reach, None, leg, cycle)


def _check_cycles(table: TextTable, cycle: Array) -> None:
    """Raise `DataError` unless the cycles (N,) are whole numbers from 1 that never fall."""
    rule = "1, 2, 3 in their order"
    whole = (cycle >= 1) & (cycle == np.round(cycle))
    if not np.all(whole):
        k = int(np.argmin(whole))
        raise _no_phase(table, k, "cycle", f"{cycle[k]:g} is no cycle", rule)
    falls = np.flatnonzero(np.diff(cycle) < 0)
    if not falls.size:
        return
    k = int(falls[0]) + 1
    if cycle[0] > 1 and cycle[0] == cycle[k - 1]:  # what is wrong is how the file begins, not what comes after
        fault = f"the cycles begin with {cycle[0]:g}, and {cycle[k]:g} follows in line {table.lines[k]}"
        raise _no_phase(table, 0, "cycle", fault, rule)
    raise _no_phase(table, k, "cycle", f"cycle {cycle[k]:g} comes after cycle {cycle[k - 1]:g}", rule)


def _no_phase(table: TextTable, row: int, column: str, fault: str, rule: str) -> DataError:
    return DataError(fault, f"{table.file}, line {table.lines[row]}, column {column}", f"write {rule}")


def _check_size(deflection: Array, table: TextTable, rig: Fixture) -> None:
    k = int(np.argmax(deflection))
    row = table.lines[k % len(table.lines)]
    if deflection[k] > LARGEST_LIFT * rig.size():
        fault = (
            f"a deflection of {1e3 * deflection[k]:g} mm on a rig of {1e3 * rig.size():g} mm looks like a wrong unit"
        )
        raise DataError(fault, f"{table.file}, line {row}", "check the unit in the header")


def _stated(options: TomlSection, rig: Fixture, thickness: float) -> float | None:
    """N, the standard deviation that the specimen file states for all points, or None; in any quantity of the rig."""
    found = {}
    for name, quantity in rig.noise.items():
        value = options.measure(name, quantity, f"{name}_{_USUAL[quantity]}", required=False)
        if value is not None:
            found[name] = value * rig.newton(quantity, thickness)
    if len(found) > 1:
        raise DataError(f"{' and '.join(found)} both give the noise", options.where, "remove one of them")
    return next(iter(found.values()), None)


def _noise(
    options: TomlSection, single: float | None, column: Array | None, n: int
) -> tuple[Array | None, Array | None, str]:
    """(force_sd, covariance, file of the covariance) from the specimen file and the column."""
    name = options.text("covariance")
    if single is not None and (name or column is not None):
        other = "covariance" if name else "column force_sd"
        raise DataError(f"force_sd and the {other} both give the noise", options.where, "remove one of them")
    if single is not None and single <= 0:
        raise DataError("the standard deviation of the force must be positive", options.where, "correct force_sd")
    if name is None:
        return (np.full(n, single) if single is not None else column), None, ""
    path = Path(options.file).parent / name
    covariance = read_matrix(path)
    if covariance.shape != (n, n):
        fault = f"the covariance is {covariance.shape[0]} x {covariance.shape[1]}, and the curve has {n} points"
        raise DataError(fault, str(path), f"give a {n} x {n} matrix in N^2")
    check_covariance(covariance, str(path))
    if column is not None and not np.allclose(np.sqrt(np.diag(covariance)), column, rtol=0.02, atol=1e-9):
        fault = "the diagonal of the covariance is not the square of the column force_sd"
        raise DataError(fault, str(path), "it must be in N^2 and in the order of the curve")
    return np.sqrt(np.diag(covariance)), covariance, path.name


def _blank_run(options: TomlSection, rig: Fixture, went: float, asked: float) -> tuple[Array | None, tuple[str, ...]]:
    """((M, 2) m and N of a run on a rigid dummy that the specimen file names, or None; a note on it).

    ``went`` m, ``asked`` N : the largest travel and force of the test.

    Raises `DataError` where the film's travel is not read, and for a run that shows no frame that yields to a force.
    """
    lifted = dict(rig.columns) == dict(Fixture.columns)
    name = options.text("blank_run") if lifted or "blank_run" in options.table else None
    if name is None:
        return None, ()
    if not lifted:
        fault = f'a rig of the kind "{rig.name}" does not read its travel and force, which a blank run corrects'
        raise DataError(fault, options.where, "remove blank_run")
    path = Path(options.file).parent / name
    table = parse_table(read_text(path), str(path))
    columns, _ = curve_columns(table)
    blank = np.column_stack([columns["deflection"], columns["force"]])
    slope, reached = check_blank_run(blank, str(path)), float(np.max(blank[:, 1]))
    if slope * asked > MOST_OF_TRAVEL * went:
        fault = f"the frame alone would go {1e3 * slope * asked:.3g} mm under the {asked:.3g} N of the test"
        raise DataError(f"{fault}, which goes {1e3 * went:.3g} mm with a film", str(path), "check the units of both")
    note = f"the frame is that of {path.name}, {len(blank)} readings up to {reached:.3g} N"
    if reached < BLANK_REACHES * asked:
        note += f"; the test goes to {asked:.3g} N: its curve is drawn on straight"
    return blank, (note,)
