"""Specimen and Measurement: the film, the rig and the measured curve in SI, with noise, phases and provenance."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import tomli_w
from numpy.typing import NDArray

from bayesmembrane.data.motion import Path as Motion
from bayesmembrane.data.motion import check_order, check_time, first_loading, holds
from bayesmembrane.data.settings import Section, load_toml
from bayesmembrane.data.tables import Table, parse_table, read_matrix, read_text
from bayesmembrane.ground.errors import DataError, SettingsError, StorageError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import components
from bayesmembrane.ground.units import FORCE, LENGTH, TIME
from bayesmembrane.physics.rigs.base import Rig, Strip

# What lies beyond these is a wrong unit, not a film.
THICKNESSES = (1e-8, 5e-3)  # m
RIGS = (1e-6, 1.0)  # m
LARGEST_LIFT = 20.0  # largest deflection relative to the size of the rig
LEAST_SD = 1e-12  # N

T = TypeVar("T")


@dataclass(frozen=True)
class Specimen:
    """The film: its name and its thickness at rest in m; raises `DataError` unless that is positive."""

    name: str
    thickness: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.thickness) and self.thickness > 0):
            raise DataError(
                f"the thickness must be positive, and {1e6 * self.thickness:g} um is not", f'specimen "{self.name}"'
            )


@dataclass(frozen=True)
class Provenance:
    """Where a measurement comes from: file names ("" if none), its origin in words, notes on what was left aside."""

    curve: str = ""
    specimen: str = ""
    covariance: str = ""
    origin: str = ""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Measurement:
    """A measured force curve, in the order in which it was measured (SI units; arrays are read-only).

    Attributes
    ----------
    deflection : (N,) m, positive for a lifted disc
    force : (N,) N, positive for a lifted disc
    rig : what holds the film
    specimen : the film
    time : (N,) s, strictly increasing, or None
    force_sd : (N,) N, standard deviation of the measurement's own noise, or None if unknown
    covariance : (N, N) N^2, covariance of that noise, or None if it is independent or unknown
    full_range : the largest deflection of the whole measurement in m, also where this one is truncated
    motion : how the disc was moved, also past points that were left out; the film remembers those too
    places : (N,) where the points lie on it
    across : (N,) stretch across the direction of pull where it was measured (biaxial tests), or None

    Raises `DataError` for shapes that do not agree, values that are not finite, a standard deviation that is not
    positive, and a covariance that is not symmetric and positive definite. With a covariance, `force_sd` is the root
    of its diagonal.
    """

    deflection: Array
    force: Array
    rig: Rig
    specimen: Specimen
    time: Array | None = None
    force_sd: Array | None = None
    covariance: Array | None = None
    provenance: Provenance = Provenance()
    full_range: float = math.nan
    motion: Motion | None = None
    places: NDArray[np.int64] | None = None
    across: Array | None = None

    def __post_init__(self) -> None:
        n = np.size(self.deflection)
        for name in ("deflection", "force", "time", "force_sd", "across"):
            self._freeze(name, (n,))
        self._freeze("covariance", (n, n))
        if n == 0:
            raise DataError("a measurement needs at least one point")
        if self.time is not None and np.any(np.diff(self.time) <= 0):
            raise DataError("the time must increase from each point to the next")
        if self.covariance is not None:
            check_covariance(self.covariance)
            self._set("force_sd", np.sqrt(np.diag(self.covariance)))
        if self.force_sd is not None and np.any(self.force_sd <= 0):
            raise DataError("the standard deviation of the force must be positive at every point")
        if not math.isfinite(self.full_range):
            self._set("full_range", float(np.max(self.deflection)))

    def __len__(self) -> int:
        """The number of points."""
        return int(self.deflection.size)

    @cached_property
    def path(self) -> Motion:
        """How the disc was moved up to the last point: `motion`, or the points themselves."""
        return self.motion or Motion(self.deflection, self.time, self.full_range, self.across)

    @cached_property
    def on_path(self) -> NDArray[np.int64]:
        """(N,) where the points lie on `path`."""
        return np.arange(len(self)) if self.places is None else self.places

    @cached_property
    def leg(self) -> NDArray[np.int8]:
        """(N,) +1 while the deflection grows (loading), -1 while it falls (unloading); a hold belongs to its leg."""
        return self.path.leg[self.on_path]

    @cached_property
    def cycle(self) -> NDArray[np.int64]:
        """(N,) number of the cycle, from 1; a cycle starts where unloading turns into loading."""
        return self.path.cycle[self.on_path]

    @cached_property
    def is_first_loading(self) -> NDArray[np.bool_]:
        """(N,) True where the film is loaded to a deflection that it has not seen before."""
        return first_loading(self.path.deflection, self.path.leg)[self.on_path]

    @cached_property
    def holds(self) -> list[NDArray[np.intp]]:
        """The points of each time at which the disc stands still."""
        return holds(self.deflection)

    @property
    def noise_covariance(self) -> Array | None:
        """(N, N) N^2: the covariance, or the squared standard deviations on a diagonal, or None if noise is unknown."""
        if self.covariance is not None:
            return self.covariance
        return None if self.force_sd is None else np.diag(self.force_sd**2)

    @cached_property
    def data_hash(self) -> str:
        """SHA-256 of everything that a likelihood depends on: arrays, noise, rig, thickness and full range."""
        digest = hashlib.sha256(f"{self.rig!r} {self.specimen.thickness!r} {self.full_range!r}".encode())
        for array in (self.deflection, self.force, self.time, self.force_sd, self.covariance):
            digest.update(b"-" if array is None else np.ascontiguousarray(array).tobytes())
        if self.across is not None:
            digest.update(np.ascontiguousarray(self.across).tobytes())
        if self.motion is not None:
            for array in (self.motion.deflection, self.motion.time, self.on_path.astype(float)):
                digest.update(b"-" if array is None else np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()

    def up_to(self, max_deflection: float) -> Measurement:
        """The points with deflection <= ``max_deflection`` (m), noise included; `full_range` stays.

        Raises `SettingsError` if fewer than two points are left.
        """
        keep = self.deflection <= max_deflection * (1 + 1e-9)
        if np.count_nonzero(keep) < 2:
            raise SettingsError(
                f"the largest deflection of {1e3 * max_deflection:g} mm leaves fewer than two points",
                remedy=f"choose one between {1e3 * np.min(self.deflection):g} and {1e3 * np.max(self.deflection):g} mm",
            )
        return self if np.all(keep) else self.select(keep)

    def select(self, keep: NDArray[Any]) -> Measurement:
        """The points at ``keep``, (N,) booleans or indices in order; `full_range` and the path to the last stay."""

        def part(array: Array | None) -> Array | None:
            return None if array is None else array[keep]

        covariance = None if self.covariance is None else self.covariance[keep][:, keep]
        places = self.on_path[keep]
        end = int(places[-1]) + 1 if places.size else 0
        remembers = places.size != end
        past, across = (None if v is None else v[:end] for v in (self.path.time, self.path.across))
        return replace(
            self,
            motion=Motion(self.path.deflection[:end], past, self.full_range, across) if remembers else None,
            across=part(self.across),
            places=places if remembers else None,
            deflection=self.deflection[keep],
            force=self.force[keep],
            time=part(self.time),
            force_sd=part(self.force_sd),
            covariance=covariance,
        )

    def _freeze(self, name: str, shape: tuple[int, ...]) -> None:
        value = getattr(self, name)
        if value is None:
            return
        array = np.array(value, dtype=float)
        if array.shape != shape:
            raise DataError(f"{name} has the shape {array.shape}, and the deflections ask for {shape}")
        if not np.all(np.isfinite(array)):
            raise DataError(f"{name} holds values that are not finite")
        array.setflags(write=False)
        self._set(name, array)

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)


def check_covariance(covariance: Array, where: str | None = None) -> None:
    """Raise `DataError` unless the (N, N) matrix is symmetric and positive definite."""
    variance = np.diag(covariance)
    if np.any(variance <= 0):
        k = int(np.argmax(variance <= 0)) + 1
        raise DataError(f"entry {k} of the diagonal is a variance, and it is not positive", where)
    scale = np.sqrt(variance)
    with np.errstate(all="ignore"):
        correlation = covariance / scale[:, None] / scale[None, :]
        symmetric = np.max(np.abs(correlation - correlation.T)) <= 1e-6
    if not symmetric:
        raise DataError("the covariance is not symmetric", where, "check how it was written")
    try:
        np.linalg.cholesky(0.5 * (correlation + correlation.T))
    except np.linalg.LinAlgError:
        raise DataError(
            "the covariance is not positive definite", where, "write more digits, or add the variance of the load cell"
        ) from None


# ---- files -----------------------------------------------------------------------------------------------------------


def read_measurement(curve_csv: str | Path, specimen_toml: str | Path) -> Measurement:
    """The measurement in a CSV file and the TOML file beside it, in SI.

    Raises `DataError`, and nothing else, whatever the files hold: one sentence with file, line and column.
    """
    curve_csv, specimen_toml = Path(curve_csv), Path(specimen_toml)
    table = parse_table(read_text(curve_csv), str(curve_csv))
    root = load_toml(specimen_toml)
    rig = _rig(root.section("rig"))
    specimen = _specimen(root.section("specimen"), rig, curve_csv.stem)
    options = root.section("measurement", required=False)
    columns, notes = curve_columns(table, rig.columns, rig.noise)
    found = _at(table.file, rig.from_columns, columns, specimen.thickness)
    deflection, force, across = found["deflection"], found["force"], found.get("across")
    if isinstance(rig, Strip):
        _check_strip(found, table)
    else:
        check_samples(found, table.file, table.lines)
    _check_size(deflection, table, rig)
    single = _stated(options, rig, specimen.thickness)
    sd, covariance, covariance_file = _noise(options, single, found.get("force_sd"), force.size)
    origin = [options.text("origin"), root.section("origin", required=False).all_text()]
    for section in (options, root):
        section.finish()
    provenance = Provenance(
        curve_csv.name,
        specimen_toml.name,
        covariance_file,
        "; ".join(o for o in origin if o),
        (*notes, *rig.remarks(found)),
    )
    if sd is not None and np.min(sd) < LEAST_SD:
        fault = f"a standard deviation of {np.min(sd):g} N looks like a wrong unit"
        raise DataError(fault, options.where, "check the unit of the noise")
    return Measurement(deflection, force, rig, specimen, found.get("time"), sd, covariance, provenance, across=across)


def write_measurement(measurement: Measurement, curve_csv: str | Path, specimen_toml: str | Path) -> None:
    """Write what `read_measurement` reads back: mm, N and s to 15 digits, the covariance in a file of its own.

    Raises `StorageError` if a file exists already or cannot be written; nothing is overwritten.
    """
    curve_csv, specimen_toml = Path(curve_csv), Path(specimen_toml)
    arrays = {"time": measurement.time, "deflection": measurement.deflection, "force": measurement.force}
    if measurement.covariance is None:
        arrays["force_sd"] = measurement.force_sd
    columns = measurement.rig.to_columns(
        {k: v for k, v in arrays.items() if v is not None}, measurement.specimen.thickness
    )
    options: dict[str, Any] = {"origin": measurement.provenance.origin} if measurement.provenance.origin else {}
    texts = {curve_csv: csv_text(columns)}
    if measurement.covariance is not None:
        beside = specimen_toml.parent / f"{curve_csv.stem}_covariance.csv"
        options["covariance"] = beside.name
        texts[beside] = "".join(",".join(f"{v:.17g}" for v in row) + "\n" for row in measurement.covariance)
    lengths = {f"{k}_mm": float(f"{1e3 * v:.15g}") for k, v in measurement.rig.lengths.items()}
    content = {
        "specimen": {
            "name": measurement.specimen.name,
            "thickness_um": float(f"{1e6 * measurement.specimen.thickness:.15g}"),
        },
        "rig": {"kind": measurement.rig.name, **lengths},
        "measurement": options,
    }
    texts[specimen_toml] = tomli_w.dumps({k: v for k, v in content.items() if v})
    write_new(texts)


def csv_text(columns: dict[str, Array]) -> str:
    """A CSV with a header, columns of equal length, and 15 digits."""
    rows = zip(*columns.values(), strict=True)
    return "\n".join([",".join(columns), *(",".join(f"{v:.15g}" for v in row) for row in rows)]) + "\n"


def write_new(texts: dict[Path, str]) -> None:
    """Write texts to files that do not exist yet; raises `StorageError` before the first if one does."""
    for path in texts:
        if path.exists():
            raise StorageError("the file exists already", str(path), "remove it or choose another name")
    try:
        for path, text in texts.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("x", encoding="utf-8", newline="\n") as file:
                file.write(text)
    except OSError as error:
        raise StorageError(
            f"the file cannot be written ({error.strerror})", str(path), "choose another folder"
        ) from None


def _rig(section: Section) -> Rig:
    kind = section.text("kind", required=True)
    known = components("rigs")
    if kind not in known:
        supported = f"supported: {', '.join(known)}"
        raise DataError(f'there is no rig of the kind "{kind}"', section.where, supported)
    cls: type[Rig] = known[kind]
    required = {name: not cls.has_default(name) for name in cls.length_names()}
    lengths = {name: section.measure(name, LENGTH, f"{name}_mm", need) for name, need in required.items()}
    section.finish()
    rig = _at(section.where, partial(cls, **{k: v for k, v in lengths.items() if v is not None}))
    if not RIGS[0] <= rig.size() <= RIGS[1]:
        raise DataError(f"a rig of {rig.size():g} m looks like a wrong unit", section.where, "check the units")
    return rig


def _specimen(section: Section, rig: Rig, default_name: str) -> Specimen:
    name = section.text("name") or default_name
    thickness = section.measure("thickness", LENGTH, "thickness_um")
    section.finish()
    specimen = _at(section.where, Specimen, name, thickness)
    if not THICKNESSES[0] <= specimen.thickness <= THICKNESSES[1]:
        fault = f"a film {1e3 * specimen.thickness:g} mm thick looks like a wrong unit"
        raise DataError(fault, section.where, "check the unit in the name of the key")
    return specimen


def _at(where: str, cls: Callable[..., T], *values: Any) -> T:
    """``cls(*values)``, with the place in front of what it complains about."""
    try:
        return cls(*values)
    except DataError as error:
        raise DataError(error.what, where, error.remedy) from None


def curve_columns(
    table: Table, required: Mapping[str, str], noise: Mapping[str, str] = Rig.noise
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """The columns of a curve in SI, (N,) each, by name: ``required`` ones, time and ``noise``; a note on the others.

    Both map names to quantities. Raises `DataError` if one is missing or holds what is no number, and for
    fewer than two points.
    """
    places = {name: table.require(name, quantity) for name, quantity in required.items()}
    for name, quantity in (("time", TIME), *noise.items()):
        if (place := table.find(name, quantity)) is not None:
            places[name] = place
    if len(table.rows) < 2:
        raise DataError(f"a curve needs at least two points, and this one has {len(table.rows)}", table.file)
    used = {index for index, _ in places.values()}
    ignored = [h for i, h in enumerate(table.header) if i not in used and h]
    notes = (f"ignored columns: {', '.join(ignored)}",) if ignored else ()
    return {name: table.column(*place) for name, place in places.items()}, notes


def check_samples(columns: dict[str, Array], file: str, lines: Sequence[int]) -> None:
    """Raise `DataError` for an order or a sign that no test gives.

    ``columns`` are those of a curve in SI, (N,) each; ``lines`` the N line numbers of ``file`` that errors name.
    """
    places = [f"{file}, line {k}" for k in lines]
    _check_sequence(columns, places)
    for name in ("deflection", "force"):
        if np.mean(columns[name] < 0) > 0.5:
            fault = f"the {name} is negative at most points, and a lifted disc has a positive one"
            raise DataError(fault, file, "change the sign of the column")
    if not np.any(columns["deflection"] > 0):
        raise DataError("the disc is never lifted: no deflection is positive", file, "check the column")
    _check_sd(columns, places)


def _check_strip(columns: dict[str, Array], table: Table) -> None:
    """As `check_samples`, for a homogeneous test: what pushes has a stretch below 1 and a negative stress."""
    places = [f"{table.file}, line {k}" for k in table.lines]
    deflection, force, across = columns["deflection"], columns["force"], columns.get("across")
    if across is None:
        _check_sequence(columns, places)
    else:
        places = 2 * places
    pulled, pushed = deflection > 0, deflection < 0
    if across is not None:  # held wide a film pulls below rest, and held narrow it may push above
        pulled, pushed = pulled & (across >= 1), pushed & (across <= 1)
    against = ((pulled & (force < 0)) | (pushed & (force > 0))) & (np.abs(force) > 0.01 * np.max(np.abs(force)))
    if np.sum(against) > 0.5 * np.sum(pulled | pushed):
        k = int(np.argmax(against))
        fault = "at most points the stress is negative above a stretch of 1 or positive below it"
        remedy = "write the stretch as length over length at rest, and the stress positive where it pulls"
        raise DataError(fault, places[k], remedy)
    if not np.any(deflection > 0):
        fault = "no stretch is above 1, and a test in compression alone cannot be calibrated"
        raise DataError(fault, table.file, "keep the signs as they are, and add the readings in tension of this rubber")
    _check_sd(columns, places)


def _check_sequence(columns: dict[str, Array], places: list[str]) -> None:
    if "time" in columns:
        check_time(columns["time"], places)
    else:
        check_order(columns["deflection"], places)


def _check_sd(columns: dict[str, Array], places: list[str]) -> None:
    if "force_sd" in columns and np.any(columns["force_sd"] <= 0):
        k = int(np.argmax(columns["force_sd"] <= 0))
        raise DataError("the standard deviation of the force must be positive", places[k], "correct the column")


def _check_size(deflection: Array, table: Table, rig: Rig) -> None:
    k = int(np.argmax(deflection))
    row = table.lines[k % len(table.lines)]
    if deflection[k] > LARGEST_LIFT * rig.size():
        fault = (
            f"a deflection of {1e3 * deflection[k]:g} mm on a rig of {1e3 * rig.size():g} mm looks like a wrong unit"
        )
        raise DataError(fault, f"{table.file}, line {row}", "check the unit in the header")


def _stated(options: Section, rig: Rig, thickness: float) -> float | None:
    """N, the standard deviation that the specimen file states for all points, or None; in any quantity of the rig."""
    found = {}
    for name, quantity in rig.noise.items():
        value = options.measure(name, quantity, f"{name}_{'N' if quantity == FORCE else 'MPa'}", required=False)
        if value is not None:
            found[name] = value * rig.newton(quantity, thickness)
    if len(found) > 1:
        raise DataError(f"{' and '.join(found)} both give the noise", options.where, "remove one of them")
    return next(iter(found.values()), None)


def _noise(
    options: Section, single: float | None, column: Array | None, n: int
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
