"""A package of another author adds one component of every kind: no file of this package or of its tests knows of it."""

import json
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
ANNULUS = "[specimen]\nthickness_um = 50\n[rig]\nkind = 'annulus'\ninner_radius_mm = 10\nouter_radius_mm = 35\n"
STRIP = "[specimen]\nname = 'strip'\nthickness_um = 500\n[rig]\nkind = 'half_biaxial'\n"
C1, C2, C3 = 60.0, 10.0, 1.5
CONTRACTS = {
    "isihara": "tests/physics/materials/test_contract.py",
    "light_disc": "tests/physics/effects/test_contract.py",
    "proportional": "tests/physics/noise/test_noise.py",
    "half_biaxial": "tests/physics/rigs/test_contract.py",
    "micrometres": "tests/data/importers/test_contract.py",
}


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the package is installed as pip would do it: its files, and what they declare."""
    folder = tmp_path_factory.mktemp("installed")
    project = tomllib.loads((HERE / "pyproject.toml").read_text())["project"]
    shutil.copytree(HERE / "isihara_films", folder / "isihara_films")
    about = folder / f"isihara_films-{project['version']}.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    groups = project["entry-points"].items()
    lines = (f"[{group}]\n" + "".join(f"{k} = {v}\n" for k, v in points.items()) for group, points in groups)
    (about / "entry_points.txt").write_text("\n".join(lines))
    stretch = np.linspace(1.1, 3.0, 12)
    across = 0.5 * (1 + stretch)
    k1 = stretch**2 + across**2 + (stretch * across) ** -2 - 3
    # P1 = dW/dl1 / d of W = c1 K1 + c2 K2 + c3 K1^2.
    p1 = (C1 + 2 * C3 * k1) * 2 * (stretch - stretch**-3 * across**-2)
    p1 += C2 * 2 * (stretch * across**2 - stretch**-3)
    p1 *= 1 + 0.005 * np.random.default_rng(7).standard_normal(12)
    rows = "".join(f"{a:.6g},{1e-6 * p / 5e-4:.6g}\n" for a, p in zip(stretch, p1, strict=True))
    (folder / "strip.csv").write_text("stretch,nominal_stress_MPa\n" + rows)
    (folder / "strip.toml").write_text(STRIP)
    return folder


def environment(place: Path) -> dict[str, str]:
    paths = os.pathsep.join([str(place), str(ROOT)])
    return {**os.environ, "PYTHONPATH": paths, "PYTHONWARNINGS": "error::RuntimeWarning", "MPLBACKEND": "Agg"}


def printed(place: Path, *command: str) -> Any:
    """The JSON that a Python program prints."""
    done = subprocess.run(
        [sys.executable, *command],
        cwd=place,
        env=environment(place),
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def run(place: Path, *words: str) -> dict[str, Any]:
    """The JSON answer of a verb, as a shell starts it."""
    return printed(place, "-m", "bayesmembrane", *words, "--json")


def all_of(place: Path, *commands: list[str]) -> list[dict[str, Any]]:
    """The JSON answers of several verbs, one after the other in one process, where walks are short."""
    return printed(place, "-m", "tests.plugin.verbs", json.dumps(commands))


STRIP_FILES = ("strip.csv", "--specimen", "strip.toml")
MATERIAL = ("--material", "isihara")
BESIDE = ("--effects", "light_disc", "--noise", "proportional")


def test_the_registry_finds_all_of_it(place: Path) -> None:
    groups = list(tomllib.loads((HERE / "pyproject.toml").read_text())["project"]["entry-points"])
    assert {g.rpartition(".")[2] for g in groups} == {"materials", "effects", "noise", "rigs", "importers", "sections"}
    program = (
        "import json; from bayesmembrane.ground.registry import components\n"
        f"print(json.dumps([list(components(g)) for g in {[g.rpartition('.')[2] for g in groups]}]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment(place), capture_output=True, text=True, check=True
    )
    for own, found in zip((*CONTRACTS, "stiffness"), json.loads(done.stdout), strict=True):
        assert own in found


def test_the_contracts_hold_for_it(place: Path) -> None:
    """The same tests as for the components of this package, which find it by themselves."""
    command = [sys.executable, "-m", "pytest", "-q", "-rp", "-n0", "-p", "no:cacheprovider", *CONTRACTS.values()]
    command += ["-k", " or ".join(CONTRACTS)]
    done = subprocess.run(
        command, cwd=ROOT, env=environment(place), capture_output=True, text=True, timeout=900, check=False
    )
    assert done.returncode == 0, done.stdout[-4000:]
    passed = [line for line in done.stdout.splitlines() if line.startswith("PASSED")]
    for name, file in CONTRACTS.items():
        assert any(file in line and name in line for line in passed), name


def test_an_export_becomes_a_fitted_film(place: Path) -> None:
    """From the tester's file through the importer to a calibrated ring, solved by kernels compiled for the energy."""
    force = run(place, "force", *MATERIAL, "--parameters", "6,1,0.1", "--deflection-mm", "5,15,25,35,45,55")
    assert set(force["status"]) == {"ok"}
    lines = (f"{1000 * d:g} {1000 * f:.12g}" for d, f in zip(force["deflection_mm"], force["force_N"], strict=True))
    (place / "export.txt").write_text("MICROTESTER 2\n" + "\n".join(lines) + "\n")
    (place / "annulus.toml").write_text(ANNULUS)
    imported, fitted, convexity = all_of(
        place,
        ["import", "export.txt", "--out", "ring.csv"],
        ["fit", "ring.csv", "--specimen", "annulus.toml", *MATERIAL],
        ["convexity", *MATERIAL, "--parameters", "6,1,0.1", "--box", "1,4"],
    )
    assert imported["importer"] == "micrometres"
    assert [fitted["parameters"][c]["value"] for c in ("c1", "c2", "c3")] == pytest.approx([6, 1, 0.1], rel=1e-3)
    assert convexity["margin"] is not None


