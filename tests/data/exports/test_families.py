"""What is particular of a family: several specimens in a workbook, two axes, results before readings."""

import io
from pathlib import Path

import numpy as np
import openpyxl
import pytest

from bayesmembrane.data.exports.hints import Hints
from bayesmembrane.data.importers.base import import_export
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.ground.errors import DataError, SettingsError
from tests.data.exports.test_layouts import FORCE, TIME, TRAVEL, imported, lines

MM = 1e3 * TRAVEL


def workbook() -> bytes:
    """Two specimens, each on its own sheet, and their sizes in a table of results."""
    book = openpyxl.Workbook()
    results = book.active
    assert results is not None
    results.title = "Results"
    for row in [
        ["Specimen", "a0", "b0", "L0"],
        [None, "mm", "mm", "mm"],
        ["film 1", 0.5, 10, 50],
        ["film 2", 0.6, 12, 50],
    ]:
        results.append(row)
    for k in (1, 2):
        sheet = book.create_sheet(f"Values film {k}")
        for row in [[f"film {k}"] * 3, ["Time", "Standard force", "Standard travel"], ["s", "N", "mm"]]:
            sheet.append(row)
        for t, f, x in zip(TIME, k * FORCE, MM, strict=True):
            sheet.append([float(t), float(f), float(x)])
    out = io.BytesIO()
    book.save(out)
    return out.getvalue()


def test_each_specimen_of_a_workbook_has_its_own_sizes() -> None:
    data = workbook()
    with pytest.raises(DataError, match=r"2 sets of readings \(1: film 1, 2: film 2\); say which, --part 1"):
        imported(data)
    for k, thickness, width in ((1, 5e-4, 0.01), (2, 6e-4, 0.012)):
        found = imported(data, part=f"film {k}")
        assert (found.film.thickness, found.film.width, found.film.length) == pytest.approx((thickness, width, 0.05))
        assert found.columns["nominal_stress"] == pytest.approx(k * FORCE / (thickness * width))
        assert found.columns["stretch"] == pytest.approx(1 + TRAVEL / 0.05)
        assert np.array_equal(imported(data, sheet=f"Values film {k}").columns["stretch"], found.columns["stretch"])


def texts(form: str, *columns: np.ndarray) -> bytes:
    """Readings whose columns are text with decimal commas, behind one of numbers."""
    book = openpyxl.Workbook()
    sheet = book.active
    assert sheet is not None
    for row in [["Datum", "20.02.2008", 1.0], ["Zeit", "Weg", "Kraft"], ["s", "mm", "mN"]]:
        sheet.append(row)
    for row in zip(TIME, *columns, strict=True):
        sheet.append([float(row[0]), *((form % v).replace(".", ",") for v in row[1:])])
    out = io.BytesIO()
    book.save(out)
    return out.getvalue()


@pytest.mark.parametrize("said", [{"decimal": "comma"}, {}])
def test_numbers_that_a_workbook_holds_as_text_have_their_decimal_sign(said: dict[str, str]) -> None:
    found = imported(texts("%.5f", MM, 1e3 * FORCE), **said)
    assert found.columns["deflection"] == pytest.approx(TRAVEL, abs=1e-8)
    assert found.columns["force"] == pytest.approx(FORCE, abs=1e-8)
    assert [g.value for g in found.guesses if g.what == "decimal sign"] == ["comma"]
    assert not [g for g in imported(workbook(), part="1").guesses if g.what == "decimal sign"]


def test_text_of_a_workbook_that_may_have_thousands_is_refused_until_it_is_said() -> None:
    data = texts("%.3f", MM + 1, 1e3 * FORCE + 1)
    with pytest.raises(DataError, match=r"may have decimals or thousands.*say --decimal point or --decimal comma"):
        imported(data)
    assert imported(data, decimal="comma", zero="none").columns["force"] == pytest.approx(FORCE + 1e-3, abs=1e-6)


def named_sheets() -> bytes:
    """Two specimens whose sheets bear the names of the results, and other names above their readings."""
    book = openpyxl.Workbook()
    results = book.active
    assert results is not None
    rows = [["Specimen", "h (mm)", "b0 (mm)", "L0 (mm)", "Fmax (N)"], ["S1", 0.5, 10, 50, 1], ["S2", 0.6, 12, 40, 2]]
    for row in rows:
        results.append(row)
    for k in (1, 2):
        sheet = book.create_sheet(f"S{k}")
        for row in [[f"Silicone strip {k}"], ["Test time", "Standard travel", "Standard force"], ["s", "mm", "N"]]:
            sheet.append(row)
        for t, x, f in zip(TIME, MM, k * FORCE, strict=True):
            sheet.append([float(t), float(x), float(f)])
    out = io.BytesIO()
    book.save(out)
    return out.getvalue()


def test_a_part_is_chosen_by_the_name_of_its_sheet_and_has_the_sizes_of_that_name() -> None:
    data = named_sheets()
    for part, times, sizes in (("S1", 1, (5e-4, 0.01, 0.05)), ("S2", 2, (6e-4, 0.012, 0.04))):
        found = imported(data, part=part)
        assert (found.film.thickness, found.film.width, found.film.length) == pytest.approx(sizes)
        assert found.columns["nominal_stress"] == pytest.approx(times * FORCE / (sizes[0] * sizes[1]))
    by_label = imported(data, part="Silicone strip 2")
    assert np.array_equal(by_label.columns["stretch"], imported(data, part="2").columns["stretch"])
    with pytest.raises(DataError, match=r'there is no part "S3" \(1: Silicone strip 1, 2: Silicone strip 2\)'):
        imported(data, part="S3")


