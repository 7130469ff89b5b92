"""A fourth generator of measurements with known faults: 60 cases a seed, laws, courses, rigs and noise of its own.

It has the solved film, its energies and the measure of visibility in common with the third, and nothing with the
package. Inside, lengths are in mm and forces in N, as in the files; what a dataset tells is in SI.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from tests.generator_four.courses import DriveCourse
from tests.generator_four.noises import NoisyForce, scattered
from tests.generator_four.recipes import BenchRecipe
from tests.generator_four.trials import FoundCase, found_case
from tests.generator_three.curves import SoundFilm
from tests.generator_three.energies import COMMON, ENERGIES

COLUMNS = "time_s,deflection_mm,force_N"


@dataclass(frozen=True, eq=False)
class BenchDataset:
    """A measurement and its truth."""

    case: FoundCase
    read: NoisyForce
    truth: dict[str, Any]

    @property
    def path(self) -> DriveCourse:
        """Where and when it was read."""
        return self.case.rig.course

    @cached_property
    def film(self) -> SoundFilm:
        """The film without faults."""
        return SoundFilm(self.case.rig.curves)

    @property
    def csv(self) -> str:
        """The curve."""
        rows = zip(self.path.time, self.path.at, self.read.force, strict=True)
        return COLUMNS + "\n" + "".join(f"{t:.6f},{d:.6f},{f:.8g}\n" for t, d, f in rows)

    @property
    def toml(self) -> str:
        """The specimen, and the noise where it is stated."""
        film, sd = self.case.rig.curves.film, self.truth["noise"]["sd"]
        stated = ("[measurement]", f"force_sd_N = {sd:.4g}") if self.case.recipe.noise.stated else ()
        lines = (
            "[specimen]",
            'name = "film of the fourth generator"',
            f"thickness_um = {self.case.thickness}",
            "[rig]",
            'kind = "annulus"',
            f"inner_radius_mm = {film.inner}",
            f"outer_radius_mm = {film.outer}",
            *stated,
            "[origin]",
            'statement = "SYNTHETIC, not measured"',
        )
        return "\n".join(lines) + "\n"

    def write(self, folder: Path, stem: str = "curve") -> tuple[Path, Path]:
        """(CSV, TOML) in ``folder``."""
        folder.mkdir(parents=True, exist_ok=True)
        curve, specimen = folder / f"{stem}.csv", folder / f"{stem}.toml"
        curve.write_text(self.csv, encoding="utf-8")
        specimen.write_text(self.toml, encoding="utf-8")
        return curve, specimen


def generate(recipe: BenchRecipe) -> BenchDataset:
    """The measurement of a recipe. Raises `NoBalanceError` if no film can be found for it."""
    case, rng = found_case(recipe)
    read = scattered(rng, case.scatter, recipe.noise.strays, case.clean)
    return BenchDataset(case, read, _truth(case, read))


def _truth(case: FoundCase, read: NoisyForce) -> dict[str, Any]:
    recipe, rubber, scatter = case.recipe, case.rig.curves.rubber, case.scatter
    sd = float(np.sqrt(np.mean(scatter.deviations(case.clean) ** 2)))
    return {
        "kind": "+".join(sorted(case.seen)) or "none",
        "family": rubber.energy,
        "declared": rubber.energy if rubber.energy in COMMON else COMMON[recipe.number % len(COMMON)],
        "parameters": ENERGIES[rubber.energy].si(rubber.parameters),
        "effects": {
            name: {"size": case.rig.si(name), "part": f.size, "form": f.form, **f.details}
            for name, f in case.rig.flaws.items()
        },
        "snr": {name: ratios.full for name, ratios in case.seen.items()},
        "snr_own": {name: ratios.own for name, ratios in case.seen.items()},
        "protocol": case.rig.course.text,
        "noise": {"sd": sd, **asdict(scatter), **asdict(recipe.noise)},
        "strays": list(read.strays),
        "shear_modulus": 1e6 * case.modulus,
        "seed": [recipe.seed, recipe.number],
        "expected": ["named", "ambiguous", "unknown"] if case.seen else ["adequate", "material", "unknown"],
    }
