"""The exports of real machines, as they are; they are not part of this repository."""

import shutil
from pathlib import Path

import numpy as np
import pytest

import bayesmembrane as bm
from bayesmembrane.data.exports.hints import Hints
from bayesmembrane.data.importers.base import Written, import_export
from bayesmembrane.data.reading import read_measurement

EXPORTS = next((p / "shared/data/exports" for p in (Path(__file__).resolve().parents[4], Path("/work"))
                if (p / "shared/data/exports").is_dir()), Path("absent"))  # fmt: skip
pytestmark = pytest.mark.skipif(not EXPORTS.is_dir(), reason="the exports of real machines are not here")


def imported(tmp_path: Path, name: str, **said: object) -> Written:
    return import_export(EXPORTS / name, tmp_path / "curve.csv", Hints(**said))  # type: ignore[arg-type]


def test_a_german_film(tmp_path: Path) -> None:
    """Its strain is the travel over 80 mm, and its preamble states 832.756 mm between the grips: that is said."""
    written = imported(tmp_path, "zwick_DE_latin1_tab_film.csv")
    m = read_measurement(written.curve, written.specimen)
    assert (written.importer, written.n_points, written.complete) == ("zwick", 18876, True)
    assert m.rig.lengths == pytest.approx({"length": 0.08, "width": 0.0114})
    assert m.specimen.thickness == pytest.approx(2e-4)
    assert m.deflection[-1] == pytest.approx(0.247389, rel=1e-4)
    assert m.force[-1] == pytest.approx(51.4614)
    assert m.time is not None
    assert m.time[-1] == 386.35
    said = " ".join(written.contradictions)
    assert "80 mm" in said
    assert "832.756 mm" in said
    assert "150 mm/min" in said
    assert all(c in " ".join(m.provenance.notes) for c in written.contradictions)


@pytest.mark.parametrize(
    ("name", "length", "first", "last"),
    [("zwick_Allong_1.TRA", 0.025, 146.366, -44.3443), ("zwick_Invar_LT_05_01.TRA", 0.03, 103.053, 302.441)],
)
def test_strips_with_all_their_sizes(tmp_path: Path, name: str, length: float, first: float, last: float) -> None:
    written = imported(tmp_path, name)
    m = read_measurement(written.curve, written.specimen)
    assert written.complete
    assert m.rig.lengths["length"] == pytest.approx(length)
    assert m.force[[0, -1]] == pytest.approx([first, last])


def test_a_workbook_whose_sizes_stand_in_its_results(tmp_path: Path) -> None:
    name = "zwick_testXpert_EN_multisheet.xlsx"
    free = imported(tmp_path, name)
    assert not free.complete
    assert "--gauge-length-mm" in str(free.guesses)
    written = import_export(EXPORTS / name, tmp_path / "strip.csv", Hints(rig="uniaxial", gauge_length=0.03))
    m = read_measurement(written.curve, written.specimen)
    assert m.rig.lengths == pytest.approx({"length": 0.03, "width": 0.006})
    assert m.specimen.thickness == pytest.approx(0.00146)
    assert np.max(m.force) == pytest.approx(9645.828125, rel=1e-6)  # as its sheet of results says


def test_a_block_under_compression(tmp_path: Path) -> None:
    written = imported(tmp_path, "mts793_DE_tab_decimalcomma.csv")
    rows = np.loadtxt(written.curve, delimiter=",", skiprows=1)
    assert (written.importer, written.n_points, written.complete) == ("mts", 931, False)
    assert rows[0, 2] == pytest.approx(1233.2071)  # kN with a decimal comma, recorded negative
    guessed = {g.what: g for g in written.guesses}
    assert "force turned round" in guessed["sign"].value
    assert guessed["decimal sign"].why == "the first line says so"
    assert guessed["column of force"].value == '"Ch 1 Kraft" in kN'  # and not the set point


@pytest.mark.parametrize("name", sorted(p.name for p in EXPORTS.glob("*")) if EXPORTS.is_dir() else [])
def test_a_copy_under_another_name_gives_the_same(tmp_path: Path, name: str) -> None:
    """The content is recognised, not the name of the file."""
    shutil.copy(EXPORTS / name, tmp_path / "x.dat")
    again = import_export(tmp_path / "x.dat", tmp_path / "again.csv")
    assert again.curve.read_bytes() == imported(tmp_path, name).curve.read_bytes()


def test_the_door_reads_it_the_same(tmp_path: Path) -> None:
    written = imported(tmp_path, "zwick_Allong_1.TRA")
    m = bm.read_measurement(EXPORTS / "zwick_Allong_1.TRA")
    assert m.data_hash == read_measurement(written.curve, written.specimen).data_hash
    assert "column of force" in " ".join(m.provenance.notes)
    with pytest.raises(bm.SettingsError, match="does not say all of film and rig"):
        bm.read_measurement(EXPORTS / "mts793_DE_tab_decimalcomma.csv")
    with pytest.raises(bm.SettingsError, match='no option of import called "thickness_mum"'):
        bm.read_measurement(EXPORTS / "zwick_Allong_1.TRA", thickness_mum=3)
    lifted = bm.read_measurement(EXPORTS / "zwick_Allong_1.TRA", rig="annulus", inner_radius_mm=10, outer_radius_mm=35)
    assert lifted.rig.name == "annulus"
