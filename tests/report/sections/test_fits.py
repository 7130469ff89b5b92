"""A fit alone on a page."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.calibration.fit import Fit, FittedParameter
from bayesmembrane.ground.stored import store
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from bayesmembrane.report.page import TWIN, write_report
from bayesmembrane.words.calibration import fit_sentence
from tests.report.pages import without_pictures

AT = np.linspace(0.001, 0.035, 9)


def fitted() -> Fit:
    parameters = {
        "yeoh.c1": FittedParameter(8.8, 0.1, "N/m"),
        "yeoh.c2": FittedParameter(-0.6, 0.02, "N/m"),
        "yeoh.c3": FittedParameter(0.05, None, "N/m"),
    }
    margins = {"reached": 0.1, "box": 0.1, "elliptic": 0.1, "none": 0.1}
    found = Fit(
        hypothesis("yeoh"), "euclidean", np.zeros(3), np.eye(3), parameters, AT, 60 * AT, 0.01, 3e-3, 5e-3, 0.01,
        margins, (), "converged",
    )  # fmt: skip
    return replace(found, constrained=found)


def test_a_fit_stands_alone(tmp_path: Path) -> None:
    page = write_report([fitted()], tmp_path).read_text()
    twin = json.loads((tmp_path / TWIN).read_text())
    assert twin["answer"] == ["Yeoh fitted up to 35 mm misses the forces by 3.00 mN rms, at most 5.00 mN."]
    assert twin["tables"]["optimum"][0] == {"parameter": "c1", "unit": "N/m", "value": 8.8, "sd": 0.1}
    assert twin["tables"]["optimum"][2]["sd"] is None
    assert 'id="fits"' in page
    assert 'id="data"' not in page


def test_a_strip_is_told_in_stretch_and_stress(tmp_path: Path) -> None:
    strip = replace(fitted(), rig=Uniaxial(length=0.05, width=0.01), thickness=1e-3, constrained=None)
    page = without_pictures(write_report([strip], tmp_path).read_text())
    (row,) = json.loads((tmp_path / TWIN).read_text())["tables"]["optima"]
    assert row["end"] == pytest.approx(1.7)  # 35 mm on 50
    assert row["rmse_MPa"] == pytest.approx(3e-4)  # 3 mN on 10 mm by 1 mm
    assert "up to a stretch of 1.7 misses the stresses by 0.000300 MPa rms" in page
    assert "fitted up to, stretch (-)" in page
    assert " mN" not in page
    assert " mm" not in page


def test_a_film_and_strips_on_one_page_keep_their_own_units(tmp_path: Path) -> None:
    strip = replace(fitted(), rig=Uniaxial(length=0.05, width=0.01), thickness=1e-3, constrained=None)
    thick = replace(strip, thickness=4e-3, rmse_N=4 * strip.rmse_N)
    page = without_pictures(write_report([strip, fitted(), thick], tmp_path).read_text())
    tables = json.loads((tmp_path / TWIN).read_text())["tables"]
    assert [row["end"] for row in tables["optima"]] == pytest.approx([1.7, 1.7])
    assert [row["rmse_MPa"] for row in tables["optima"]] == pytest.approx([3e-4, 3e-4])  # the same stress
    (film,) = tables["optima 2"]
    assert (film["end_mm"], film["rmse_mN"]) == pytest.approx((35.0, 3.0))
    assert "Fitted stress (MPa) against stretch (-)" in page
    assert "Fitted force (N) against deflection (mm)" in page


def test_a_bound_and_a_prior_that_is_not_met_are_said() -> None:
    found = fitted()
    held = replace(found, loss_N=0.02)
    told = fit_sentence(replace(found, at_bound=("yeoh.c3_c1",), margins={"reached": -0.1}, constrained=held))
    assert "no optimum inside the bounds for c3/c1" in told
    assert "the least loss is 0.02 instead of 0.01 N" in told
    assert "no film that meets the convexity prior was found" in fit_sentence(
        replace(found, margins={"reached": -0.1}, constrained=None)
    )


def test_a_fit_that_found_nothing_says_why(tmp_path: Path) -> None:
    nothing = np.full(9, np.nan)
    lost = replace(
        fitted(), force=nothing, loss_N=np.nan, rmse_N=np.nan, max_N=np.nan, margins={"reached": np.nan},
        constrained=None, status="no film reaches the data.",
    )  # fmt: skip
    page = write_report([lost], tmp_path).read_text()
    assert "Yeoh up to 35 mm: no film reaches the data." in page
    assert "nan" not in page.split("<main>")[1].split("base64")[0]


def test_a_stored_fit_gives_the_same_page(tmp_path: Path) -> None:
    store(tmp_path / "answers" / "fit", "fit", fitted(), {})
    stored, held = (write_report([found], tmp_path / "page").read_text() for found in (tmp_path / "answers", fitted()))
    assert without_pictures(stored) == without_pictures(held)
