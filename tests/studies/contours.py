"""How much a traced contour shortens the valleys of Mooney-Rivlin and Ogden films.

    python -m tests.studies.contours

simulates force curves and contours with the slow solvers of tests/reference (nothing that calibrates), samples the
posterior of the force alone and of force and contour together, sets the curvature at the truth beside it, and writes
docs/studies/contours.md. Rows in --out are not computed again; --films "" writes the page of what is there.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.calibration.joint.claim import joint
from bayesmembrane.calibration.joint.run import sample_jointly
from bayesmembrane.calibration.run import RunSettings
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import material
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import Hypothesis, hypothesis
from bayesmembrane.physics.noise.white import White
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.physics.rigs.contour import Contour
from tests.reference.slow_solver import contour, force_curve

HERE = Path(__file__).resolve().parents[2]
TARGET = HERE / "docs" / "studies" / "contours.md"
INNER, OUTER, LIFT, THICKNESS = 0.010, 0.035, 0.0351, 5e-5  # m
FILMS = {
    "mooney_rivlin": (6.21436, 1.4703426),
    "ogden": (11.060008, 0.1959017, -0.3679535, 1.5196142, 5.805068, -1.1529809),
}
"""N/m; a silicone film of 50 um, as calibrated from the paper's curve."""
FORCES, FORCE_SD = 15, 0.004  # readings up to the lift; N
TRACED, HEIGHTS_MM = 40, (0.0, 0.3, 0.1, 0.03)  # points of a contour; standard deviations of a height, 0: none
ESS = 400.0


def curve(name: str, seed: int) -> Measurement:
    """The force curve of a film up to the lift."""
    at = np.linspace(LIFT / FORCES, LIFT, FORCES)
    force = force_curve(material(name)(*FILMS[name]), at, INNER, OUTER)
    force = force + FORCE_SD * np.random.default_rng([seed, 1]).standard_normal(FORCES)
    film = Specimen("film", THICKNESS)
    return Measurement(at, force, Annulus(INNER, OUTER), film, force_sd=np.full(FORCES, FORCE_SD))


def shape(name: str, sd: float, seed: int) -> Measurement:
    """Its contour at the lift, heights with the standard deviation ``sd`` in m."""
    r, h = contour(material(name)(*FILMS[name]), LIFT, INNER, OUTER)
    radius = np.linspace(INNER, OUTER, TRACED + 2)[1:-1]
    height = np.interp(radius, r, h) + sd * np.random.default_rng([seed, 2]).standard_normal(TRACED)
    rig = Contour(INNER, OUTER, LIFT)
    return Measurement(radius, height, rig, Specimen("film", THICKNESS), force_sd=np.full(TRACED, sd))


def claimed(name: str) -> Hypothesis:
    return replace(hypothesis(name), noise=White.stated_only())


def row(name: str, sd_mm: float | None, seed: int) -> dict[str, Any]:
    """Posterior of the force alone (``sd_mm`` None), or with a contour."""
    begun, tests = time.time(), {"force": curve(name, seed)}
    if sd_mm is not None:
        tests["contour"] = shape(name, 1e-3 * sd_mm, seed)
    claim = joint(tests, claimed(name))
    run = sample_jointly(claim, RunSettings(seed, None, settings=Settings(ess=ESS)))
    x = run.draws()
    truth = material(name).to_coordinates(np.array(FILMS[name]))
    return {
        "film": name,
        "height_sd_mm": sd_mm,
        "seed": seed,
        "names": [n.split(".")[-1] for n in claim.names],
        "sd": np.std(x, axis=0).tolist(),
        "off": ((np.mean(x, axis=0) - truth) / np.std(x, axis=0)).tolist(),
        "length": length(np.cov(x.T)),
        "volume": volume(np.cov(x.T)),
        "ess": float(run.status["ess_bulk"]),
        "r_hat": float(run.status["r_hat"]),
        "seconds": time.time() - begun,
    }


def linear(name: str, sd_mm: float) -> dict[str, Any]:
    """The same by the curvature at the truth: C^-1 = C_0^-1 + sum over tests of J^T S^-1 J, without any walk."""
    tests = [curve(name, 1), *([shape(name, 1e-3 * sd_mm, 1)] if sd_mm else [])]
    claim = claimed(name)
    x = material(name).to_coordinates(np.array(FILMS[name]))
    precision = np.diag([float(p.prior.distribution().var()) ** -1 for p in claim.parameters])
    for m in tests:
        found = Forward(claim, m, m.deflection)(x, sensitivities=True)
        assert found.sensitivity is not None
        assert m.force_sd is not None
        slopes = found.sensitivity[0] / m.force_sd[:, None]
        precision += slopes.T @ slopes
    c = np.linalg.inv(precision)
    names = [p.name.split(".")[-1] for p in claim.parameters]
    told = {"film": name, "height_sd_mm": sd_mm or None, "names": names, "sd": np.sqrt(np.diag(c)).tolist()}
    return {**told, "length": length(c), "volume": volume(c)}