def test_every_verb_takes_it_and_the_page_shows_it(place: Path) -> None:
    commands = [
        ["fit", *STRIP_FILES, *MATERIAL, *BESIDE, "--out", "answers"],
        ["sample", *STRIP_FILES, *MATERIAL, *BESIDE, "--out", "answers"],
        ["compare", *STRIP_FILES, "--materials", "isihara,neo_hookean", "--out", "more"],
        ["valleys", *STRIP_FILES, *MATERIAL, "--out", "more"],
        ["diagnose", *STRIP_FILES, *MATERIAL, "--out", "more"],
        ["loop", *STRIP_FILES, *MATERIAL, *BESIDE, "--out", "more", "--report", "looped"],
        ["report", "answers", "more", "--out", "page"],
    ]
    fitted, sampled, compared, valleys, diagnosed, looped, _ = all_of(place, *commands)
    assert fitted["rmse_N"] < 0.02 * 2.0 * C1
    assert {"c1", "c2", "c3", "light_disc.weight"} <= set(fitted["parameters"])
    assert {"c1", "c2", "c3", "light_disc.weight", "noise.sd"} <= set(sampled["posterior"])
    assert {row["hypothesis"] for row in compared["table"]} == {"isihara", "neo_hookean"}
    assert valleys["ranges"][0]["parameters"] == ["c1", "c2", "c3"]
    assert diagnosed["verdict"] == "adequate"
    assert "Isihara describes the curve" in diagnosed["sentence"]
    (first,) = looped["rounds"]
    assert first["verdict"] == "adequate"
    assert {"c3", "light_disc.weight", "noise.sd"} <= set(first["before"]["posterior"])
    assert (place / looped["report"]).is_file()
    page = (place / "page" / "index.html").read_text()
    for said in ("Isihara", "weight of disc or grip", "proportional", "Secant stiffness", "pulled half as far"):
        assert said in page, said
    assert "Left out" not in page
    assert "What was missing: strip, Isihara with weight of disc or grip" in page
    assert "What may be missing: Isihara<" in page
