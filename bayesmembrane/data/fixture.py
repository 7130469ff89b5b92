"""What a measurement asks of its rig: lengths, columns, units, signs, and words for places.

`physics.rigs` adds the mechanics: how the forces of a film on a rig follow from its strain energy.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, fields
from typing import ClassVar, Self

import numpy as np

from bayesmembrane.data.motion import Filed, check_order, check_time, in_mm
from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.units import FORCE, LENGTH

FAR = 0.75
"""Of the largest deflection: from there on the film's own pull says which sign the forces have."""


@dataclass(frozen=True)
class Fixture(ABC):
    """What holds the film. A subclass is a frozen dataclass whose float fields are its lengths in m.

    name, title : how a specimen file calls it (``rig.kind``) and how reports print it
    columns : what its curve holds, column name without unit -> quantity (see `units`)
    noise : by what names a standard deviation may be stated, likewise; one for all points in the specimen file, too
    clamped : the film is held all round and spans the gap to a disc; else it is pulled at its ends
    homogeneous : the film is stretched alike everywhere
    has_path : readings are stations of one test, which a film may remember; else each is a state of its own
    presses : the specimen gets shorter under a force that pushes
    thickest : m, what is thicker is a wrong unit
    axes : what readers see along and up, in one word each, and the first one at rest: ("stretch", 1.0, "stress")
    ``check`` : what its lengths must satisfy among themselves
    """

    name: ClassVar[str]
    title: ClassVar[str]
    columns: ClassVar[Mapping[str, str]] = {"deflection": LENGTH, "force": FORCE}
    noise: ClassVar[Mapping[str, str]] = {"force_sd": FORCE}
    clamped: ClassVar[bool] = False
    homogeneous: ClassVar[bool] = False
    has_path: ClassVar[bool] = True
    presses: ClassVar[bool] = False
    thickest: ClassVar[float] = 5e-3
    axes: ClassVar[tuple[str, float, str]] = ("deflection", 0.0, "force")

    def __post_init__(self) -> None:
        """Raise `DataError` unless every length is finite and positive, and `check` agrees."""
        for name, value in self.lengths.items():
            if not (math.isfinite(value) and value > 0):
                raise DataError(f"{name} must be a positive length, and {value:g} m is not", self.name)
        self.check()

    @abstractmethod
    def check(self) -> None:
        """Raise `DataError` if the lengths contradict each other."""

    @abstractmethod
    def size(self) -> float:
        """The length in m that deflections and thicknesses are judged against: a film much larger is a wrong unit."""

    def from_columns(self, found: Mapping[str, Array], thickness: float) -> dict[str, Array]:
        """``deflection`` (m), ``force`` (N), their ``force_sd`` and others, from the columns of a curve in SI."""
        return dict(found)

    def as_read(self, found: Mapping[str, Array]) -> Fixture:
        """The fixture of the curve with these columns in SI: this one, or its other way of working that they show."""
        return self

    def remarks(self, found: Mapping[str, Array]) -> tuple[str, ...]:
        """What must be said of readings, as `from_columns` gives them, that a film on this rig cannot bear."""
        return ()

    def check_readings(self, columns: Mapping[str, Array], file: str, lines: Sequence[int]) -> None:
        """Raise `DataError` for an order or a sign that no test on this rig gives.

        ``columns`` are as `from_columns` gives them; ``lines`` are the line numbers of ``file`` that errors name.
        """
        check_lifted(columns, file, lines)

    def newton(self, quantity: str, thickness: float) -> float:
        """N of one SI unit of a quantity in which this rig's noise is stated."""
        return 1.0

    def to_columns(self, arrays: Mapping[str, Array], thickness: float) -> dict[str, Array]:
        """The inverse of `from_columns`: header names with units -> values."""
        units = {"time": ("time_s", 1.0), "deflection": ("deflection_mm", 1e3)}
        names = {k: units.get(k, (f"{k}_N", 1.0)) for k in arrays}
        return {names[k][0]: names[k][1] * v for k, v in arrays.items()}

    def shown(self, thickness: float) -> Mapping[str, tuple[float, str]]:
        """By SI unit (factor, unit): how people read forces, deflections and what is made of them on this rig."""
        return {"m": (1e3, "mm"), "m/N": (1e3, "mm/N"), "N": (1e3, "mN"), "N/s": (1e3, "mN/s")}

    def remark_on_units(self, thickness: float) -> str:
        """A clause on what the forces and deflections of this rig stand for, or "" if they are what was measured."""
        return ""

    def ring(self) -> tuple[float, float] | None:
        """Radii in m of the disc and of the clamp between which the film spans; None if it is no ring."""
        return None

    def place(self, deflection: float) -> str:
        """A deflection in m in words, to follow "at"."""
        return f"{1e3 * deflection:.3g} mm"

    @classmethod
    def example(cls) -> Self:
        """A rig of a usual size."""
        return cls()

    @property
    def lengths(self) -> dict[str, float]:
        """The fields by name, in m."""
        return {f.name: float(getattr(self, f.name)) for f in fields(self)}

    @classmethod
    def has_default(cls, name: str) -> bool:
        """True if a specimen file may leave this length out."""
        return next(f for f in fields(cls) if f.name == name).default is not MISSING

    @classmethod
    def length_names(cls) -> tuple[str, ...]:
        """The fields, which a specimen file gives with a unit: ``inner_radius_mm``."""
        return tuple(f.name for f in fields(cls))


def check_lifted(columns: Mapping[str, Array], file: str, lines: Sequence[int]) -> None:
    """Raise `DataError` for an order or a sign that no disc lifted from a film gives; arguments as `check_readings`."""
    places = [f"{file}, line {k}" for k in lines]
    check_sequence(columns, places)
    deflection, force = columns["deflection"], columns["force"]
    if np.mean(deflection < 0) > 0.5:
        fault = "the deflection is negative at most points, and a lifted disc has a positive one"
        raise DataError(fault, file, "change the sign of the column")
    # Friction on the way back and an offset may leave most forces negative; none turns the film's pull round.
    far = deflection >= FAR * np.max(deflection)
    negative = min(np.mean(force < 0), np.mean(force[far] < 0)) > 0.5
    if negative and np.sum((deflection - np.mean(deflection)) * force) <= 0:
        fault = "the force is negative where the disc is lifted most, and the film pulls it back with a positive one"
        raise DataError(fault, file, "change the sign of the column")
    if not np.any(deflection > 0):
        raise DataError("the disc is never lifted: no deflection is positive", file, "check the column")
    check_deviations(columns, places)


def check_sequence(columns: Mapping[str, Array], places: list[str], filed: Filed = in_mm) -> None:
    """Raise `DataError` unless the readings can be in the order of a test; ``places`` (N,) name their rows."""
    if "time" in columns:
        check_time(columns["time"], places)
    else:
        check_order(columns["deflection"], places, filed)


def check_deviations(columns: Mapping[str, Array], places: list[str]) -> None:
    """Raise `DataError` for a standard deviation that is not positive; ``places`` (N,) name the rows."""
    if "force_sd" in columns and np.any(columns["force_sd"] <= 0):
        k = int(np.argmax(columns["force_sd"] <= 0))
        raise DataError("the standard deviation of the force must be positive", places[k], "correct the column")
