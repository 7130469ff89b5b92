"""What a test rig declares. One file per rig; the registry finds it by its name."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from typing import ClassVar

from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.units import FORCE, RATIO, STRESS


@dataclass(frozen=True)
class Rig(ABC):
    """The fixture that holds the film. A subclass is a frozen dataclass whose float fields are its lengths in m.

    name, title : how a specimen file calls it (``rig.kind``) and how reports print it
    columns : what its curve holds, column name without unit -> quantity (see `units`)
    noise : by what names a standard deviation may be stated, likewise; one for all points in the specimen file, too
    ``check`` : what its lengths must satisfy among themselves
    """

    name: ClassVar[str]
    title: ClassVar[str]
    columns: ClassVar[Mapping[str, str]]
    noise: ClassVar[Mapping[str, str]] = {"force_sd": FORCE}

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

    def remarks(self, found: Mapping[str, Array]) -> tuple[str, ...]:
        """What must be said of readings, as `from_columns` gives them, that a film on this rig cannot bear."""
        return ()

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

    def place(self, deflection: float) -> str:
        """A deflection in m in words, to follow "at"."""
        return f"{1e3 * deflection:.3g} mm"

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


class Strip(Rig, ABC):
    """A homogeneous test: one stretch l, read as the deflection L (l - 1), gives the nominal stress P1 / thickness.

    The force is the nominal stress times width times thickness, so that deflections and forces are those of a specimen
    of this length and width; where the specimen file gives none, 50 mm and 10 mm.
    """

    length: float
    width: float
    columns: ClassVar[Mapping[str, str]] = {"stretch": RATIO, "nominal_stress": STRESS}
    noise: ClassVar[Mapping[str, str]] = {"force_sd": FORCE, "nominal_stress_sd": STRESS}

    def check(self) -> None:
        """Any length goes with any width."""

    def size(self) -> float:
        return self.length

    @staticmethod
    @abstractmethod
    def lateral(stretch: Array, across: Array | None = None) -> tuple[Array, Array]:
        """(l2, dl2/dl) at stretches l (B, N); ``across`` (N,) is l2 where it was measured."""

    def newton(self, quantity: str, thickness: float) -> float:
        return self.width * thickness if quantity == STRESS else 1.0

    def from_columns(self, found: Mapping[str, Array], thickness: float) -> dict[str, Array]:
        rest = {k: v for k, v in found.items() if k not in self.columns and k not in self.noise}
        deflection = self.length * (found["stretch"] - 1.0)
        out = {**rest, "deflection": deflection, "force": found["nominal_stress"] * self.width * thickness}
        return out | self.stated(found, thickness)

    def stated(self, found: Mapping[str, Array], thickness: float) -> dict[str, Array]:
        """``force_sd`` (N,) N, if a column states it in whatever quantity; raises `DataError` if two do."""
        names = [k for k in self.noise if k in found]
        if len(names) > 1:
            raise DataError(f"the columns {' and '.join(names)} both give the noise", remedy="remove one of them")
        if not names:
            return {}
        return {"force_sd": found[names[0]] * self.newton(self.noise[names[0]], thickness)}

    def to_columns(self, arrays: Mapping[str, Array], thickness: float) -> dict[str, Array]:
        out = {"time_s": arrays["time"]} if "time" in arrays else {}
        out["stretch"] = 1.0 + arrays["deflection"] / self.length
        out["nominal_stress_MPa"] = 1e-6 * arrays["force"] / (self.width * thickness)
        return out | ({"force_sd_N": arrays["force_sd"]} if "force_sd" in arrays else {})

    def shown(self, thickness: float) -> Mapping[str, tuple[float, str]]:
        """Nominal stress, force over width and thickness, and stretch: what was measured, whatever the strip's size."""
        kPa = 1e-3 / (self.width * thickness)
        per_kPa = 1 / (self.length * kPa)
        return {
            "m": (1 / self.length, "in stretch"),
            "m/N": (per_kPa, "1/kPa"),
            "N": (kPa, "kPa"),
            "N/s": (kPa, "kPa/s"),
        }

    def place(self, deflection: float) -> str:
        return f"a stretch of {1 + deflection / self.length:.3g}"
