"""A film pulled in two directions by different amounts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.units import FORCE, RATIO, STRESS
from bayesmembrane.physics.rigs.base import Strip

ROUNDED = 2e-3
"""Part of a stretch by which files round it."""


@dataclass(frozen=True)
class Biaxial(Strip):
    """Stretches l1, l2 and both nominal stresses: a state is two readings, its first direction and then its second.

    States are not the stations of one path: no effect that remembers can occur, and times are left aside.
    """

    length: float = 0.050
    width: float = 0.010

    name: ClassVar[str] = "biaxial"
    title: ClassVar[str] = "biaxial film"
    proposal: ClassVar[str] = "a sheet pulled half as far across as along (biaxial)"
    has_path: ClassVar[bool] = False
    columns: ClassVar[Mapping[str, str]] = {
        "stretch_1": RATIO,
        "stretch_2": RATIO,
        "nominal_stress_1": STRESS,
        "nominal_stress_2": STRESS,
    }
    noise: ClassVar[Mapping[str, str]] = {
        "force_sd": FORCE,
        "nominal_stress_sd": STRESS,
        "nominal_stress_1_sd": STRESS,
        "nominal_stress_2_sd": STRESS,
    }

    @staticmethod
    def lateral(stretch: Array, across: Array | None = None) -> tuple[Array, Array]:
        across = np.ones(1) if across is None else across
        return np.broadcast_to(across, stretch.shape), np.zeros_like(stretch)

    @classmethod
    def proposed(cls, stretch: Array) -> tuple[Array, tuple[int, ...]]:
        return 1.0 + 0.5 * (stretch - 1.0), (1, 2)

    def from_columns(self, found: Mapping[str, Array], thickness: float) -> dict[str, Array]:
        l1, l2, p1, p2 = (found[k] for k in self.columns)
        out = {
            "deflection": self.length * (np.concatenate([l1, l2]) - 1.0),
            "across": np.concatenate([l2, l1]),
            "force": np.concatenate([p1, p2]) * self.width * thickness,
        }
        return out | self.stated(found, thickness)

    def stated(self, found: Mapping[str, Array], thickness: float) -> dict[str, Array]:
        """``force_sd`` (2 N,) N, from one column for both directions or from one for each."""
        each = [k for k in ("nominal_stress_1_sd", "nominal_stress_2_sd") if k in found]
        if len(each) == 1:
            raise DataError(f"the column {each[0]} states the noise of one direction alone", remedy="state the other's")
        both = super().stated({k: v for k, v in found.items() if k not in each}, thickness)
        if each and both:
            raise DataError(f"the column {each[0]} and another one both give the noise", remedy="remove one of them")
        if each:
            return {"force_sd": np.concatenate([found[k] for k in each]) * self.newton(STRESS, thickness)}
        return {k: np.tile(v, 2) for k, v in both.items()}

    def remarks(self, found: Mapping[str, Array]) -> tuple[str, ...]:
        stretch = 1.0 + found["deflection"] / self.length
        loose = int(np.sum(stretch < (1 - ROUNDED) / np.sqrt(np.maximum(found["across"], 1.0))))
        if loose == 0:
            return ()
        return (f"{loose} of {stretch.size} readings lie where a film is slack or wrinkled, and carries nothing",)

    def to_columns(self, arrays: Mapping[str, Array], thickness: float) -> dict[str, Array]:
        n = arrays["deflection"].size // 2
        stretch, stress = 1.0 + arrays["deflection"] / self.length, arrays["force"] / (self.width * thickness)
        out = {"stretch_1": stretch[:n], "stretch_2": stretch[n:]}
        out |= {"nominal_stress_1_MPa": 1e-6 * stress[:n], "nominal_stress_2_MPa": 1e-6 * stress[n:]}
        if "force_sd" not in arrays:
            return out
        sd = arrays["force_sd"]
        if np.array_equal(sd[:n], sd[n:]):
            return out | {"force_sd_N": sd[:n]}
        stated = 1e-6 * sd / (self.width * thickness)
        return out | {"nominal_stress_1_sd_MPa": stated[:n], "nominal_stress_2_sd_MPa": stated[n:]}
