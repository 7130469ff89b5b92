"""A traced contour: the height of a lifted film over the radius, at one stated deflection of the disc."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from bayesmembrane.data.fixture import check_deviations
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.units import LENGTH
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.mechanics.contour_law import ContourLaw, contour_curves
from bayesmembrane.physics.mechanics.request import request
from bayesmembrane.physics.mechanics.solution import Curves
from bayesmembrane.physics.rigs._ring import Ring
from bayesmembrane.physics.rigs.base import Films, Trial

OFF = 0.01
"""Of a radius or of the lift: so far beyond the film a reading may lie."""


@dataclass(frozen=True)
class Contour(Ring):
    """Heights h(r) > 0 above the clamp of a film between the radii R1 and R2 whose disc is lifted by ``lift``, m.

    Radii stand in the place of deflections and heights in that of forces. A contour tells the shape of the energy and
    nothing of its modulus: it is a second test of the film whose forces were measured.
    """

    lift: float

    name: ClassVar[str] = "contour"
    title: ClassVar[str] = "traced contour of a clamped annulus"
    columns: ClassVar[Mapping[str, str]] = {"radius": LENGTH, "height": LENGTH}
    noise: ClassVar[Mapping[str, str]] = {"height_sd": LENGTH}
    closed_form: ClassVar[bool] = True  # one state of the film: nothing is drawn through points of a curve
    reads_force: ClassVar[bool] = False
    has_path: ClassVar[bool] = False
    axes: ClassVar[tuple[str, float, str]] = ("radius", 0.0, "height")

    @classmethod
    def example(cls) -> Self:
        """The rig of the paper, the disc lifted by 30 mm."""
        return cls(0.010, 0.035, 0.030)

    # ---- mechanics -------------------------------------------------------------------------------------------------

    def law(self, films: Films, trial: Trial) -> tuple[ContourLaw, tuple[Array, Array]]:
        margins = self._margins(films)
        return self._law(films), (margins.convexity, margins.ellipticity)

    def curves(self, films: Films, measurement: Measurement, deflection: Array, read: int | None = None) -> Curves:
        return contour_curves(self._law(films), self._margins(films), deflection, films.sensitivities)

    def _law(self, films: Films) -> ContourLaw:
        return ContourLaw(films.material, films.parameters, self.lift, self.inner_radius, self.outer_radius)

    def _margins(self, films: Films) -> Curves:
        """Convexity, ellipticity and stretch at the lift, (B, 1)."""
        at = np.array([self.lift])
        return films.solve(request(films.material, films.parameters, at, self.inner_radius, self.outer_radius))

    def states(self, film: Material, deflection: Array, points: int) -> Array:
        radii = {"inner_radius": self.inner_radius, "outer_radius": self.outer_radius}
        p = api.profile(film, self.lift, points=points, **radii)
        return np.repeat(np.stack([p.f, p.height, p.l1, p.l2])[:, None], deflection.size, axis=1)

    # ---- readings --------------------------------------------------------------------------------------------------

    def from_columns(self, found: Mapping[str, Array], thickness: float) -> dict[str, Array]:
        out = {"deflection": found["radius"], "force": found["height"]}
        return out | ({"force_sd": found["height_sd"]} if "height_sd" in found else {})

    def check_readings(self, columns: Mapping[str, Array], file: str, lines: Sequence[int]) -> None:
        """Radii lie on the film, heights between clamp and disc."""
        places = [f"{file}, line {k}" for k in lines]
        radius, height = columns["deflection"], columns["force"]
        off = (radius < (1 - OFF) * self.inner_radius) | (radius > (1 + OFF) * self.outer_radius)
        if np.any(off):
            k = int(np.argmax(off))
            low, high = 1e3 * self.inner_radius, 1e3 * self.outer_radius
            fault = f"a radius of {1e3 * radius[k]:.4g} mm is not on the film between {low:g} and {high:g} mm"
            raise DataError(fault, places[k], "count radii from the axis, and leave out what is no film")
        over = (height > 1.1 * self.lift) | (height < -0.1 * self.lift)
        if np.any(over):
            k = int(np.argmax(over))
            fault = f"a height of {1e3 * height[k]:.4g} mm lies outside of clamp and disc, {1e3 * self.lift:g} mm apart"
            raise DataError(fault, places[k], "count heights from the clamp, positive towards the disc; check lift_mm")
        check_deviations(columns, places)

    def to_columns(self, arrays: Mapping[str, Array], thickness: float) -> dict[str, Array]:
        out = {"radius_mm": 1e3 * arrays["deflection"], "height_mm": 1e3 * arrays["force"]}
        return out | ({"height_sd_mm": 1e3 * arrays["force_sd"]} if "force_sd" in arrays else {})

    def shown(self, thickness: float) -> Mapping[str, tuple[float, str]]:
        """Heights and radii in mm; what would be a slope of heights by heights is a number."""
        return {"m": (1e3, "mm"), "m/N": (1.0, "mm/mm"), "N": (1e3, "mm"), "N/s": (1e3, "mm/s")}

    def remark_on_units(self, thickness: float) -> str:
        return "radii stand in the place of deflections and heights in that of forces, 1 mm for 1 mN"

    def place(self, deflection: float) -> str:
        return f"a radius of {1e3 * deflection:.3g} mm"
