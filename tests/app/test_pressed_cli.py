"""A test in compression through the verbs: what is asked of a lifted film is asked of a pressed block."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

Run = Callable[..., tuple[int, str, str]]

C1 = 0.2  # MPa


@pytest.fixture
def block(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[str, ...]:
    """A neo-Hookean block, pressed to half its height, its stress recorded negative, as CSV of a uniaxial test."""
    stretch = np.linspace(0.98, 0.5, 25)
    stress = 2 * C1 * (stretch - stretch**-2) + 0.005 * np.random.default_rng(4).standard_normal(25)
    rows = "".join(f"{a:.6f},{b:.8f}\n" for a, b in zip(stretch, stress, strict=True))
    (tmp_path / "c.csv").write_text("stretch,nominal_stress_MPa\n" + rows)
    (tmp_path / "c.toml").write_text(
        '[specimen]\nname = "block"\nthickness_um = 1000\n[rig]\nkind = "uniaxial"\n'
        "[measurement]\nnominal_stress_sd_MPa = 0.005\n"
    )
    monkeypatch.chdir(tmp_path)
    return "c.csv", "--specimen", "c.toml"


def test_it_is_sampled_and_its_page_says_compression(run: Run, block: tuple[str, ...]) -> None:
    status, out, err = run("sample", *block, "--material", "neo_hookean", "--json", "--out", "runs")
    assert status == 0, err
    told = json.loads(out)
    sd = told["posterior"]["c1"]["sd"]
    assert abs(told["posterior"]["c1"]["mean"] - 1000 * C1) < 5 * sd
    status, out, err = run("report", "runs", "--out", "page")
    assert status == 0, err
    page = (Path("page") / "index.html").read_text()
    assert "a compression of 0.5" in page
    assert "a stretch of" not in page


@pytest.mark.study
@pytest.mark.usefixtures("short_walks")
def test_it_is_compared_and_diagnosed(run: Run, block: tuple[str, ...]) -> None:
    status, out, err = run("compare", *block, "--materials", "neo_hookean,gent", "--json", "--ess", 50)
    assert status == 0, err
    assert {row["hypothesis"] for row in json.loads(out)["table"]} == {"neo_hookean", "gent"}
    status, out, err = run("diagnose", *block, "--material", "neo_hookean", "--json")
    assert status == 0, err
    told = json.loads(out)
    assert told["verdict"] == "adequate"
    assert "stretch" not in told["sentence"]
