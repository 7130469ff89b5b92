"""Homogeneous tests in compression: files as those in tension have, histories as a lifted disc has."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from bayesmembrane.data.fixture import check_deviations, check_sequence
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.units import RATIO, STRESS
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.mechanics.block_law import BlockLaw, block_curves
from bayesmembrane.physics.mechanics.solution import Curves
from bayesmembrane.physics.mechanics.strip_law import StripLaw
from bayesmembrane.physics.rigs.base import STATES, Films, Homogeneous, Trial, only_pressed


class Pressed(Homogeneous, ABC):
    """A specimen pressed to the stretch l < 1: compression L (1 - l) and push -P1 width, both positive.

    Files have the stretch (below 1) and the nominal stress, negative or positive where it pushes.
    """

    columns: ClassVar[Mapping[str, str]] = {"stretch": RATIO, "nominal_stress": STRESS}
    presses: ClassVar[bool] = True
    thickest: ClassVar[float] = 0.1
    axes: ClassVar[tuple[str, float, str]] = ("compression", 0.0, "stress")

    @staticmethod
    @abstractmethod
    def lateral(stretch: Array, across: Array | None = None) -> tuple[Array, Array]:
        """(l2, dl2/dl) at stretches l (B, N)."""

    # ---- mechanics -------------------------------------------------------------------------------------------------

    def law(self, films: Films, trial: Trial) -> tuple[BlockLaw, tuple[Array, Array]]:
        law = self._law(films)
        at = np.unique(np.concatenate([trial.path.deflection, trial.extra]))
        shown = block_curves(law, at[np.linspace(0, at.size - 1, min(at.size, STATES)).astype(int)])
        return law, (shown.convexity, shown.ellipticity)

    def curves(self, films: Films, measurement: Measurement, deflection: Array, read: int | None = None) -> Curves:
        return block_curves(self._law(films), deflection, films.sensitivities)

    def _law(self, films: Films) -> BlockLaw:
        return BlockLaw(StripLaw(films.material, films.parameters, self, pushes=True))

    def states(self, film: Material, deflection: Array, points: int) -> Array:
        l1 = np.repeat(1.0 - deflection[:, None] / self.length, points, axis=1)
        along = np.linspace(0.0, self.length, points)
        return np.stack([l1 * along, 0.0 * l1, l1, self.lateral(l1)[0]])

    # ---- readings --------------------------------------------------------------------------------------------------

    def from_columns(self, found: Mapping[str, Array], thickness: float) -> dict[str, Array]:
        rest = {k: v for k, v in found.items() if k not in self.columns and k not in self.noise}
        stretch, stress = found["stretch"], found["nominal_stress"]
        if not only_pressed(stretch):
            fault = f"the stretch goes up to {np.max(stretch):.4g}, and what is pressed has stretches below 1"
            remedy = "write 1 less the part by which it got shorter; a test in both directions is called uniaxial"
            raise DataError(fault, remedy=remedy)
        if np.min(stretch) <= 0:
            raise DataError(f"a stretch of {np.min(stretch):g} cannot be", remedy="write length over length at rest")
        push = -stress if float(np.sum(stress)) < 0 else stress
        out = {**rest, "deflection": self.length * (1.0 - stretch), "force": push * self.width * thickness}
        return out | self.stated(found, thickness)

    def remarks(self, found: Mapping[str, Array]) -> tuple[str, ...]:
        return (f"on the rig {self.name} a stress that pushes counts as positive, whatever its sign in the file",)

    def check_readings(self, columns: Mapping[str, Array], file: str, lines: Sequence[int]) -> None:
        places = [f"{file}, line {k}" for k in lines]
        x, push = columns["deflection"], columns["force"]
        if "time" not in columns and np.all(np.diff(x) < 0):
            remedy = "write the lines in the order in which they were measured, from a stretch of 1 down, or add time_s"
            raise DataError("the stretch rises from the first line on", places[0], remedy)
        check_sequence(columns, places, self.filed)
        against = (push < 0) & (np.abs(push) > 0.01 * np.max(np.abs(push)))
        if np.sum(against) > 0.5 * x.size:
            fault = "the stress has one sign at most points and the other sign where most is carried"
            raise DataError(fault, places[int(np.argmax(against))], "check where it is zero")
        check_deviations(columns, places)

    def filed(self, deflection: float) -> tuple[str, str]:
        return "compression", f"to a stretch of {1.0 - deflection / self.length:g}"

    def to_columns(self, arrays: Mapping[str, Array], thickness: float) -> dict[str, Array]:
        out = {"time_s": arrays["time"]} if "time" in arrays else {}
        out["stretch"] = 1.0 - arrays["deflection"] / self.length
        out["nominal_stress_MPa"] = -1e-6 * arrays["force"] / (self.width * thickness)
        return out | ({"force_sd_N": arrays["force_sd"]} if "force_sd" in arrays else {})
