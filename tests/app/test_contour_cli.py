"""The force of a film and its traced contour, calibrated together at the command line."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.data.writing import write_measurement
from bayesmembrane.ground.registry import material
from tests.physics.mechanics.films import INNER, MM, OUTER
from tests.physics.rigs.test_contour import TOML, lifted, traced
from tests.reference.slow_solver import force_curve

Run = Callable[..., tuple[int, str, str]]


@pytest.mark.usefixtures("short_walks")
@pytest.mark.study
def test_force_and_contour_at_the_command_line(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    d = np.linspace(5 * MM, 35 * MM, 8)
    write_measurement(lifted(d, force_curve(material("neo_hookean")(7.5), d, INNER, OUTER)), "film.csv", "film.toml")
    shape = traced("neo_hookean", [7.5], 0.1 * MM)
    rows = "".join(f"{1e3 * r:.6g},{1e3 * h:.8g}\n" for r, h in zip(shape.deflection, shape.force, strict=True))
    Path("c.csv").write_text("radius_mm,height_mm\n" + rows)
    Path("c.toml").write_text(TOML)
    words = ("film.csv", "--specimen", "film.toml", "--with", "c.csv:c.toml", "--material", "neo_hookean", "--json")
    status, out, err = run("fit", *words)
    assert status == 0, err
    assert json.loads(out)["parameters"]["c1"]["value"] == pytest.approx(7.5, rel=1e-2)
    status, out, err = run("sample", *words, "--out", "runs", "--ess", 50)
    assert status == 0, err
    assert set(json.loads(out)["tests"]) == {"film", "shape"}
    status, out, err = run("report", "runs", "--out", "page")
    assert status == 0, err
    page = (Path("page") / "index.html").read_text()
    assert "heights in that of forces" in page
