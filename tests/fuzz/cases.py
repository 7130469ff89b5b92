"""One call of the command line, drawn from a seed: files, verb and options.

Names of energies, effects and noise models are those that the registry finds, so that a new component is called too.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.fuzz.curves import FAULTS, PROTOCOLS, RIGS, Bench, Motion, columns, motion, noisy, spoilt
from tests.fuzz.package import CONVEXITY, components
from tests.generator.energies import FAMILIES, Array

VERBS = ("fit", "fit", "sample", "diagnose")
ESS = "100"
CURVE, SPECIMEN, COVARIANCE = "curve.csv", "film.toml", "noise.csv"
ODD = 0.12  # of the calls have a setting that nobody should choose
STRANGE = 0.08  # of the curves are nothing that a film would do


@dataclass(frozen=True)
class Case:
    """A call: its seed, its verb, the files by name, the options after the files, and the curve in words."""

    seed: int
    verb: str
    files: tuple[tuple[str, str], ...]
    options: tuple[str, ...]
    about: str

    @property
    def short(self) -> str:
        """Curve and options on one line."""
        return f"{self.about} | {' '.join(self.options)}"

    def arguments(self, folder: Path) -> list[str]:
        """What follows the name of the program, the files being written into ``folder``."""
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in self.files:
            (folder / name).write_text(text, encoding="utf-8")
        where = [str(folder / CURVE), "--specimen", str(folder / SPECIMEN), "--out", str(folder / "chains")]
        return [self.verb, *where, *self.options, "--json"]


def case(seed: int) -> Case:
    """The call of this seed, always the same one."""
    curve_rng, noise_rng, option_rng = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(3))
    verb = str(option_rng.choice(VERBS))
    found, bench, path, about = _curve(curve_rng)
    files = _files(found, bench, path, noise_rng)
    stated = "force_sd" in files[0][1] or "[measurement]" in files[1][1]
    return Case(seed, verb, files, _options(verb, bench.kind, stated, found, option_rng), about)


# ---- files -----------------------------------------------------------------------------------------------------------


def _curve(rng: np.random.Generator) -> tuple[dict[str, Array], Bench, Motion, str]:
    outer = 10.0 ** rng.uniform(-2.3, -0.7)
    bench = Bench(
        kind=str(rng.choice(RIGS)),
        inner=outer / rng.uniform(1.1, 10),
        outer=outer,
        thickness=10.0 ** rng.uniform(np.log10(20e-6), np.log10(500e-6)),
        family=str(rng.choice(list(FAMILIES))),
    )
    protocol = str(rng.choice(PROTOCOLS))
    points = int(rng.integers(3, 12)) if rng.random() < 0.3 else int(rng.integers(12, 151))
    path = motion(protocol, points, rng)
    if bench.kind == "annulus":
        largest = (outer - bench.inner) * 10.0 ** rng.uniform(-2.5, 0.6)
    else:
        largest = 1 + 10.0 ** rng.uniform(-2.5, 0.7)
    found = columns(bench, path, largest, rng)
    fault = str(rng.choice(FAULTS))
    level = float(rng.choice([0, 1e-6, 1e-3, 1e-2, 1e-1], p=[0.05, 0.1, 0.35, 0.35, 0.15]))
    for name in _forces(found):
        force = spoilt(fault, path, found[name], rng)
        found[name] = noisy(force, level * float(np.max(np.abs(force))), rng)
    strange = _strange(found, rng) if rng.random() < STRANGE else ""
    size = f"{1e3 * largest:.3g} mm of {1e3 * outer:.3g}/{1e3 * bench.inner:.3g}" if "deflection_mm" in found else ""
    size = size or f"to {largest:.3g}"
    words = [f"{bench.kind} {size}", f"{bench.family} {1e6 * bench.thickness:.3g} um", f"{protocol} {path.way.size}"]
    words += [fault, f"noise {level:g}", strange]
    return found, bench, path, ", ".join(w for w in words if w and w != "none")


def _strange(found: dict[str, Array], rng: np.random.Generator) -> str:
    """Change the curve into one that no film gives; the change in a word."""
    forces, ways = _forces(found), [k for k in found if k not in _forces(found)]
    kind = str(rng.choice(["zero", "constant", "falling", "outlier", "negative", "still", "compressed"]))
    for name in forces:
        f = found[name]
        top = float(np.max(np.abs(f)))
        changed = {"zero": 0 * f, "constant": 0 * f + top, "falling": f[::-1].copy(), "negative": f - 0.3 * top}
        found[name] = changed.get(kind, f)
        if kind == "outlier":
            found[name] = np.where(np.arange(f.size) == rng.integers(f.size), 1e3 * f, f)
    for name in ways:
        rest = 0.0 if name == "deflection_mm" else 1.0
        if kind == "still":
            found[name] = np.full_like(found[name], float(np.max(found[name])))
        if kind == "compressed":
            found[name] = np.maximum(rest - 0.5 * (found[name] - rest), 0.1 if rest else -np.inf)
    return kind


def _files(
    found: dict[str, Array], bench: Bench, path: Motion, rng: np.random.Generator
) -> tuple[tuple[str, str], ...]:
    """Curve and specimen, and a covariance where the noise is stated as one."""
    found = dict(found)
    if rng.random() < 0.85:
        found = {"time_s": path.time, **found}
    names = _forces(found)
    width = 1.0 if bench.kind == "annulus" else 1e6 * 0.010 * bench.thickness  # from MPa to N
    top = width * max(float(np.max(np.abs(found[n]))) for n in names)
    sd = max(top, 1e-9) * 10.0 ** rng.uniform(-5, -1)
    stated = str(rng.choice(["none", "none", "none", "one", "column", "covariance"]))
    options, extra = "", []
    if stated == "one":
        options = f"\n[measurement]\nforce_sd_N = {sd:.6g}\n"
    if stated == "column":
        found["force_sd_N"] = np.full(path.way.size, sd) * (1 + rng.uniform(0, 2) * path.way)
    if stated == "covariance":
        count = path.way.size * len(names)
        lag = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
        matrix = sd**2 * rng.uniform(0, 0.9) ** lag
        extra = [(COVARIANCE, "".join(",".join(f"{v:.12g}" for v in row) + "\n" for row in matrix))]
        options = f'\n[measurement]\ncovariance = "{COVARIANCE}"\n'
    table = np.stack(list(found.values()), axis=1)
    digits = int(rng.choice([4, 9, 9]))
    rows = "".join(",".join(f"{v:.{digits}g}" for v in row) + "\n" for row in table)
    radii = f"inner_radius_mm = {1e3 * bench.inner:.6g}\nouter_radius_mm = {1e3 * bench.outer:.6g}\n"
    toml = (
        f'[specimen]\nname = "synthetic film"\nthickness_um = {1e6 * bench.thickness:.6g}\n\n[rig]\n'
        f'kind = "{bench.kind}"\n{radii if bench.kind == "annulus" else ""}{options}'
    )
    return (CURVE, ",".join(found) + "\n" + rows), (SPECIMEN, toml), *extra


def _forces(found: dict[str, Array]) -> list[str]:
    return [k for k in found if k.startswith(("force_N", "nominal_stress"))]


# ---- options ---------------------------------------------------------------------------------------------------------


def _options(verb: str, rig: str, stated: bool, found: dict[str, Array], rng: np.random.Generator) -> tuple[str, ...]:
    effects = components("effects")
    # Half of the calls keep to what can occur on the rig: the others are mostly refused before anything is solved.
    likely = (
        [n for n, e in effects.items() if e.occurs_on(components("rigs")[rig])] if rng.random() < 0.5 else list(effects)
    )
    count = min(int(rng.choice([0, 0, 1, 1, 2])), len(likely))
    chosen = {
        "--material": str(rng.choice(list(components("materials")))),
        "--effects": ",".join(rng.choice(likely, count, replace=False)) if count else "",
        "--noise": str(rng.choice(list(components("noise")))),
        "--convexity": str(rng.choice(CONVEXITY)),
        "--seed": str(int(rng.integers(0, 1000))),
    }
    if rng.random() < 0.25:
        chosen["--max-deflection-mm"] = _cut(found, rng.uniform(0.15, 1.05))
    if verb == "fit" and rng.random() < (0.6 if stated else 0.05):
        chosen["--loss"] = "weighted"
    if verb == "sample":
        chosen["--ess"] = ESS
    if rng.random() < ODD:
        name, value = _odd(verb, found, list(effects), rng)
        chosen[name] = value
    return tuple(part for name, value in chosen.items() if value for part in (name, value))


def _cut(found: dict[str, Array], share: float) -> str:
    """An end of the range in mm: ``share`` of the way from the first reading to the farthest one."""
    name = next(k for k in ("deflection_mm", "stretch", "stretch_1") if k in found)
    way = found[name] if name == "deflection_mm" else 50.0 * (found[name] - 1)
    return f"{way[0] + share * (float(np.max(way)) - way[0]):.5g}"


def _odd(verb: str, found: dict[str, Array], effects: list[str], rng: np.random.Generator) -> tuple[str, str]:
    """An option with a value that nobody should choose."""
    odd = [
        ("--max-deflection-mm", _cut(found, -0.1)),
        ("--max-deflection-mm", _cut(found, 0.02)),
        ("--max-deflection-mm", "nan"),
        ("--max-deflection-mm", "inf"),
        ("--max-deflection-mm", "-3"),
        ("--max-deflection-mm", "ten"),
        ("--effects", f"{effects[0]},{effects[0]}"),
        ("--effects", f", {effects[-1]} ,,"),
        ("--effects", ",".join(effects)),
        ("--effects", "mulins"),
        ("--material", "Yeoh"),
        ("--noise", "pink"),
        ("--convexity", "everywhere"),
        ("--seed", "-1"),
        ("--seed", "123456789012345678901234567890"),
    ]
    if verb == "fit":
        odd += [("--loss", "huber")]
    if verb == "sample":
        odd += [("--ess", v) for v in ("0", "-5", "nan", "inf", "1e9")]
    return odd[int(rng.integers(len(odd)))]
