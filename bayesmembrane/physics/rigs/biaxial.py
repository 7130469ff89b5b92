"""A film pulled in two directions by different amounts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.units import RATIO, STRESS
from bayesmembrane.physics.rigs.base import Strip


@dataclass(frozen=True)
class Biaxial(Strip):
    """Stretches l1, l2 and both nominal stresses: a state is two readings, its first direction and then its second.

    States are not the stations of one path: no effect that remembers can occur, and times are left aside.
    """

    length: float = 0.050
    width: float = 0.010

    name: ClassVar[str] = "biaxial"
    title: ClassVar[str] = "biaxial film"
    columns: ClassVar[Mapping[str, str]] = {
        "stretch_1": RATIO,
        "stretch_2": RATIO,
        "nominal_stress_1": STRESS,
        "nominal_stress_2": STRESS,
    }

    @staticmethod
    def lateral(stretch: Array, across: Array | None = None) -> tuple[Array, Array]:
        across = np.ones(1) if across is None else across
        return np.broadcast_to(across, stretch.shape), np.zeros_like(stretch)

    def from_columns(self, found: Mapping[str, Array], thickness: float) -> dict[str, Array]:
        l1, l2, p1, p2 = (found[k] for k in self.columns)
        out = {
            "deflection": self.length * (np.concatenate([l1, l2]) - 1.0),
            "across": np.concatenate([l2, l1]),
            "force": np.concatenate([p1, p2]) * self.width * thickness,
        }
        return out | ({"force_sd": np.tile(found["force_sd"], 2)} if "force_sd" in found else {})

    def to_columns(self, arrays: Mapping[str, Array], thickness: float) -> dict[str, Array]:
        n = arrays["deflection"].size // 2
        stretch, stress = 1.0 + arrays["deflection"] / self.length, arrays["force"] / (self.width * thickness)
        out = {"stretch_1": stretch[:n], "stretch_2": stretch[n:]}
        out |= {"nominal_stress_1_MPa": 1e-6 * stress[:n], "nominal_stress_2_MPa": 1e-6 * stress[n:]}
        return out | ({"force_sd_N": arrays["force_sd"][:n]} if "force_sd" in arrays else {})
