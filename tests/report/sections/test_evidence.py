"""What a report says of a comparison, beside the ranking of somebody else."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.comparison.evidence.estimate import BRIDGE, NESTED, together
from bayesmembrane.comparison.evidence.target import EvidenceEstimate
from bayesmembrane.comparison.leave_out.score import LeaveOneOut
from bayesmembrane.comparison.prior_widths import Unknown, Widened
from bayesmembrane.comparison.result import Comparison, Row, ranked
from bayesmembrane.data.published import read_published_table
from bayesmembrane.ground.stored import store
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.report.page import TWIN, write_report
from bayesmembrane.report.runs import Shown, cases, reach
from bayesmembrane.report.sections.evidence import EvidenceSection, sentences
from bayesmembrane.report.sections.evidence.figures import comparison_picture
from bayesmembrane.report.sections.evidence.tables import evidence_table, modes_table, ranking_table, widths_table
from tests.report.pages import without_pictures


def row(material: str, z: float, elpd: float, off: float = 0.0) -> Row:
    points = elpd / 10 + 0.02 * np.sin(np.arange(10) + len(material))
    loo = LeaveOneOut(float(points.sum()), 1.0, 0.01, points, np.zeros(10), (3,))
    pair = {NESTED: EvidenceEstimate(z + off, 0.1, 1, 1.0), BRIDGE: EvidenceEstimate(z, 0.02, 1, 1.0)}
    widths = (
        Widened(f"{material}.ln_gd", 0.5, 0.6, 0.05, 900.0, 0.1, None),
        Widened(f"{material}.ln_gd", 2.0, float("nan"), float("nan"), 3.0, 0.1, Unknown.FEW),
    )
    return Row(
        material, hypothesis(material), together(pair), loo, None, None, None, widths, (), None, 1, 1.0, None, ""
    )


def compared(off: float = 0.0) -> dict[str, Comparison]:
    lost = replace(row("ogden", 0, 0), evidence=None, loo=None, failure="it cannot be fitted")
    return {"OP1": ranked([row("neo_hookean", 4, 20), row("gent", 2.9, 19), row("yeoh", 10, 30, off), lost])}


PAPER = {"OP1": {"yeoh": 0.1, "gent": 0.2, "neo_hookean": 0.23, "ogden": 0.12}}


def test_every_hypothesis_has_a_row_and_the_unfitted_one_its_reason():
    cells = evidence_table(compared()).cells()
    assert [c[1] for c in cells] == ["neo-Hookean", "Gent", "Yeoh", "Ogden"]
    assert cells[3][2] == "-"
    assert cells[3][-1] == "it cannot be fitted"
    assert cells[2][2] == "10.00"


def test_every_difference_to_the_other_ranking_has_its_sentence():
    told = [s for s in sentences(compared(), PAPER) if "the paper has them" in s]
    assert len(told) == 1
    assert "neo-Hookean before Gent by 1.1" in told[0]
    assert "losses of 0.23 and 0.2 N" in told[0]
    assert "1 more parameters of Gent" in told[0]
    same = sentences(compared(), {"OP1": {"yeoh": 0.1, "neo_hookean": 0.2, "gent": 0.3}})
    assert any("same order as the paper" in s for s in same)


def test_rankings_stand_side_by_side():
    shown = ranking_table(compared(), PAPER)
    assert [r["ours"] for r in shown.records()] == ["Yeoh", "neo-Hookean", "Gent", "-"]
    assert next(r["paper"] for r in shown.records()) == "Yeoh (0.1 N)"
    assert ranking_table(compared(), {}) is None


def test_without_agreement_there_is_no_ranking():
    found = compared(off=2.0)
    assert [r["ours"] for r in ranking_table(found, PAPER).records()][:3] == ["no ranking"] * 3
    assert any("There is no ranking" in s for s in sentences(found, PAPER))


def test_changes_that_cannot_be_told_are_dashes():
    cells = widths_table(compared()).cells()
    assert cells[0][3:] == ["+0.60", "0.05", "-", "-"]
    assert modes_table(compared()) is None


@pytest.mark.parametrize("off", [0.0, 2.0])
def test_the_picture_is_drawn_with_and_without_a_ranking(off):
    picture = comparison_picture(compared(off))
    assert picture.data.startswith(b"<?xml")
    assert picture.data == comparison_picture(compared(off)).data


def test_a_comparison_stands_alone_and_beside_the_published_table(tmp_path: Path) -> None:
    alone = json.loads((write_report([compared()["OP1"]], tmp_path / "a").parent / TWIN).read_text())
    assert alone["tables"]["glance"][0]["found"] == "Yeoh first"
    assert any("prefers Yeoh to neo-Hookean" in s for s in alone["answer"])
    beside = json.loads((write_report([compared(), read_published_table()], tmp_path / "b").parent / TWIN).read_text())
    assert "rankings" in beside["tables"]
    assert "rankings" not in alone["tables"]


def test_two_hypotheses_of_one_name_are_told_apart() -> None:
    one = compared()["OP1"]
    rows = [
        replace(one.rows[0], label=f"neo_hookean ({noise}, reached)", hypothesis=hypothesis("neo_hookean", noise=noise))
        for noise in ("white", "ar1")
    ]
    told = [c[1] for c in evidence_table({"OP1": replace(one, rows=tuple(rows))}).cells()]
    assert told == ["neo-Hookean (white, reached)", "neo-Hookean (ar1, reached)"]


def test_a_stored_comparison_gives_the_same_page(tmp_path: Path) -> None:
    store(tmp_path / "answer", "comparison", compared(), {})
    stored, held = (write_report([found], tmp_path / "page").read_text() for found in (tmp_path / "answer", compared()))
    assert without_pictures(stored) == without_pictures(held)


def test_ranges_have_the_names_of_the_rest_of_the_page(yeoh: Shown) -> None:
    """How far the runs were fitted that a comparison rests on; its own name where none of them is there."""
    found = compared()
    first = found["OP1"]
    rested = replace(first, rows=tuple(replace(r, run=Path(yeoh.folder)) for r in first.rows))
    names = [g.about.partition("hypotheses ")[2] for g in EvidenceSection().glances([{**found, "OP1": rested}, yeoh])]
    assert names == [f"up to {yeoh.end}", *(f"on {n}" for n in list(found)[1:])]


def test_specimens_of_one_material_are_told_apart(yeoh: Shown) -> None:
    other = replace(yeoh, data_hash="another", film=replace(yeoh.film, name="strip 2"))
    both = [yeoh, other]
    assert [reach(s, both) for s in both] == [f"{yeoh.end} ({s.film.name})" for s in both]
    assert [c.name for c in cases(both)] == [f"{s.name} on {s.film.name}" for s in both]
    assert [c.name for c in cases([yeoh])] == [yeoh.name]
