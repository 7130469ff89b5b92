"""Specimen and Measurement: the film, the rig and the measured curve in SI, with noise, phases and provenance."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bayesmembrane.data.fixture import Fixture
from bayesmembrane.data.motion import Motion, first_loading, holds
from bayesmembrane.ground.errors import DataError, SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.text import file_name, showable

ROUND_OFF = 1e-13
"""Of the largest deflection."""
AWAY = 0.01
"""Of the full range: nearer to rest the disc waits for the test."""
BLANK_READINGS = 3
FALLS, LEAST_TRAVEL = 3.0, 1e-7  # standard errors of a slope, and m: a fall by less is noise, and round-off


@dataclass(frozen=True)
class Specimen:
    """The film: its name and its thickness at rest in m; raises `DataError` unless that is positive.

    What cannot be shown of a name is replaced by a sign.
    """

    name: str
    thickness: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", showable(self.name))
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

    def __post_init__(self) -> None:
        for name in ("curve", "specimen", "covariance"):
            object.__setattr__(self, name, file_name(getattr(self, name)))
        object.__setattr__(self, "origin", showable(self.origin))
        object.__setattr__(self, "notes", tuple(map(showable, self.notes)))


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
    blank_run : (M, 2) m and N, how far the crosshead went on a rigid dummy under which force: the frame alone; or None

    Raises `DataError` for shapes that do not agree, values that are not finite, a standard deviation that is not
    positive, and a covariance that is not symmetric and positive definite. With a covariance, `force_sd` is the root
    of its diagonal.
    """

    deflection: Array
    force: Array
    rig: Fixture
    specimen: Specimen
    time: Array | None = None
    force_sd: Array | None = None
    covariance: Array | None = None
    provenance: Provenance = Provenance()
    full_range: float = math.nan
    motion: Motion | None = None
    places: NDArray[np.int64] | None = None
    across: Array | None = None
    blank_run: Array | None = None

    def __post_init__(self) -> None:
        n = np.size(self.deflection)
        self._set("deflection", without_round_off(self.deflection))
        for name in ("deflection", "force", "time", "force_sd", "across"):
            self._freeze(name, (n,))
        self._freeze("covariance", (n, n))
        self._freeze("blank_run", (0 if self.blank_run is None else np.size(self.blank_run) // 2, 2))
        if n == 0:
            raise DataError("a measurement needs at least one point")
        if self.time is not None and np.any(np.diff(self.time) <= 0):
            raise DataError("the time must increase from each point to the next")
        if self.blank_run is not None:
            check_blank_run(self.blank_run)
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
    def has_pauses(self) -> bool:
        """True if the disc stands still on its way, for long or not, and times say for how long."""
        on_its_way = np.abs(self.path.deflection) > AWAY * self.full_range
        return self.time is not None and (bool(self.holds) or bool(np.any(self.path.rests & on_its_way)))

    @property
    def moving(self) -> NDArray[np.bool_]:
        """(N,) False in holds, where readings are alike for that."""
        out = np.ones(len(self), dtype=bool)
        for still in self.holds:
            out[still] = False
        return out

    @property
    def noise_covariance(self) -> Array | None:
        """(N, N) N^2: the covariance, or the squared standard deviations on a diagonal, or None if noise is unknown."""
        if self.covariance is not None:
            return self.covariance
        return None if self.force_sd is None else np.diag(self.force_sd**2)

    @cached_property
    def data_hash(self) -> str:
        """SHA-256 of everything that a likelihood depends on: arrays, noise, rig, its frame, thickness, full range."""
        digest = hashlib.sha256(f"{self.rig!r} {self.specimen.thickness!r} {self.full_range!r}".encode())
        for array in (self.deflection, self.force, self.time, self.force_sd, self.covariance):
            digest.update(b"-" if array is None else np.ascontiguousarray(array).tobytes())
        if self.across is not None:
            digest.update(np.ascontiguousarray(self.across).tobytes())
        if self.blank_run is not None:
            digest.update(b"blank run" + np.ascontiguousarray(self.blank_run).tobytes())
        if self.motion is not None:
            for array in (self.motion.deflection, self.motion.time, self.on_path.astype(float)):
                digest.update(b"-" if array is None else np.ascontiguousarray(array).tobytes())
            for array in (self.motion.said_leg, self.motion.said_cycle):
                digest.update(b"" if array is None else np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()

    def up_to(self, max_deflection: float) -> Measurement:
        """The points with deflection <= ``max_deflection`` (m), noise included; `full_range` stays.

        Raises `SettingsError` if fewer than two points are left.
        """
        keep = self.deflection <= max_deflection * (1 + 1e-9)
        if np.count_nonzero(keep) < 2:
            second, most = np.sort(self.deflection)[min(1, len(self) - 1)], np.max(self.deflection)
            raise SettingsError(
                f"the range up to {self.rig.place(max_deflection)} leaves fewer than two points",
                remedy=f"choose an end from {self.rig.place(float(second))} to {self.rig.place(float(most))}",
            )
        return self if np.all(keep) else self.select(keep)

    def ranges_up_to(self, ends: Sequence[float]) -> list[Measurement]:
        """`up_to` each of several ends (m); raises `SettingsError` for two that leave the same points, too."""
        parts, of_length = [self.up_to(end) for end in ends], dict[int, float]()
        for end, part in zip(ends, parts, strict=True):
            if len(part) in of_length:
                one, other, last = map(self.rig.place, (of_length[len(part)], end, float(np.max(self.deflection))))
                raise SettingsError(
                    f"the ranges up to {one} and {other} hold the same readings",
                    remedy=f"give ends with readings between them; the curve ends at {last}",
                )
            of_length[len(part)] = end
        return parts

    def select(self, keep: NDArray[Any]) -> Measurement:
        """The points at ``keep``, (N,) booleans or indices in order; `full_range` and the path to the last stay."""

        def part(array: Array | None) -> Array | None:
            return None if array is None else array[keep]

        covariance = None if self.covariance is None else self.covariance[keep][:, keep]
        places = self.on_path[keep]
        end = int(places[-1]) + 1 if places.size else 0
        remembers = places.size != end or self.path.said
        return replace(
            self,
            motion=self.path.up_to(end) if remembers else None,
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


def without_round_off(deflection: ArrayLike) -> Array:
    """Deflections with zero where they differ from it by no more than a subtraction's round-off.

    No solver follows a film that is lifted by 1e-17 m, and no machine lifts one so.
    """
    d = np.array(deflection, dtype=float)
    size = float(np.max(np.abs(d), initial=0.0))
    d[np.abs(d) <= ROUND_OFF * size] = 0.0
    return d


def check_blank_run(blank: Array, where: str | None = None) -> float:
    """The slope, m/N, of the straight line through the (M, 2) m and N of a blank run.

    Raises `DataError` unless they say how a frame yields to a force that grows.
    """
    travel, force = blank.T
    if np.unique(force[force > 0]).size < BLANK_READINGS:
        fault = f"a blank run needs readings at {BLANK_READINGS} different forces above zero at least"
        raise DataError(fault, where, "load the rigid dummy up to the forces of the test, in the sense of the test")
    (slope, _), ((variance, _), _) = np.polyfit(force, travel, 1, cov=True)
    reached = float(np.max(force))
    if slope * reached < -max(FALLS * float(np.sqrt(variance)) * reached, LEAST_TRAVEL):
        fault = "the crosshead goes the less the larger the force is, and a frame yields the other way"
        raise DataError(fault, where, "change the sign of a column")
    return float(slope)


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
