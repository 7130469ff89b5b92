"""One energy in several modes: posterior, evidence, two modes that foretell the third, and a published fit beside them.

    python -m tests.studies.modes

reads the rubbers of Treloar, Kawabata, Meunier and Kawamura from ../shared/data/constitutive and writes
docs/studies/modes.md; what is stored in --out is not computed again.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bayesmembrane.calibration.joint.claim import joint
from bayesmembrane.calibration.joint.fit import JointFit, fit_jointly
from bayesmembrane.calibration.joint.run import JointRun
from bayesmembrane.comparison.jobs import Judging
from bayesmembrane.comparison.joint import compare_jointly
from bayesmembrane.comparison.result import Comparison
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import components, materials, ordinary_materials
from bayesmembrane.ground.stored import answer, read, store
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis

HERE = Path(__file__).resolve().parents[2]
TARGET = HERE / "docs" / "studies" / "modes.md"
DATA = HERE.parent / "shared" / "data" / "constitutive"
THICKNESS = 1e-3  # m: stresses are all that was measured, and any film will do
MPA = 1e6
RUBBERS = {
    "Treloar_1944": "Treloar, natural rubber",
    "Kawabata_1981": "Kawabata, isoprene rubber",
    "Meunier_2008": "Meunier, silicone",
    "Kawamura_2001": "Kawamura, PDMS",
}
MODES = {"UT": "uniaxial", "PS": "planar", "ET": "equibiaxial"}
PUBLISHED = {
    "ogden": ("Ogden 1972", (0.63 * MPA, 0.0012 * MPA, -0.01 * MPA, 1.3, 5.0, -2.0)),
    "arruda_boyce": ("Arruda and Boyce 1993", (0.27 * MPA, 26.5)),
}
"""Constants for Treloar's rubber: mu_i in Pa and a_i of R. W. Ogden, Proc. R. Soc. A 326 (1972) 565; n k T in Pa and N
of E. M. Arruda, M. C. Boyce, J. Mech. Phys. Solids 41 (1993) 389."""


def measured(rubber: str, folder: Path = DATA) -> dict[str, Measurement]:
    """The tests of one rubber by mode."""
    if rubber == "Kawamura_2001":
        return _kawamura(folder)
    found = {}
    for short, mode in MODES.items():
        stress, stretch = np.loadtxt(folder / f"{rubber}_{short}.txt").T
        found[mode] = _test(mode, stretch, stress)
    return found


def _kawamura(folder: Path) -> dict[str, Measurement]:
    def columns(name: str) -> Array:
        return np.loadtxt(folder / f"Kawamura_2001__{name}.csv", delimiter=",", skiprows=1)

    pulled = np.concatenate([columns("UC"), columns("UT")])
    both = columns("ET")
    general = np.concatenate([columns(f"BT_lambda_1d{i}") for i in (1, 3, 5, 7)])
    return {
        "uniaxial": _test("uniaxial", pulled[:, 0], pulled[:, 3]),
        "equibiaxial": _test("equibiaxial", both[:, 0], both[:, 3]),
        "biaxial": _test(
            "biaxial",
            np.concatenate([general[:, 0], general[:, 1]]),
            np.concatenate([general[:, 3], general[:, 4]]),
            np.concatenate([general[:, 1], general[:, 0]]),
        ),
    }


def _test(mode: str, stretch: Array, stress: Array, across: Array | None = None) -> Measurement:
    rig = components("rigs")[mode]()
    force = stress * MPA * rig.width * THICKNESS
    return Measurement(rig.length * (stretch - 1), force, rig, Specimen(mode, THICKNESS), across=across)


@dataclass(frozen=True)
class Row:
    """One energy on one rubber: root mean square residuals of all modes together, MPa, and of each mode foretold by the
    others, relative to its own root mean square stress (nan where they allow no film).
    """

    rubber: str
    material: str
    residual: dict[str, float]
    foretold: dict[str, float]
    modulus: float


def in_mpa(m: Measurement, newton: float) -> float:
    """A force of a test as its nominal stress."""
    return newton * m.rig.shown(m.specimen.thickness)["N"][0]


def row(rubber: str, name: str, tests: Mapping[str, Measurement]) -> Row:
    """Fits of all modes, and of all but one."""
    claim = hypothesis(name, convexity="none")
    whole = fit_jointly(joint(tests, claim))
    residual = {p.label: in_mpa(tests[p.label], p.rmse_N) for p in whole.parts}
    foretold = {}
    for mode, m in tests.items():
        rest = {label: t for label, t in tests.items() if label != mode}
        foretold[mode] = _missed(m, _fit(rest, name))
    gd = float(claim.material.shear_modulus(np.array(whole.values[: len(claim.material.field_names())])))
    return Row(rubber, name, residual, foretold, gd / THICKNESS / MPA)


def _fit(tests: Mapping[str, Measurement], name: str) -> JointFit | None:
    try:
        return fit_jointly(joint(tests, hypothesis(name, convexity="none")))
    except SettingsError:
        return None


def _missed(m: Measurement, found: JointFit | None) -> float:
    if found is None:
        return float("nan")
    films = found.values[: len(found.joint.material.field_names())][None, :]
    return missed(m, found.joint.material.name, films)


def missed(m: Measurement, name: str, films: Array) -> float:
    """Root mean square of F - y over that of y, of films (1, n)."""
    force = Forward(hypothesis(name), m, m.deflection).film_force(films)[0]
    return float(np.sqrt(np.mean((force - m.force) ** 2) / np.mean(m.force**2)))


def judged(rubber: str, tests: Mapping[str, Measurement], names: list[str], out: Path) -> Comparison:
    """Evidence of every energy on all modes together, computed once."""
    folder = out / rubber
    if answer(folder, "comparison") is not None:
        found: Comparison = read(folder, "comparison")
        return found
    claims = [joint(tests, hypothesis(name, convexity="none")) for name in names]
    done = compare_jointly(
        claims, Judging(seed=1, ess=300.0, out=folder / "runs"), progress=lambda *words: print(*words)
    )
    store(folder, "comparison", done, {"rubber": rubber})
    return done


# ---- the page --------------------------------------------------------------------------------------------------------


def page(rows: list[Row], compared: Mapping[str, Comparison], folder: Path = DATA) -> str:
    """The tables in Markdown."""
    parts = [
        "# One energy in several modes",
        "",
        "Made by `make study-modes` (seed 1) from the measurements of L. R. G. Treloar (1944), S. Kawabata et al. "
        "(1981), L. Meunier et al. (2008) and T. Kawamura et al. (2001). None states a noise: each mode is weighed by "
        "the one that is inferred for it. No convexity is asked for. Residuals are root mean squares of nominal "
        "stress; foretold is the residual of a mode that was left out of the fit, relative to the root mean square "
        "stress of that mode. ln Z is that of all modes together, by nested and by bridge sampling, relative to the "
        "best, the probability is that among these energies; a dash means that it was not computed, or that the two "
        "estimators do not agree well enough for a ranking.",
        "",
    ]
    for rubber, title in RUBBERS.items():
        own = [r for r in rows if r.rubber == rubber]
        if own:
            parts += [f"## {title}", "", *_table(own, compared.get(rubber)), ""]
    if any(r.rubber == "Treloar_1944" for r in rows):
        parts += _beside_published(measured("Treloar_1944", folder))
    return "\n".join(parts) + "\n"


def _table(rows: list[Row], compared: Comparison | None) -> list[str]:
    modes = list(rows[0].residual)
    head = ["energy", "G, MPa", "G, posterior", *(f"{m}, MPa" for m in modes), *(f"{m} foretold" for m in modes)]
    head += ["ln Z, nested", "ln Z, bridge", "probability"]
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    lines += [f"| {' | '.join(_cells(r, modes, compared))} |" for r in rows]
    return lines


def _cells(r: Row, modes: list[str], compared: Comparison | None) -> list[str]:
    told = [r.material, f"{r.modulus:.3f}", "-", *(f"{r.residual[m]:.3f}" for m in modes)]
    told += [f"{100 * r.foretold[m]:.3g} %" if np.isfinite(r.foretold[m]) else "-" for m in modes]
    if compared is None:
        return [*told, "-", "-", "-"]
    judged_ = next((c for c in compared.rows if c.hypothesis.material.name == r.material), None)
    e = None if judged_ is None else judged_.evidence
    if judged_ is None or e is None or judged_.run is None:
        return [*told, "-", "-", "-"]
    best = max(c.evidence.best[0] for c in compared.rows if c.evidence)
    run: JointRun = read(judged_.run, "joint")
    gd = run.joint.material.shear_modulus(run.joint.films(run.draws()).T) / THICKNESS / MPA
    told[2] = f"{gd.mean():.3f} +- {gd.std():.3f}"
    told += [f"{e.log_evidence[n] - best:.1f} +- {e.log_evidence_sd[n]:.1f}" for n in ("nested", "bridge")]
    p = judged_.posterior_probability
    return [*told, "-" if p is None else f"{p:.2g}"]


def _beside_published(tests: Mapping[str, Measurement]) -> list[str]:
    """Published constants on Treloar's curves, beside the fit of all modes."""
    lines = [
        "## Published constants beside the fit, Treloar",
        "",
        "| constants | mode | published, MPa | fit of all modes, MPa |",
        "|---|---|---|---|",
    ]
    for name, (told, constants) in PUBLISHED.items():
        film = materials()[name].from_3d(np.array(constants), THICKNESS).vector[None, :]
        own = row("Treloar_1944", name, tests)
        for mode, m in tests.items():
            rms = in_mpa(m, float(np.sqrt(np.mean(m.force**2))))
            lines.append(f"| {told} | {mode} | {missed(m, name, film) * rms:.3f} | {own.residual[mode]:.3f} |")
    return [
        *lines,
        "",
        "No constants of other authors for the other three rubbers could be read where this was written.",
    ]


def main() -> None:
    """Compute, and write the page after every rubber."""
    options = argparse.ArgumentParser()
    options.add_argument("--out", type=Path, default=HERE / "reports" / "study-modes")
    options.add_argument("--only", default="", help="rubbers by commas")
    options.add_argument("--evidence-on", default="all", help="rubbers by commas, all, or none")
    options.add_argument(
        "--energies", default="", help="energies whose evidence is computed, by commas; all unless given"
    )
    chosen = options.parse_args()
    if not DATA.is_dir():
        raise SystemExit(f"{DATA} is not there")
    names = sorted(ordinary_materials())
    wanted = [r for r in chosen.only.split(",") if r] or list(RUBBERS)
    rows = [row(rubber, name, measured(rubber)) for rubber in wanted for name in names]
    compared: dict[str, Comparison] = {}
    TARGET.write_text(page(rows, compared), encoding="utf-8")
    energies = [e for e in chosen.energies.split(",") if e] or names
    for rubber in wanted if chosen.evidence_on == "all" else [r for r in wanted if r in chosen.evidence_on.split(",")]:
        compared[rubber] = judged(rubber, measured(rubber), energies, chosen.out)
        TARGET.write_text(page(rows, compared), encoding="utf-8")
    print(TARGET.read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
