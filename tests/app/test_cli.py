"""The command line: answers, exit statuses and sentences."""

import json
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.app.cli import main
from bayesmembrane.data.shipped import shipped
from bayesmembrane.ground.registry import material
from bayesmembrane.physics.mechanics import request, solve

Run = Callable[..., tuple[int, str, str]]

CURVE, SPECIMEN = shipped("elastosil_50um_op1.csv"), shipped("elastosil_50um_op1.toml")


def test_force_answers_what_the_solver_answers(run: Run) -> None:
    code, out, _ = run(
        "force", "--material", "yeoh", "--parameters", "8.84,-0.63,0.056", "--deflection-mm", "1,10,35.1", "--json"
    )
    answer = json.loads(out)
    direct = solve(request(material("yeoh"), [8.84, -0.63, 0.056], [1e-3, 0.01, 0.0351], 0.01, 0.035))
    assert code == 0
    assert answer["status"] == ["ok"] * 3
    np.testing.assert_allclose(answer["force_N"], direct.force[0], rtol=1e-12)
    np.testing.assert_allclose(answer["max_stretch"], direct.max_stretch[0], rtol=1e-12)


def test_force_beyond_locking_is_null_with_the_reason(run: Run) -> None:
    code, out, _ = run(
        "force", "--material", "gent", "--parameters", "5.312,17.42", "--deflection-mm", "20,120", "--json"
    )
    answer = json.loads(out)
    assert code == 0
    assert answer["force_N"][0] > 0
    assert answer["force_N"][1] is None
    assert answer["status"][1].startswith("locked")


def test_force_of_another_rig_scales(run: Run) -> None:
    base = ["force", "--material", "neo_hookean", "--parameters", "7.5", "--json", "--deflection-mm"]
    _, one, _ = run(*base, "20")
    _, two, _ = run(*base, "40", "--inner-radius-mm", "20", "--outer-radius-mm", "70")
    assert json.loads(two)["force_N"][0] == pytest.approx(2 * json.loads(one)["force_N"][0], rel=1e-9)


def test_convexity_of_the_papers_mooney_rivlin_film(run: Run) -> None:
    code, out, _ = run("convexity", "--material", "mooney_rivlin", "--parameters", "7,0.5", "--box", "1,8", "--json")
    answer = json.loads(out)
    assert code == 0
    assert answer["convex"] is False
    assert answer["margin"] == pytest.approx(-10 / 3, rel=1e-2)
    assert answer["worst"] == pytest.approx({"l1": 8.0, "l2": 8.0})


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["force", "--material", "gnet", "--parameters", "1", "--deflection-mm", "1"], ['"gnet"', "gent"]),
        (["force", "--material", "gent", "--parameters", "5", "--deflection-mm", "1"], ["2 parameters", "c1, c2"]),
        (["force", "--material", "gent", "--parameters", "5;17", "--deflection-mm", "1"], ["--parameters", "5;17"]),
        (["force", "--material", "gent", "--parameters", "5,17", "--deflection-mm", "1,nan"], ["--deflection-mm"]),
        (
            ["force", "--material", "gent", "--parameters", "5,17", "--deflection-mm", "1", "--inner-radius-mm", "40"],
            ["inner radius", "40 mm"],
        ),
        (["convexity", "--material", "gent", "--parameters", "5,17", "--box", "1"], ["--box"]),
        (["fit", "no.csv", "--specimen", "no.toml", "--material", "gent"], ["no.csv"]),
        (["fit", CURVE, "--specimen", SPECIMEN, "--material", "gent", "--convexity", "boxx"], ['"boxx"', "box"]),
        (["fit", CURVE, "--specimen", SPECIMEN, "--material", "gent", "--loss", "huber"], ["huber"]),
        (["fit", CURVE, "--specimen", SPECIMEN, "--material", "gent", "--effects", "mullin"], ["mullin"]),
        (["fit", CURVE, "--specimen", SPECIMEN, "--material", "gent", "--noise", "pink"], ["pink"]),
        (["report", "no/such/run"], ["no/such/run"]),
    ],
)
def test_a_wrong_setting_is_one_sentence_and_exit_1(run: Run, arguments: list[object], words: list[str]) -> None:
    code, out, err = run(*arguments)
    assert code == 1
    assert out == ""
    assert "Traceback" not in err
    assert len(err.strip().splitlines()) == 1
    for word in words:
        assert word in err


def test_a_missing_option_is_wrong_usage(run: Run) -> None:
    assert run("force", "--material", "gent")[0] == 2


