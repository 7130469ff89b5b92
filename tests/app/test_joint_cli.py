"""Several tests of one material at the command line."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

Run = Callable[..., tuple[int, str, str]]

pytestmark = pytest.mark.usefixtures("folder")

NOISE = 0.002


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A strip and a thicker sheet of one neo-Hookean rubber, c1 = 0.2 MPa, and a project that lists them."""
    rng = np.random.default_rng(1)
    for name, power, thickness in (("strip", -2, 100), ("sheet", -5, 300)):
        stretch = np.linspace(1.1, 2.0, 10)
        stress = 0.4 * (stretch - stretch**power) + NOISE * rng.standard_normal(10)
        lines = [f"{a:.6f},{b:.8f}" for a, b in zip(stretch, stress, strict=True)]
        (tmp_path / f"{name}.csv").write_text("\n".join(["stretch,nominal_stress_MPa", *lines]))
        kind = "uniaxial" if name == "strip" else "equibiaxial"
        (tmp_path / f"{name}.toml").write_text(
            f'[specimen]\nname = "{name}"\nthickness_um = {thickness}\n[rig]\nkind = "{kind}"\n'
            f"[measurement]\nnominal_stress_sd_MPa = {NOISE}\n"
        )
    tests = (f'[[test]]\ncurve = "{n}.csv"\nspecimen = "{n}.toml"\n' for n in ("strip", "sheet"))
    (tmp_path / "project.toml").write_text("".join(tests))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def assert_read_as(answer: dict[str, Any], rmse: float) -> None:
    """What is in N of a test becomes the stress that was measured: ``rmse`` N is the noise that the strip states."""
    assert set(answer["read_as"]) == {"strip", "sheet"}
    told = answer["read_as"]["strip"]["N"]
    assert told["unit"] == "MPa"
    assert told["factor"] * rmse == pytest.approx(NOISE)
    assert answer["read_as"]["sheet"]["N"]["factor"] == pytest.approx(told["factor"] / 3)  # thrice as thick


def test_with_and_a_project_are_the_same_question(run: Run) -> None:
    one = run(
        "fit",
        "strip.csv",
        "--specimen",
        "strip.toml",
        "--with",
        "sheet.csv:sheet.toml",
        "--material",
        "neo_hookean",
        "--json",
    )
    other = run("fit", "project.toml", "--material", "neo_hookean", "--json")
    assert one[0] == other[0] == 0, one[2] + other[2]
    answer = json.loads(one[1])
    assert answer == json.loads(other[1])
    assert answer["thickness_um"] == pytest.approx(100)
    assert answer["parameters"]["c1"]["value"] == pytest.approx(20.0, rel=0.02)
    assert answer["tests"]["sheet"]["parameters"]["c1"] == pytest.approx(60.0, rel=0.02)
    assert Path(answer["stored"]).is_dir()
    assert_read_as(answer, rmse=answer["tests"]["strip"]["noise_N"])


def test_an_effect_is_claimed_of_all_tests_or_of_one(run: Run) -> None:
    for effects, own in (("zero_offset", {"strip", "sheet"}), ("zero_offset@sheet", {"sheet"})):
        code, out, err = run("fit", "project.toml", "--material", "neo_hookean", "--effects", effects, "--json")
        assert code == 0, err
        assert {n.split(".")[0] for n in json.loads(out)["parameters"] if n.endswith("shift")} == own


def test_sampling_and_comparing(run: Run, short_walks: None) -> None:
    code, out, err = run("sample", "project.toml", "--material", "neo_hookean", "--ess", "50", "--json", "--out", "o")
    assert code == 0, err
    answer = json.loads(out)
    assert answer["stored"] == answer["run"]
    assert answer["posterior"]["c1"]["mean"] == pytest.approx(20.0, rel=0.05)
    assert set(answer["tests"]) == {"strip", "sheet"}
    assert answer["sentences"]
    assert_read_as(answer, rmse=answer["tests"]["strip"]["goodness"]["own_noise_N"])
    code, out, err = run("report", answer["stored"], "--out", "page")
    assert code == 0, err
    assert "Stability limits" in (Path("page") / "index.html").read_text()
    code, out, err = run("sample", "project.toml", "--material", "neo_hookean", "--ess", "50", "--out", "o")
    assert code == 0, err
    assert re.search(r"c1 .* N/m ", out)  # the same run again, in words: every number with its unit
    assert re.search(r"strip.noise.sd .* N ", out)
    pair = ("strip.csv", "--specimen", "strip.toml", "--with", "sheet.csv:sheet.toml")
    code, out, err = run("compare", *pair, "--materials", "neo_hookean", "--ess", "50", "--json", "--out", "o")
    assert code == 0, err
    (row,) = json.loads(out)["table"]
    assert row["hypothesis"] == "neo_hookean"
    assert row["log_evidence"]["bridge"] == pytest.approx(row["log_evidence"]["nested"], abs=0.5)


