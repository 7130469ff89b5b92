"""A fit alone on a page."""

import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from bayesmembrane.calibration.fit import Fit, FittedParameter
from bayesmembrane.ground.stored import store
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from bayesmembrane.report.page import TWIN, write_report
from bayesmembrane.report.sections.fits import curves_of, curves_picture, on_page
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


@pytest.mark.filterwarnings("error")
def test_any_number_of_fits_of_one_energy_can_be_told_apart(tmp_path: Path) -> None:
    names = [f"film-a_yeoh_35mm_fit_{i:02d}" for i in range(23)]
    for name in names:
        store(tmp_path / "chains" / name, "fit", fitted(), {})
    write_report([tmp_path / "chains"], tmp_path)
    twin = json.loads((tmp_path / TWIN).read_text())
    assert [row["which"] for row in twin["tables"]["optima"]] == names
    assert [row["about"] for row in twin["tables"]["glance"]] == [f"Yeoh, {name}, up to 35 mm" for name in names]
    assert all(said.startswith(f"{name}: Yeoh fitted") for name, said in zip(names, twin["answer"], strict=True))


def test_a_legend_has_ten_lines_that_look_apart_and_says_how_many_more_there_are() -> None:
    other = replace(fitted(), hypothesis=hypothesis("gent"))
    shown = curves_of(on_page([*[fitted()] * 30, other]))
    told, more = [c for c in shown if c.look is not None], [c for c in shown if c.look is None]
    assert len(told) == 10
    assert len({c.look for c in told}) == len({c.label for c in told}) == 10
    assert "Gent (rms 3.00 mN)" in [c.label for c in told]  # an energy of its own comes before a tenth of the same
    assert [c.label for c in more if c.label] == ["21 more, which the table lists"]


def test_fits_that_were_asked_otherwise_are_told_apart_by_that() -> None:
    one, free = fitted(), replace(fitted(), hypothesis=hypothesis("yeoh", convexity="none"))
    assert [f.name for f in on_page([one, free])] == ["Yeoh, white, reached", "Yeoh, white, none"]
    assert [f.name for f in on_page([one, fitted()])] == ["Yeoh, fit 1", "Yeoh, fit 2"]


def test_a_panel_of_many_fits_is_as_high_as_one_of_few() -> None:
    def axes_height(fits: list[Fit]) -> float:
        pixels = imread(io.BytesIO(curves_picture(on_page(fits), "png").data))[:, :, :3]
        dark = np.mean(pixels.sum(axis=2) < 1.5, axis=0)  # of each column: the axis is the darkest
        return float(np.max(dark)) * len(pixels)

    few, many = axes_height([fitted()]), axes_height([fitted() for _ in range(30)])
    assert many > 0.8 * few


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
