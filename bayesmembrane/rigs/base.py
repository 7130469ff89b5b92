"""What a test rig declares. One file per rig; the registry finds it by its name."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import ClassVar

from bayesmembrane.errors import DataError
from bayesmembrane.parameters import Array
from bayesmembrane.units import RATIO, STRESS

KINDS = ("annulus", "uniaxial", "equibiaxial", "planar", "biaxial")
"""Every kind of rig that a specimen file may name; those without a file in this folder are not supported."""


@dataclass(frozen=True)
class Rig(ABC):
    """The fixture that holds the film. A subclass is a frozen dataclass whose float fields are its lengths in m.

    name, title : how a specimen file calls it (``rig.kind``) and how reports print it
    columns : what its curve holds, column name without unit -> quantity (see `units`)
    ``check`` : what its lengths must satisfy among themselves
    """

    name: ClassVar[str]
    title: ClassVar[str]
    columns: ClassVar[Mapping[str, str]]

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

    @property
    def lengths(self) -> dict[str, float]:
        """The fields by name, in m."""
        return {f.name: float(getattr(self, f.name)) for f in fields(self)}

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

    def check(self) -> None:
        """Any length goes with any width."""

    def size(self) -> float:
        return self.length

    @staticmethod
    @abstractmethod
    def lateral(stretch: Array) -> tuple[Array, Array]:
        """(l2, dl2/dl) at stretches l; the film is isotropic and incompressible."""