def test_the_name_of_a_sheet_with_several_parts_chooses_none() -> None:
    book = openpyxl.Workbook()
    sheet = book.active
    assert sheet is not None
    sheet.title = "Daten"
    for row in [["A", None, "B", None], ["Weg (mm)", "Kraft (N)"] * 2]:
        sheet.append(row)
    for x, f in zip(MM, FORCE, strict=True):
        sheet.append([float(x), float(f), float(x), 2 * float(f)])
    out = io.BytesIO()
    book.save(out)
    with pytest.raises(DataError, match='there is no part "Daten"'):
        imported(out.getvalue(), part="Daten")


@pytest.mark.parametrize(
    "header", ["SetName,Time_S,Displacement_um,Force_mN,FileName", "SetName,Time_S,Displacement_um,Force_mN"]
)
def test_columns_of_text_are_told_on_both_sides_of_the_numbers(header: str) -> None:
    rows = lines((), TIME, 1e3 * MM, 1e3 * FORCE).strip().split("\n")
    after = ",a.jpg" if header.endswith("FileName") else ""
    found = imported("\n".join([header, *(f"Set1,{row}{after}" for row in rows), ""]).encode())
    told = "ignored columns: SetName, FileName" if after else "ignored columns: SetName"
    assert told in found.notes


def test_two_axes_become_a_biaxial_test(tmp_path: Path) -> None:
    header = "SetName,Cycle,Time_S,XSize_um,YSize_um,XDisplacement_um,YDisplacement_um,XForce_mN,YForce_mN"
    size = 0 * TIME + 5000.0
    text = lines(header, TIME, TIME, TIME, size, 2 * size, 50 * TIME, 80 * TIME, 1e3 * FORCE, 2e3 * FORCE)
    (tmp_path / "e.csv").write_text(text)
    with pytest.raises(DataError, match="say --thickness-um"):
        import_export(tmp_path / "e.csv", tmp_path / "c.csv")
    written = import_export(tmp_path / "e.csv", tmp_path / "c.csv", Hints(thickness=5e-4))
    assert written.complete
    rows = np.loadtxt(written.curve, delimiter=",", skiprows=1)
    assert rows[:, 0] == pytest.approx(1 + 50 * TIME / 5000)
    assert rows[:, 1] == pytest.approx(1 + 80 * TIME / 10000)
    assert 1e6 * rows[:, 2] == pytest.approx(FORCE / (0.01 * 5e-4), abs=1e-2)
    assert 1e6 * rows[:, 3] == pytest.approx(2 * FORCE / (0.005 * 5e-4), abs=1e-2)
    assert len(read_measurement(written.curve, written.specimen)) == 2 * TIME.size
    with pytest.raises(SettingsError, match="the file has two axes"):
        import_export(tmp_path / "e.csv", tmp_path / "d.csv", Hints(rig="uniaxial"))


def test_pages_under_the_same_header_are_one_table() -> None:
    text = lines("Time (s),Extension (mm),Load (N)", TIME, MM, FORCE)
    rows = text.strip().split("\n")
    paged = "\n".join([*rows[:14], "", rows[0], *rows[14:], ""])
    assert np.array_equal(imported(paged.encode()).columns["force"], imported(text.encode()).columns["force"])


def test_a_specimen_file_says_film_and_rig(tmp_path: Path) -> None:
    (tmp_path / "e.csv").write_text(lines("Extension (mm),Load (N)", MM, FORCE))
    film = "[specimen]\nname = 'A'\nthickness_um = 500\n[rig]\nkind = 'planar'\nlength_mm = 50\nwidth_mm = 10\n"
    (tmp_path / "f.toml").write_text(film + "[measurement]\nforce_sd_N = 0.01\n")
    written = import_export(tmp_path / "e.csv", tmp_path / "c.csv", specimen=tmp_path / "f.toml")
    m = read_measurement(written.curve, written.specimen)
    assert (m.rig.name, m.specimen.name) == ("planar", "A")
    assert m.force == pytest.approx(FORCE, abs=1e-6)
    assert m.force_sd == pytest.approx(0.01)


def test_names_over_several_lines() -> None:
    text = lines('"Time\n(s)","Extension\n(mm)","Load\n(N)"', TIME, MM, FORCE)
    assert imported(text.encode()).columns["deflection"] == pytest.approx(TRAVEL, abs=1e-9)


def test_strain_and_stress_need_no_sizes() -> None:
    header = "Tiempo (s);Alargamiento (mm);Carga (daN);Deformación (%);Esfuerzo (kgf/cm2)"
    stretch, stress = 1 + TRAVEL / 0.05, FORCE / 5e-6
    text = lines(header, TIME, MM, FORCE / 10, 100 * (stretch - 1), stress / 98066.5, sep=";", decimal=",", form="%.9f")
    found = imported(text.encode())
    assert found.columns["stretch"] == pytest.approx(stretch)
    assert found.columns["nominal_stress"] == pytest.approx(stress, rel=1e-6, abs=1e-2)
    assert found.film.length == pytest.approx(0.05, rel=1e-4)


def test_the_time_of_the_test_and_not_of_its_cycle() -> None:
    cycles = '"Total Time (s)","Cycle Elapsed Time (s)","Total Cycles","Elapsed Cycles"'
    header = cycles + ',"Position(8800 (0,1):Position) (mm)","Load (kN)"'
    text = lines(header, TIME, TIME % 3, TIME // 3, 0 * TIME, MM, FORCE / 1e3, form="%.9f")
    found = imported(text.encode())
    assert found.columns["time"] == pytest.approx(TIME)
    assert found.columns["cycle"] == pytest.approx(1 + TIME // 3)
    assert found.columns["force"] == pytest.approx(FORCE, abs=1e-5)
