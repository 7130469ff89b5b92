"""Tests of several kinds on one page: each is in the units of its own rig."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from bayesmembrane.calibration.joint.claim import joint
from bayesmembrane.calibration.joint.run import sample_jointly
from bayesmembrane.calibration.run import RunSettings
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from bayesmembrane.report.page import TWIN, write_report
from bayesmembrane.report.runs import Shown
from tests.calibration.joint.tests_of import STRIP, made
from tests.report.conftest import SD, measured

pytestmark = pytest.mark.usefixtures("blank_pictures")


def on_a_strip(s: Shown, thickness: float) -> Shown:
    """The same run, had it been a strip of 50 by 10 mm."""
    return replace(s, film=replace(s.film, rig=Uniaxial(), thickness=thickness))


def test_runs_on_a_film_and_on_strips_have_their_own_columns(tmp_path: Path, yeoh: Shown) -> None:
    write_report([yeoh, on_a_strip(yeoh, 1e-3), on_a_strip(yeoh, 2e-3)], tmp_path)
    tables = json.loads((tmp_path / TWIN).read_text())["tables"]
    (film,), strips = tables["fits"], tables["fits 2"]
    rmse = yeoh.goodness["rmse_N"]
    assert (film["end_mm"], film["rmse_mN"]) == pytest.approx((35.0, 1e3 * rmse))
    assert [row["end_stretch"] for row in strips] == pytest.approx([1.7, 1.7])
    assert [row["rmse_MPa"] for row in strips] == pytest.approx([1e-1 * rmse, 0.5e-1 * rmse])
    for name in ("convexity", "outcomes", "sampling"):
        assert [row["end"] for row in tables[name]] == ["35 mm", "a stretch of 1.7", "a stretch of 1.7"]
    assert "at_mm" in tables["crosscheck"][0]
    assert "at_stretch" in tables["crosscheck 2"][0]


def test_the_tests_of_a_joint_run_are_in_the_units_in_which_their_noise_was_stated(tmp_path: Path) -> None:
    strip = made(STRIP, "neo_hookean", (10.0,), seed=5, noise=0.03)
    few = RunSettings(settings=Settings(ess=1e6, walkers=16, chunk=20, most_steps=40))
    run = sample_jointly(joint([measured(), strip], hypothesis("neo_hookean")), few)
    write_report([run], tmp_path)
    tables = json.loads((tmp_path / TWIN).read_text())["tables"]
    (film,), (pulled,) = tables["joint tests"], tables["joint tests 2"]
    stress = strip.rig.shown(strip.specimen.thickness)["N"][0]
    own, of_strip = (part.status["goodness"] for part in run.parts)
    assert film["own_noise_mN"] == pytest.approx(1e3 * SD)
    assert film["rmse_mN"] == pytest.approx(1e3 * own["rmse_N"])
    assert pulled["rmse_MPa"] == pytest.approx(stress * of_strip["rmse_N"])
    assert pulled["own_noise_MPa"] == pytest.approx(stress * of_strip["own_noise_N"])
