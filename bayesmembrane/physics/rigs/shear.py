"""Simple shear: two plates, or long grips, move past each other, and the shear g is their travel over the gap."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.data.fixture import check_deviations, check_sequence
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.units import FORCE, RATIO, STRESS
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.mechanics.shear_law import ShearLaw, shear_curves, stretched
from bayesmembrane.physics.mechanics.solution import Curves
from bayesmembrane.physics.rigs.base import STATES, Films, Homogeneous, Trial, wrong_side


@dataclass(frozen=True)
class Shear(Homogeneous):
    """Simple shear g: force along the plates is width times thickness times shear stress, travel is length times g.

    ``length`` is the gap between the plates; width times thickness is the area that is sheared. The specimen does not
    buckle: it is a block, or a sheet that is held flat.
    """

    length: float = 0.050
    width: float = 0.010

    name: ClassVar[str] = "shear"
    title: ClassVar[str] = "simple shear between plates"
    columns: ClassVar[Mapping[str, str]] = {"shear": RATIO, "shear_stress": STRESS}
    noise: ClassVar[Mapping[str, str]] = {"force_sd": FORCE, "shear_stress_sd": STRESS}
    thickest: ClassVar[float] = 0.1
    axes: ClassVar[tuple[str, float, str]] = ("shear", 0.0, "stress")

    # ---- mechanics -------------------------------------------------------------------------------------------------

    def law(self, films: Films, trial: Trial) -> tuple[ShearLaw, tuple[Array, Array]]:
        law = self._law(films)
        at = np.unique(np.concatenate([trial.path.deflection, trial.extra]))
        shown = shear_curves(law, at[np.linspace(0, at.size - 1, min(at.size, STATES)).astype(int)])
        return law, (shown.convexity, shown.ellipticity)

    def curves(self, films: Films, measurement: Measurement, deflection: Array, read: int | None = None) -> Curves:
        return shear_curves(self._law(films), deflection, films.sensitivities)

    def _law(self, films: Films) -> ShearLaw:
        return ShearLaw(films.material, films.parameters, self.length, self.width)

    def states(self, film: Material, deflection: Array, points: int) -> Array:
        """Principal stretches l and 1 / l; places are those along the gap."""
        l1 = np.repeat(stretched(deflection / self.length)[0][:, None], points, axis=1)
        return np.stack([np.linspace(0.0, self.length, points) + 0.0 * l1, 0.0 * l1, l1, 1.0 / l1])

    # ---- readings --------------------------------------------------------------------------------------------------

    def from_columns(self, found: Mapping[str, Array], thickness: float) -> dict[str, Array]:
        rest = {k: v for k, v in found.items() if k not in self.columns and k not in self.noise}
        force = found["shear_stress"] * self.width * thickness
        return {**rest, "deflection": self.length * found["shear"], "force": force} | self.stated(found, thickness)

    def check_readings(self, columns: Mapping[str, Array], file: str, lines: Sequence[int]) -> None:
        places = [f"{file}, line {k}" for k in lines]
        x, force = columns["deflection"], columns["force"]
        if float(np.max(x)) < -float(np.min(x)):
            raise DataError("the shear is largest where it is negative", file, "change the signs of shear and stress")
        check_sequence(columns, places, self.filed)
        against = (x * force < 0) & (np.abs(force) > 0.01 * np.max(np.abs(force)))
        if np.sum(against) > 0.5 * x.size:
            fault = "at most points the stress is against the shear"
            raise DataError(fault, places[int(np.argmax(against))], "change the sign of one column")
        if (found := wrong_side(x, force)) is not None:
            side, row = found
            fault = f"every stress of a {'positive' if side > 0 else 'negative'} shear is against it"
            raise DataError(fault, places[row], "write both with one sign where the block is sheared the other way")
        check_deviations(columns, places)

    def to_columns(self, arrays: Mapping[str, Array], thickness: float) -> dict[str, Array]:
        out = {"time_s": arrays["time"]} if "time" in arrays else {}
        out["shear"] = arrays["deflection"] / self.length
        out["shear_stress_MPa"] = 1e-6 * arrays["force"] / (self.width * thickness)
        return out | ({"force_sd_N": arrays["force_sd"]} if "force_sd" in arrays else {})
