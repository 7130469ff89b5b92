"""Valleys on a page: pictures, tables and sentences agree with the values they are made of."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.registry import material
from bayesmembrane.ground.stored import store
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from bayesmembrane.report.blocks import Table
from bayesmembrane.report.page import write_report
from bayesmembrane.report.runs import Shown
from bayesmembrane.report.sections.valleys import ValleysSection, write_valleys
from bayesmembrane.report.sections.valleys.figures import valley_picture
from bayesmembrane.report.sections.valleys.tables import TESTS, next_table, valley_table
from bayesmembrane.valleys.follow import valleys
from bayesmembrane.valleys.result import Valleys
from bayesmembrane.words.valleys import sentences
from tests.reference.slow_solver import force_curve
from tests.report.pages import without_pictures


def curve(name: str, parameters: tuple[float, ...]) -> Measurement:
    at = np.linspace(0.004, 0.03, 8)
    force = force_curve(material(name)(*parameters), at, 0.010, 0.035)
    return Measurement(at, force, Annulus(0.010, 0.035), Specimen("synthetic", 5e-5))


@pytest.fixture(scope="module")
def one() -> Valleys:
    return valleys(curve("gent", (7.0, 30.0)), hypothesis("neo_hookean"), [0.02, 0.03])


@pytest.fixture(scope="module")
def two() -> Valleys:
    return valleys(curve("mooney_rivlin", (6.0, 1.5)), hypothesis("gent"), [0.03])


def test_pictures_are_drawn_and_are_not_empty(one: Valleys, two: Valleys) -> None:
    for found in (one, two):
        picture = valley_picture(found)
        assert picture.kind == "png"
        pixels = imread(io.BytesIO(picture.data))
        assert pixels.shape[1] == pytest.approx(9 * 120, abs=2)
        assert np.mean(pixels[:, :, :3] < 0.9) > 0.02


def test_table_has_a_row_per_range_and_says_where_a_valley_is_open(one: Valleys, two: Valleys) -> None:
    table = valley_table([one, two])
    records = table.records()
    assert [r["end_mm"] for r in records] == pytest.approx([1e3 * v.end for f in (one, two) for v in f.ranges])
    assert records[0]["open"] == "no"
    assert "neo-Hookean" in str(records[2]["open"])
    assert len(table.cells()[0]) == len(table.columns)


@pytest.mark.usefixtures("blank_pictures")
def test_valleys_of_a_film_and_of_a_strip_are_in_two_tables(two: Valleys) -> None:
    strip = replace(two, ranges=tuple(replace(v, rig=Uniaxial(), thickness=1e-3) for v in two.ranges))
    film, pulled = (b for b in ValleysSection().blocks([two, strip]) if isinstance(b, Table) and b.name == "valleys")
    (one,), (other,) = film.records(), pulled.records()
    assert one["loss_N"] == pytest.approx(two.ranges[0].best_loss)
    assert other["loss_MPa"] == pytest.approx(0.1 * two.ranges[0].best_loss)  # 10 mm by 1 mm
    assert (one["end_mm"], other["end"]) == pytest.approx((30.0, 1.6))


def test_next_measurements_are_a_short_list_ordered_by_what_they_are_worth(two: Valleys) -> None:
    rows = next_table(two.ranges[0]).records()
    worth = [float(r["reduction"] or 0) for r in rows]
    assert 0 < len(rows) <= TESTS
    assert worth == sorted(worth, reverse=True)


@pytest.mark.usefixtures("blank_pictures")
def test_page_shows_the_valleys(one: Valleys, yeoh: Shown, tmp_path: Path) -> None:
    page = write_report([yeoh, one], tmp_path).read_text()
    assert 'id="valleys"' in page
    for sentence in sentences(one):
        assert sentence.split(" (")[0].replace("'", "&#39;") in page
    assert 'id="valleys"' not in write_report([yeoh], tmp_path).read_text()


@pytest.mark.usefixtures("blank_pictures")
def test_valleys_stand_alone(one: Valleys, two: Valleys, tmp_path: Path) -> None:
    page = write_report([one, two], tmp_path).read_text()
    twin = json.loads((tmp_path / "report.json").read_text())
    assert [row["about"] for row in twin["tables"]["glance"]][-1] == "Gent, up to 30 mm"
    assert twin["answer"] == [sentences(f)[0] for f in (one, two)]
    assert 'id="data"' not in page


def test_answer_and_picture_are_written_and_read_back(one: Valleys, tmp_path: Path) -> None:
    answer, picture = write_valleys(one, tmp_path / "new")
    assert json.loads(answer.read_text())["ranges"][0]["loss_N"] == pytest.approx(one.ranges[0].best_loss)
    assert picture.read_bytes().startswith(b"\x89PNG")
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match="cannot be written"):
        write_valleys(one, tmp_path / "file")


@pytest.mark.usefixtures("blank_pictures")
def test_stored_valleys_give_the_same_page(two: Valleys, tmp_path: Path) -> None:
    store(tmp_path / "answer", "valleys", two, {})
    stored, held = (write_report([found], tmp_path / "page").read_text() for found in (tmp_path / "answer", two))
    assert without_pictures(stored) == without_pictures(held)
