"""Curves in this program's layout, written by another hand: every spelling gives the same curve, or a refusal."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bayesmembrane.data.importers.base import Written, import_export, read_export
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.ground.errors import BayesmembraneError, DataError, SettingsError, StorageError

SPECIMEN = "[specimen]\nthickness_um = 50\n[rig]\nkind = 'annulus'\ninner_radius_mm = 10\nouter_radius_mm = 35\n"
ROWS = [("5,5", "30,25"), ("10,0", "200,5"), ("20", "950")]


def imported(folder: Path, content: str | bytes, name: str = "export.csv") -> Written:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return import_export(path, folder / "curve.csv")


def refusal(folder: Path, content: str | bytes) -> str:
    with pytest.raises(DataError) as caught:
        imported(folder, content)
    assert not (folder / "curve.csv").exists()
    assert not (folder / "curve.toml").exists()
    return str(caught.value).replace(f"{folder}/", "")


@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("delimiter", [";", "\t", ","])
@pytest.mark.parametrize(
    "header",
    [
        ("deflection_mm", "force_mN"),
        ("Deflection [mm]", "Force [mN]"),
        ("deflection (mm)", "FORCE (mN)"),
        ("Deflection_[mm]", "Force_mN"),
    ],
)
def test_every_spelling_gives_the_same_curve(
    tmp_path: Path, header: tuple[str, str], delimiter: str, decimal: str
) -> None:
    quote = '"' if delimiter == decimal else ""
    rows = [[quote + cell.replace(",", decimal) + quote for cell in row] for row in ROWS]
    written = imported(tmp_path, "\n".join(delimiter.join(row) for row in [header, *rows]))
    assert written.importer == "csv_toml"
    assert written.n_points == 3
    assert written.curve.read_text() == "deflection_mm,force_N\n5.5,0.03025\n10,0.2005\n20,0.95\n"


def test_the_layout_is_called_its_own_and_no_machine_s(tmp_path: Path) -> None:
    assert imported(tmp_path, "time_s,deflection_mm,force_N\n0,1,0.1\n1,2,0.3\n2,3,0.6\n").importer == "csv_toml"


def test_times_noise_and_other_columns(tmp_path: Path) -> None:
    content = "time_min;deflection_µm;force_N;force_sd_mN;remark\n0;1000;0,1;4;a\n0,5;2000;0,2;4;b\n"
    written = imported(tmp_path, content.encode("cp1252"))
    assert written.curve.read_text() == "time_s,deflection_mm,force_N,force_sd_N\n0,1,0.1,0.004\n30,2,0.2,0.004\n"
    assert written.notes == ("ignored columns: remark",)


def test_what_is_imported_is_read_once_the_specimen_file_is_completed(tmp_path: Path) -> None:
    written = imported(tmp_path, "deflection_mm;force_N\n1,5;0,1\n2,5;0,2\n")
    with pytest.raises(DataError, match=r"the section \[rig\] is missing; add it"):
        read_measurement(written.curve, written.specimen)
    written.specimen.write_text(SPECIMEN + written.specimen.read_text())
    m = read_measurement(written.curve, written.specimen)
    assert np.array_equal(m.deflection, [0.0015, 0.0025])
    assert m.provenance.origin.endswith("export.csv")


def test_the_template_is_complete_without_its_hashes(tmp_path: Path) -> None:
    written = imported(tmp_path, "deflection_mm;force_N\n1,5;0,1\n2,5;0,2\n")
    lines = written.specimen.read_text().splitlines()
    written.specimen.write_text("\n".join(x.removeprefix("# ") for x in lines if not x.startswith("# To be")))
    assert read_measurement(written.curve, written.specimen).specimen.thickness == 5e-5


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "export.csv: the file is empty"),
        (b"\x00PK\x03\x04\x00\x00", "export.csv: no importer knows this layout; these are known: "),
        (b"PK\x03\x04\x00\x00", "export.csv: the workbook cannot be opened"),
        ("Weg;Kraft\n1;2\n", "no two lines with at least two numbers follow each other"),
        ("deflection_mm;Kraft\n1;2\n3;4\n", 'the column "Kraft" names no unit of force; say --units force=N'),
        ("deflection_mm;force_X\n1;2\n3;4\n", 'the column "force_X" names no unit of force'),
        ("deflection_mm;force_N\n1,5;0,1\n2.5;0,2\n", 'line 3: "2.5" has another decimal sign'),
        ("deflection_mm;force_N\n1,5;0,1\n2,5;1.000,2\n", 'line 3, column force_N: "1.000,2" is not a number'),
        ("deflection_mm;force_N\n1,5;0,1\n2,5;\n", "line 3, column force_N: the cell is empty"),
        ("deflection_mm,force_N\n1,5,0,1\n", "as decimal commas would cause; write decimal points, or semicolons"),
        ("deflection_mm;force_N\n1;0,1\n3;0,2\n2;0,3\n", "line 4: the deflection is not in order"),
        ("deflection_mm;force_N\n-1;-0,1\n-3;-0,2\n-4;-1\n", "falls from the first line on"),
    ],
)
def test_what_cannot_be_read_is_refused_with_its_place(tmp_path: Path, content: str | bytes, said: str) -> None:
    assert said in refusal(tmp_path, content)


def test_what_a_specimen_file_says_and_names_is_kept_wherever_it_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known, made = tmp_path / "known", tmp_path / "made"
    for folder in (known, made):
        folder.mkdir()
    curve = "deflection_mm,force_mN\n5,30\n10,200\n20,950\n"
    (known / "export.csv").write_text(curve)
    (known / "frame.csv").write_text("deflection_mm,force_mN\n0,0\n0.01,100\n0.05,500\n0.1,1000\n")
    (known / "covariance.csv").write_text("1e-6,0,0\n0,1e-6,0\n0,0,1e-6\n")
    named = "[measurement]\nblank_run = 'frame.csv'\ncovariance = 'covariance.csv'\n"
    named += "[origin]\nstatement = 'RECONSTRUCTED, not measured'\n"
    (known / "film.toml").write_text(SPECIMEN + named)
    monkeypatch.chdir(known)
    whole = read_measurement(Path("export.csv"), Path("film.toml"))
    written = import_export(Path("export.csv"), made / "curve.csv", specimen=Path("film.toml"))
    monkeypatch.chdir(made)
    for found in (
        read_measurement(written.curve, written.specimen),
        read_export(known / "export.csv", None, known / "film.toml"),
    ):
        np.testing.assert_array_equal(found.blank_run, whole.blank_run)
        np.testing.assert_array_equal(found.covariance, whole.covariance)
        assert found.provenance.origin.endswith(whole.provenance.origin)


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    content = "deflection_mm;force_N\n1;0,1\n3;0,2\n"
    for name in ("curve.csv", "curve.toml"):
        (tmp_path / name).write_text("mine")
        with pytest.raises(StorageError, match="the file exists already"):
            imported(tmp_path, content)
        assert (tmp_path / name).read_text() == "mine"
        (tmp_path / name).unlink()
    assert imported(tmp_path, content).curve.exists()


def test_names_of_the_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("run 3.csv").write_text("deflection_mm;force_N\n1;0,1\n3;0,2\n")
    written = import_export("run 3.csv")
    assert (str(written.curve), str(written.specimen)) == ("run 3_curve.csv", "run 3_curve.toml")
    with pytest.raises(SettingsError, match=r"does not end in \.csv"):
        import_export("run 3.csv", "curve.xlsx")
    with pytest.raises(DataError, match="there is no such file"):
        import_export("run 4.csv")
    with pytest.raises(StorageError):
        import_export("run 3.csv", tmp_path / "run 3.csv" / "below" / "a.csv")


@given(
    st.binary(max_size=200), st.sampled_from([b"", b"deflection_mm;force_N\n1;2\n", b"Force [N]\tDeflection [mm]\n"])
)
@settings(deadline=None, max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_rubbish_is_refused(tmp_path: Path, content: bytes, start: bytes) -> None:
    for name in ("curve.csv", "curve.toml"):
        (tmp_path / name).unlink(missing_ok=True)
    try:
        written = imported(tmp_path, start + content)
    except BayesmembraneError:
        return
    written.specimen.write_text(SPECIMEN)
    assert len(read_measurement(written.curve, written.specimen)) == written.n_points
