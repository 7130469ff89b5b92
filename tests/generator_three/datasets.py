"""A third generator of measurements with known faults: 120 cases a seed; energies, tests, flaws, noise of its own.

It shares nothing with the others and with the package. Case n of seed S has the random numbers of (S, n, attempt).
Inside, lengths are in mm and forces in N, as in the files; what a `Dataset` tells is in SI.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from tests.generator_three.curves import SoundFilm
from tests.generator_three.energies import COMMON, ENERGIES
from tests.generator_three.flaws import FLAWS
from tests.generator_three.journey import Journey
from tests.generator_three.readings import Noisy, read_with_noise
from tests.generator_three.recipes import Recipe
from tests.generator_three.trials import Accepted, accepted

HEADER = "time_s,deflection_mm,force_N"


@dataclass(frozen=True, eq=False)
class Dataset:
    """A measurement and its truth; forces (N,) N as the instrument wrote them."""

    case: Accepted
    read: Noisy
    truth: dict[str, Any]

    @property
    def path(self) -> Journey:
        """Where and when it was read."""
        return self.case.instrument.journey

    @cached_property
    def film(self) -> SoundFilm:
        """The film without faults."""
        return SoundFilm(self.case.instrument.curves)

    @property
    def csv(self) -> str:
        """The curve."""
        rows = zip(self.path.time, self.path.at, self.read.force, strict=True)
        return HEADER + "\n" + "".join(f"{t:.6f},{d:.6f},{f:.8g}\n" for t, d, f in rows)

    @property
    def toml(self) -> str:
        """The specimen, and the noise where it is stated."""
        film = self.case.instrument.curves.film
        stated = ("[measurement]", f"force_sd_N = {self.case.sd:.4g}") if self.case.recipe.noise.stated else ()
        lines = (
            "[specimen]",
            'name = "film of the third generator"',
            f"thickness_um = {self.case.stock.thickness}",
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
        files = folder / f"{stem}.csv", folder / f"{stem}.toml"
        for file, text in zip(files, (self.csv, self.toml), strict=True):
            file.write_text(text, encoding="utf-8")
        return files


def generate(recipe: Recipe) -> Dataset:
    """The measurement of a recipe. Raises `NoBalanceError` if no film can be found for it."""
    case, rng = accepted(recipe)
    read = read_with_noise(rng, recipe.noise, case.clean, case.deviations, case.sd, case.instrument.journey)
    return Dataset(case, read, _truth(case, read))


def _truth(case: Accepted, read: Noisy) -> dict[str, Any]:
    recipe, rubber = case.recipe, case.instrument.curves.rubber
    return {
        "kind": "+".join(sorted(case.seen)) or "none",
        "family": rubber.energy,
        "declared": declared_energy(recipe, rubber.energy),
        "parameters": ENERGIES[rubber.energy].si(rubber.parameters),
        "effects": _effects(case),
        "snr": {k: s.full for k, s in case.seen.items()},
        "snr_own": {k: s.own for k, s in case.seen.items()},
        "protocol": case.instrument.journey.text,
        "noise": {"sd": case.sd, "rho": read.rho, "step": read.step, **asdict(recipe.noise)},
        "strays": list(read.strays),
        "shear_modulus": 1e6 * case.stock.modulus,
        "seed": [recipe.seed, recipe.number],
        "expected": ["named", "ambiguous", "unknown"] if case.seen else ["adequate", "material", "unknown"],
    }


def _effects(case: Accepted) -> dict[str, Any]:
    scales, out = case.instrument.scales, {}
    for name, flaw in case.instrument.flaws.items():
        unit, law = FLAWS[name].unit, FLAWS[name].forms[flaw.form]
        size = flaw.size * unit.si(scales.free, scales.peak, scales.force)
        out[name] = {"size": size, "part": flaw.size, "unit": unit.name, "form": flaw.form, "law": law, **flaw.details}
    return out


def declared_energy(recipe: Recipe, energy: str) -> str:
    """The energy that a user declares: the film's own, or one of the common ones in turn where no user can know it."""
    return energy if energy in COMMON else COMMON[recipe.number % len(COMMON)]