def length(covariance: Array) -> float:
    """The standard deviation along the longest axis of a covariance (k, k)."""
    return float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))


def volume(covariance: Array) -> float:
    """The geometric mean of the standard deviations along all axes."""
    return float(np.exp(0.5 * np.linalg.slogdet(covariance)[1] / len(covariance)))


def page(rows: list[Mapping[str, Any]]) -> str:
    """The tables in Markdown."""
    parts = [
        "# What a traced contour adds to the force",
        "",
        f"Made by `python -m tests.studies.contours` (seed 1). {FORCES} forces up to {1e3 * LIFT:g} mm with "
        f"{1e3 * FORCE_SD:g} mN and {TRACED} heights of the film at that deflection, both simulated by the slow "
        "solvers of `tests/reference` (shooting, collocation) and calibrated by the package with the noise that is "
        "stated. Numbers are posterior standard deviations of the sampling coordinates; length is the one along the "
        "longest axis of the posterior, that is of the valley, and mean axis the geometric mean over all axes. In "
        "brackets: part of what it is without a contour. Farthest is the largest distance of the posterior's mean from "
        "the truth, in standard deviations. The second table is what the curvature of prior and likelihood at the true "
        "parameters gives, without a walk: a long and bent valley is longer, or is cut off by bounds.",
        "",
    ]
    for film in FILMS:
        parts += [f"## {material(film).title}", ""]
        sampled = [r for r in rows if r["film"] == film]
        parts += _table("Sampled:", sampled, ["farthest", "ESS", "R-hat"]) if sampled else ["Not sampled yet.", ""]
        parts += _table("By the curvature at the truth:", [linear(film, sd) for sd in HEIGHTS_MM], [])
    return "\n".join(parts)


def _table(title: str, rows: list[Mapping[str, Any]], more: list[str]) -> list[str]:
    head = ["heights known to", *rows[0]["names"], "length", "mean axis", *more]
    alone = next((r for r in rows if r["height_sd_mm"] is None), None)
    lines = [title, "", f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    return [*lines, *(f"| {' | '.join(_cells(r, alone))} |" for r in rows), ""]


def _cells(row: Mapping[str, Any], alone: Mapping[str, Any] | None) -> list[str]:
    def beside(value: float, other: float | None) -> str:
        return f"{value:.3g}" if other is None or row is alone else f"{value:.3g} ({value / other:.2g})"

    told = ["no contour" if row["height_sd_mm"] is None else f"{row['height_sd_mm']:g} mm"]
    told += [beside(v, alone["sd"][i] if alone else None) for i, v in enumerate(row["sd"])]
    told += [beside(row[k], alone[k] if alone else None) for k in ("length", "volume")]
    if "off" not in row:
        return told
    return [*told, f"{np.max(np.abs(row['off'])):.1f}", f"{row['ess']:.0f}", f"{row['r_hat']:.3f}"]


def main() -> None:
    """Compute what is missing, and write the page after every row."""
    options = argparse.ArgumentParser()
    options.add_argument("--out", type=Path, default=HERE / "reports" / "study-contours")
    options.add_argument("--films", default=",".join(FILMS))
    options.add_argument("--heights-mm", default=",".join(map(str, HEIGHTS_MM)), help="0: no contour")
    chosen = options.parse_args()
    chosen.out.mkdir(parents=True, exist_ok=True)
    _write(chosen.out)
    for name in filter(None, chosen.films.split(",")):
        for sd in map(float, chosen.heights_mm.split(",")):
            file = chosen.out / f"{name}_{sd:g}.json"
            if not file.exists():
                file.write_text(json.dumps(row(name, sd or None, seed=1)), encoding="utf-8")
            _write(chosen.out)
            print(name, sd, flush=True)


def _write(folder: Path) -> None:
    rows = [json.loads(f.read_text(encoding="utf-8")) for f in folder.glob("*.json")]
    TARGET.write_text(page(sorted(rows, key=lambda r: -(r["height_sd_mm"] or np.inf))), encoding="utf-8")


if __name__ == "__main__":
    main()