def test_a_negative_seed_is_wrong_usage(run: Run) -> None:
    code, out, err = run("fit", CURVE, "--specimen", SPECIMEN, "--material", "gent", "--seed", "-1")
    assert (code, out) == (2, "")
    assert "--seed" in err
    assert "Traceback" not in err


def test_fit_answers_the_contract(run: Run) -> None:
    code, out, _ = run("fit", CURVE, "--specimen", SPECIMEN, "--material", "neo_hookean", "--json")
    answer = json.loads(out)
    assert code == 0
    assert {"parameters", "rmse_N", "loss_N", "convex", "status"} <= answer.keys()
    assert answer["parameters"]["c1"]["value"] == pytest.approx(7.62, abs=0.05)
    assert answer["loss_N"] == pytest.approx(answer["rmse_N"] * 10**0.5, rel=1e-9)


def test_sample_stores_a_run_that_report_shows(run: Run, tmp_path: Path) -> None:
    common = [CURVE, "--specimen", SPECIMEN, "--material", "neo_hookean", "--ess", "200", "--seed", "11", "--json"]
    code, out, _ = run("sample", *common, "--out", tmp_path / "chains")
    answer = json.loads(out)
    assert code == 0
    assert {"run", "posterior", "ess_bulk", "r_hat", "acceptance", "evaluations", "seconds"} <= answer.keys()
    assert {"mean", "sd", "hdi_94"} <= answer["posterior"]["c1"].keys()
    assert answer["ess_bulk"] >= 200
    again = json.loads(run("sample", *common, "--out", tmp_path / "chains")[1])
    assert again["posterior"] == answer["posterior"]
    code, out, _ = run("report", answer["run"], "--out", tmp_path / "page", "--json")
    assert code == 0
    assert Path(json.loads(out)["report"]).read_text(encoding="utf-8").lstrip().lower().startswith("<!doctype html")