@pytest.mark.parametrize(
    ("words", "code", "match"),
    [
        (("fit", "strip.csv", "--material", "gent"), 2, "--specimen"),
        (
            ("fit", "strip.csv", "--specimen", "strip.toml", "--with", "sheet.csv", "--material", "gent"),
            1,
            "no curve with its",
        ),
        (("fit", "project.toml", "--material", "gent", "--effects", "zero_offset@disc"), 1, '"disc"'),
        (("fit", "project.toml", "--material", "gent", "--effects", "off_centre_disc"), 1, "no test can show it"),
        (("fit", "project.toml", "--material", "gent", "--then", "strip.csv"), 1, "lists its tests itself"),
        (("fit", "project.toml", "--material", "gent", "--specimen", "strip.toml"), 1, "lists the specimens itself"),
        (("sample", "project.toml", "--material", "gent", "--fork", "o"), 1, "begins on its own"),
        (("compare", "project.toml", "--materials", "gent", "--ranges-mm", "3"), 1, "no ranges in common"),
        (("compare", "project.toml", "--materials", "gent,gent"), 1, "there twice"),
    ],
)
def test_what_cannot_be_is_said_in_a_sentence(run: Run, words: tuple[str, ...], code: int, match: str) -> None:
    found, out, err = run(*words)
    assert found == code
    assert match in err + out


@pytest.mark.parametrize(
    ("words", "match"),
    [
        (("--predict", "sheet.csv"), "is no curve with its specimen file"),
        (("--predict", "sheet.csv:sheet.toml"), "another kind of rig"),
        (("--predict", "strip.csv:strip.toml", "--scatter", "-1"), "scatter of -1"),
    ],
)
def test_a_loop_says_which_test_it_cannot_predict(run: Run, words: tuple[str, ...], match: str) -> None:
    code, _, err = run("loop", "strip.csv", "--specimen", "strip.toml", *words)
    assert code == 1
    assert match in err


def test_runs_of_specimens_make_a_population(run: Run, short_walks: None) -> None:
    runs = []
    for name in ("strip", "sheet"):
        words = ("sample", f"{name}.csv", "--specimen", f"{name}.toml", "--material", "neo_hookean", "--ess", "50")
        code, out, err = run(*words, "--json", "--out", "o")
        assert code == 0, err
        runs.append(json.loads(out)["run"])
    code, out, err = run("population", *runs, "--json", "--out", "p")
    assert code == 0, err
    answer = json.loads(out)
    assert answer["specimens"] == ["strip", "sheet"]
    assert answer["modulus_MPa"]["mean"]["mean"] == pytest.approx(0.4, rel=0.3)
    assert "the prior of the scatter has a say" in " ".join(answer["sentences"])
    assert "The next specimen, 100 um thick, carries" in " ".join(answer["sentences"])
    following = answer["next_curve"]
    assert (following["rig"], following["thickness_um"]) == ("uniaxial", pytest.approx(100))
    middle, wide = (np.array(list(following[k].values())) for k in ("mean_specimen_N", "force_N"))
    assert wide.shape == (3, len(following["deflection_mm"]))
    assert np.all(np.diff(wide, axis=0) > 0)
    assert np.all(np.ptp(middle, axis=0) < np.ptp(wide, axis=0))
    assert run("population", *runs, "--out", "p")[0] == 0
    assert run("report", answer["stored"], "--out", "page")[0] == 0
    page = Path("page/index.html").read_text()
    assert "The population of specimens" in page
    assert "90 % bands of its curve" in page
    (earlier,) = Path("p").glob("*_population_*")
    code, out, err = run("population", *runs, str(earlier), "--out", "p")
    assert code == 0
    assert f"{earlier} is an earlier answer about a population, no run: left out." in " ".join(err.split())
    code, out, err = run("population", runs[0], "--out", "p")
    assert (code, out) == (1, "")
    assert "two specimens at least" in err


def test_what_two_tests_miss_is_asked_of_both_and_shown(run: Run, folder: Path) -> None:
    """The sheet reads a tenth too much: alone its modulus absorbs it."""
    rows = [line.split(",") for line in (folder / "sheet.csv").read_text().splitlines()[1:]]
    lines = [f"{a},{1.1 * float(b):.8f}" for a, b in rows]
    (folder / "sheet.csv").write_text("\n".join(["stretch,nominal_stress_MPa", *lines]))
    code, out, err = run("diagnose", "project.toml", "--quick", "--json", "--out", "answers")
    assert code == 0, err
    answer = json.loads(out)
    assert answer["verdict"] != "adequate"
    assert any(name.partition("@")[0] in ("thickness", "force_gain") for name in answer["effects"])
    assert set(answer["tests"]) == {"strip", "sheet"}
    assert "strip and sheet together" in answer["sentence"]
    code, _, err = run("report", "answers", "--out", "page")
    assert code == 0, err
    page = (folder / "page" / "index.html").read_text()
    assert "What several tests miss" in page
    assert "<svg" in page or "data:image" in page