def test_an_unwritable_folder_is_one_sentence(run: Run, tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("mine")
    arguments = ["sample", CURVE, "--specimen", SPECIMEN, "--material", "neo_hookean", "--out", blocked / "chains"]
    code, _, err = run(*arguments)
    assert code == 1
    assert "Traceback" not in err
    assert "cannot be stored" in err.strip().splitlines()[-1]
    assert blocked.read_text() == "mine"


@pytest.mark.study
def test_fit_finds_effects_in_a_curve_of_the_other_solver(run: Run, tmp_path: Path) -> None:
    """The curve is shot, and the shift and the frame are put in by hand, point by point."""
    film, shift, compliance = [8.0, -0.2, 0.03], 6e-4, 4e-4
    knots = np.linspace(1e-3, 0.07, 60)
    shot = solve(request(material("yeoh"), film, knots, 0.01, 0.035, solver="shooting")).force[0]
    deflection = knots + compliance * shot + shift
    force = shot + 1e-3 * np.random.default_rng(4).standard_normal(knots.size)
    rows = "".join(f"{1e3 * d!r},{f!r}\n" for d, f in zip(deflection.tolist(), force.tolist(), strict=True))
    (tmp_path / "c.csv").write_text("deflection_mm,force_N\n" + rows)
    (tmp_path / "c.toml").write_text(
        '[specimen]\nthickness_um = 50\n[rig]\nkind = "annulus"\ninner_radius_mm = 10\nouter_radius_mm = 35\n'
    )
    base = ["fit", tmp_path / "c.csv", "--specimen", tmp_path / "c.toml", "--material", "yeoh", "--json"]
    code, out, _ = run(*base, "--effects", "zero_offset,machine_compliance")
    found = json.loads(out)["parameters"]
    assert code == 0
    known = (("zero_offset.shift", shift), ("c1", film[0]), ("machine_compliance.exponent", 1.0))
    for name, truth in (*known, ("machine_compliance.compliance", compliance)):
        assert abs(found[name]["value"] - truth) < 4 * found[name]["sd"]
    for name, truth in known:
        assert found[name]["sd"] < 0.2 * truth
    _, plain, _ = run(*base)
    assert json.loads(plain)["rmse_N"] > 2 * json.loads(out)["rmse_N"]


@pytest.mark.parametrize(
    ("effects", "sentence"),
    [
        ("zero_ofset", 'no effect called "zero_ofset"; did you mean "zero_offset"'),
        ("mullins,mullins", 'the effect "mullins" is named twice'),
        ("rate", 'the effect "rate" needs times'),
    ],
)
def test_an_effect_that_cannot_be_is_refused_in_a_sentence(run: Run, effects: str, sentence: str) -> None:
    code, _, err = run("fit", CURVE, "--specimen", SPECIMEN, "--material", "yeoh", "--effects", effects)
    assert code == 1
    assert sentence in " ".join(err.split())
    assert "Traceback" not in err


def test_errors_of_a_strip_are_told_in_stress(run: Run, tmp_path: Path) -> None:
    """A step of 12 kPa between the legs of a strip, whatever its width, is read off the table in MPa."""
    stretch = np.concatenate([np.linspace(1.02, 1.6, 30), np.linspace(1.58, 1.04, 28)])
    stress = 1e-1 * (stretch - stretch**-2) + np.where(np.arange(58) < 30, 6e-3, -6e-3)
    rows = [f"{t},{x},{s + 1e-5 * (-1) ** t}" for t, (x, s) in enumerate(zip(stretch, stress, strict=True))]
    (tmp_path / "c.csv").write_text("time_s,stretch,nominal_stress_MPa\n" + "\n".join(rows) + "\n")
    rig = '[specimen]\nthickness_um = 500\n[rig]\nkind = "uniaxial"\nwidth_mm = 7\n'
    (tmp_path / "c.toml").write_text(rig)
    code, out, err = run("diagnose", tmp_path / "c.csv", "--specimen", tmp_path / "c.toml", "--material", "neo_hookean")
    assert code == 0, err
    assert "root mean square, MPa" in out
    assert "the form error going on from there" in out
    (line,) = (x for x in out.splitlines() if "before" in x and "held out" not in x)
    shown = [float(x) for x in line.replace("│", " ").split()[1:3]]
    assert shown[0] == pytest.approx(6e-3, rel=0.05)
    assert 6e-3 <= shown[1] < 9e-3


@pytest.mark.usefixtures("short_walks")
def test_a_biaxial_measurement_is_sampled_compared_and_diagnosed(run: Run, tmp_path: Path) -> None:
    """Every verb on a neo-Hookean film held across, also on a part of it; what was not read is said on stderr."""
    l1 = np.array([1.2, 1.2, 1.5, 1.5, 1.9, 1.9])
    l2 = np.array([1.0, 0.95, 1.0, 1.5, 1.0, 1.3])
    noise = 2e-3 * np.random.default_rng(5).standard_normal((2, 6))
    p1, p2 = (0.3 * (a - a**-3.0 * b**-2.0) + e for a, b, e in ((l1, l2, noise[0]), (l2, l1, noise[1])))
    rows = "".join(f"{a},{b},{s},{t},x\n" for a, b, s, t in zip(l1, l2, p1, p2, strict=True))
    (tmp_path / "c.csv").write_text("stretch_1,stretch_2,nominal_stress_1_MPa,nominal_stress_2_MPa,remark\n" + rows)
    (tmp_path / "c.toml").write_text(
        '[specimen]\nthickness_um = 500\n[rig]\nkind = "biaxial"\n[measurement]\nnominal_stress_sd_kPa = 2\n'
    )
    common = [tmp_path / "c.csv", "--specimen", tmp_path / "c.toml", "--ess", "100", "--json"]
    chains = ["--out", tmp_path / "chains"]
    for part in ([], ["--max-stretch", "1.6"]):
        code, out, err = run("sample", *common, "--material", "neo_hookean", *chains, *part)
        assert code == 0, err
        assert err.count("ignored columns: remark") == 1
        c1 = json.loads(out)["posterior"]["c1"]
        assert abs(c1["mean"] - 75) < 5 * c1["sd"]
    code, out, err = run("loop", *common, "--material", "neo_hookean", *chains, "--report", tmp_path / "page")
    assert code == 0, err
    assert Path(json.loads(out)["report"]).is_file()
    code, out, err = run("compare", *common, "--materials", "neo_hookean", *chains)
    assert code == 0, err
    assert len(json.loads(out)["table"]) == 1


def test_a_strip_is_cut_at_a_stretch_whatever_its_length(run: Run, tmp_path: Path) -> None:
    """Its deflections are those of a length that nobody may have given."""
    stretch = np.linspace(1.05, 2.0, 20)
    stress = np.where(stretch <= 1.52, 0.3 * (stretch - stretch**-2.0), 5.0)
    rows = "".join(f"{x},{s}\n" for x, s in zip(stretch, stress, strict=True))
    (tmp_path / "c.csv").write_text("stretch,nominal_stress_MPa\n" + rows)
    common = [tmp_path / "c.csv", "--specimen", tmp_path / "c.toml", "--material", "neo_hookean"]
    for length in ("", "length_mm = 20\n"):
        (tmp_path / "c.toml").write_text(f'[specimen]\nthickness_um = 500\n[rig]\nkind = "uniaxial"\n{length}')
        code, out, err = run("fit", *common, "--max-stretch", "1.52", "--json")
        assert code == 0, err
        assert json.loads(out)["parameters"]["c1"]["value"] == pytest.approx(75, rel=1e-6)  # 0.3 MPa x 500 um / 2
    code, _, err = run("fit", *common, "--max-stretch", "1.06")
    assert code == 1
    assert "up to a stretch of 1.06 leaves fewer than two points; choose an end from a stretch of 1.1 to" in err
    code, _, err = run("fit", *common, "--max-stretch", "1.5", "--max-deflection-mm", "10")
    assert (code, "given twice" in err) == (1, True)
    code, _, err = run("fit", CURVE, "--specimen", SPECIMEN, "--material", "gent", "--max-stretch", "1.5")
    assert code == 1
    assert "read over deflection, and not over stretch" in err
    assert "--max-deflection-mm" in err


@pytest.mark.parametrize("option", ["--out", "--report"])
def test_a_loop_says_at_once_that_its_answer_could_not_be_written(run: Run, tmp_path: Path, option: str) -> None:
    (tmp_path / "taken").write_text("")
    code, out, err = run("loop", CURVE, "--specimen", SPECIMEN, option, tmp_path / "taken" / "folder")
    assert (code, out) == (1, "")
    assert "cannot be written" in err
    assert "name another one" in err
    assert not (tmp_path / "chains").exists()  # nothing was computed


def test_a_long_measurement_is_thinned_and_it_is_said(run: Run, tmp_path: Path) -> None:
    stretch = np.concatenate([np.linspace(1.01, 2.0, 1000), np.linspace(1.999, 1.02, 900)])
    stress = 0.3 * (stretch - stretch**-2.0) + 2e-3 * np.random.default_rng(9).standard_normal(1900)
    rows = "".join(f"{t},{x},{s}\n" for t, (x, s) in enumerate(zip(stretch, stress, strict=True)))
    (tmp_path / "c.csv").write_text("time_s,stretch,nominal_stress_MPa\n" + rows)
    (tmp_path / "c.toml").write_text('[specimen]\nthickness_um = 500\n[rig]\nkind = "uniaxial"\n')
    common = [tmp_path / "c.csv", "--specimen", tmp_path / "c.toml", "--material", "neo_hookean", "--json"]
    code, out, err = run("diagnose", *common)
    assert code == 0, err
    answer = json.loads(out)
    assert "of the 1900 readings were diagnosed" in answer["thinning"]
    assert answer["sentence"].endswith(answer["thinning"])
    assert "of the 1900 readings are diagnosed" in " ".join(err.split())


def test_an_export_becomes_a_page_in_three_commands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    rows = "".join(f"{k},{k / 2},{0.1 * (1 + k / 50) ** 0.5 * k}\n" for k in range(30))
    sizes = "Gauge length (mm),50\nWidth (mm),10\nThickness (mm),0.5\nTest speed (mm/min),60\n"
    Path("e.csv").write_text(sizes + "Time (s),Extension (mm),Load (N)\n" + rows)

    def run(*words: str) -> str:
        monkeypatch.setattr(sys, "argv", ["bayesmembrane", *words])
        with pytest.raises(SystemExit) as ended:
            main()
        assert ended.value.code in (0, None)
        return capsys.readouterr().out

    monkeypatch.setattr(sys, "argv", ["bayesmembrane", "import", "e.csv", "--json"])
    with pytest.raises(SystemExit):
        main()
    shown = capsys.readouterr()
    said = json.loads(shown.out)
    assert (said["curve"], said["importer"], said["n_points"], said["complete"]) == ("curve.csv", "delimited", 30, True)
    assert {"what", "value", "why", "option"} == set(said["guesses"][0])
    assert 'column of force: "Load (N)" in N, since its name says so (--columns force=... overrides)' in " ".join(
        shown.err.split()
    )
    assert "CONTRADICTION: the stated speed of 60 mm/min" in " ".join(shown.err.split())
    run("fit", "curve.csv", "--specimen", "curve.toml", "--material", "neo_hookean", "--out", "chains")
    run("report", "chains", "--out", "page")
    assert "the stated speed of 60 mm/min" in Path("curve.toml").read_text()
    assert Path("page/index.html").is_file()
