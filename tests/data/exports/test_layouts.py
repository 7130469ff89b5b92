"""One film, written as many machines would: every spelling gives the same curve in SI."""

import itertools

import numpy as np
import pytest

from bayesmembrane.data.exports.hints import Hints
from bayesmembrane.data.importers.base import Imported, recognising

N = 25
TIME = np.arange(N) * 0.5  # s
TRAVEL = 0.02 * np.linspace(0, 1, N) ** 1.1  # m
FORCE = 0.5 * np.linspace(0, 1, N) ** 0.7 + 0.01 * np.linspace(0, 1, N)  # N
LENGTH, WIDTH, THICKNESS = 0.05, 0.01, 0.0005  # m
STRETCH = 1 + TRAVEL / LENGTH
STRESS = FORCE / (WIDTH * THICKNESS)


def imported(data: bytes, **said: object) -> Imported:
    importer = recognising(data)
    assert importer is not None
    return importer.read_with(data, "export", Hints(**said))  # type: ignore[arg-type]


def lines(
    header: str | tuple[str, ...],
    *columns: np.ndarray,
    sep: str = ",",
    decimal: str = ".",
    form: str = "%.7f",
    quote: bool = False,
    end: str = "\n",
    before: str = "",
) -> str:
    mark = '"' if quote else ""
    heads = (header,) if isinstance(header, str) else header
    rows = [sep.join(mark + (form % v).replace(".", decimal) + mark for v in row) for row in zip(*columns, strict=True)]
    return (before + "\n".join([*heads, *rows]) + "\n").replace("\n", end)


def same_force(found: Imported, times: bool = True) -> None:
    assert found.columns["deflection"] == pytest.approx(TRAVEL, abs=2e-8)
    assert found.columns["force"] == pytest.approx(FORCE, abs=2e-7 * 1e3)
    assert ("time" in found.columns) == times
    if times:
        assert found.columns["time"] == pytest.approx(TIME, abs=1e-5)


def same_stretch(found: Imported) -> None:
    assert found.columns["stretch"] == pytest.approx(STRETCH, abs=1e-5)
    assert found.columns["nominal_stress"] == pytest.approx(STRESS, rel=1e-4, abs=20)


@pytest.mark.parametrize(
    ("sep", "decimal"), [(",", "."), (";", "."), ("\t", "."), (";", ","), ("\t", ","), ("  ", ".")]
)
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("order", list(itertools.permutations(range(3)))[::2])
def test_delimiters_decimals_line_ends_and_orders(sep: str, decimal: str, end: str, order: tuple[int, ...]) -> None:
    names, columns = ("Time_s", "Extension_mm", "Load_N"), (TIME, 1e3 * TRAVEL, FORCE)
    text = lines(sep.join(names[i] for i in order), *(columns[i] for i in order), sep=sep, decimal=decimal, end=end)
    same_force(imported(text.encode()))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le"])
def test_unicode(encoding: str) -> None:
    text = lines("Prüfzeit [s];Verlängerung [mm];Kraft [N]", TIME, 1e3 * TRAVEL, FORCE, sep=";")
    same_force(imported(text.encode(encoding)))


@pytest.mark.parametrize(
    ("encoding", "header"),
    [
        ("cp1252", "Prüfzeit (s)\tVerlängerung (mm)\tKraft (N)"),
        ("latin-1", "Temps (s)\tDéplacement (mm)\tForce (N)"),
        ("latin-1", "Tiempo (s)\tElongación (mm)\tFuerza (N)"),
        ("cp1250", "Czas (s)\tWydłużenie (mm)\tSiła (N)"),
        ("cp1250", "Czas [s]\tPrzemieszczenie [mm]\tObciążenie [N]"),
        ("gbk", "时间(s)\t位移(mm)\t力(N)"),
        ("gbk", "时间（s）\t变形（mm）\t试验力（N）"),
        ("gb18030", "时间/s\t位移/mm\t载荷/N"),
        ("cp1252", "Zeit (s)\tWeg (mm)\tKraft (N)"),
        ("utf-8", "Tiempo (s)\tDesplazamiento (mm)\tCarga (N)"),
        ("utf-8", "Temps, s\tAllongement, mm\tCharge, N"),
        ("utf-8", "Time (sec)\tCrosshead (mm)\tLoad (N)"),
        ("utf-8", "Time / s\tStroke / mm\tForce / N"),
        ("utf-8", "t [s]\ts [mm]\tF [N]"),
        ("utf-8", "Zeit in s\tTraversenweg in mm\tStandardkraft in N"),
    ],
)
def test_languages(encoding: str, header: str) -> None:
    found = imported(lines(header, TIME, 1e3 * TRAVEL, FORCE, sep="\t").encode(encoding))
    same_force(found)


@pytest.mark.parametrize(
    ("encoding", "header"),
    [
        ("cp1252", "Time (s)\tExtension (µm)\tLoad (N)"),
        ("cp1252", "Zeit [s]\tWeg [µm]\tKraft [N]"),
        ("cp1252", "Time\tExtension\tLoad\ns\tµm\tN"),
        ("cp1252", "Time_s\tExtension_µm\tLoad_N"),
        ("cp1252", "23 °C\nTime (s)\tExtension (µm)\tLoad (N)"),
        ("cp1250", "Czas [s]\tPrzemieszczenie [µm]\tSiła [N]"),
        ("gbk", "时间(s)\t位移(μm)\t力(N)"),
        ("gbk", "时间\t位移\t力\ns\tμm\tN"),
    ],
)
def test_signs_of_units_tell_the_encoding(encoding: str, header: str) -> None:
    same_force(imported(lines(header, TIME, 1e6 * TRAVEL, FORCE, sep="\t").encode(encoding)))


@pytest.mark.parametrize(
    ("encoding", "column"),
    [("cp1252", "Temp (°C)"), ("cp1252", "Temp [°F]"), ("cp1252", "Winkel [°]"), ("gbk", "温度(℃)"), ("gbk", "力 2")],
)
def test_a_column_beside_tells_the_encoding(encoding: str, column: str) -> None:
    header = f"Time (s)\tExtension (mm)\tLoad (N)\t{column}"
    found = imported(lines(header, TIME, 1e3 * TRAVEL, FORCE, TIME, sep="\t").encode(encoding), units="力 2=%")
    same_force(found)
    assert f"ignored columns: {column}" in found.notes


@pytest.mark.parametrize(
    ("unit", "per_newton"),
    [
        ("N", 1.0),
        ("kN", 1e-3),
        ("mN", 1e3),
        ("kgf", 1 / 9.80665),
        ("gf", 1e3 / 9.80665),
        ("lbf", 1 / 4.4482216152605),
        ("lb", 1 / 4.4482216152605),
        ("KN", 1e-3),
        ("kg", 1 / 9.80665),
    ],
)
@pytest.mark.parametrize(
    ("length", "per_metre"), [("mm", 1e3), ("cm", 1e2), ("m", 1.0), ("in", 1 / 0.0254), ("µm", 1e6)]
)
def test_units_in_a_second_row(unit: str, per_newton: float, length: str, per_metre: float) -> None:
    heads = ("Time,Displacement,Force", f"min,{length},{unit}")
    text = lines(heads, TIME / 60, per_metre * TRAVEL, per_newton * FORCE, form="%.12g")
    same_force(imported(text.encode()))


@pytest.mark.parametrize(
    ("unit", "pascal"),
    [("MPa", 1e6), ("kPa", 1e3), ("psi", 6894.757293168), ("kgf/cm2", 98066.5), ("N/mm²", 1e6), ("Pa", 1.0)],
)
@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("Strain (%)", 100 * (STRETCH - 1)),
        ("Dehnung [mm/mm]", STRETCH - 1),
        ("Stretch", STRETCH),
        ("应变(%)", 100 * (STRETCH - 1)),
        ("Odkształcenie [%]", 100 * (STRETCH - 1)),
    ],
)
def test_strain_and_stress(name: str, values: np.ndarray, unit: str, pascal: float) -> None:
    text = lines(f"{name};Nominal stress ({unit})", values, STRESS / pascal, sep=";", form="%.12g")
    same_stretch(imported(text.encode()))


@pytest.mark.parametrize(
    "header", ["Wahre Spannung [MPa]", "True Stress (MPa)", "Contrainte vraie (MPa)", "真实应力(MPa)"]
)
def test_true_stress_is_divided_by_the_stretch(header: str) -> None:
    text = lines(f"Strain (%);{header}", 100 * (STRETCH - 1), 1e-6 * STRESS * STRETCH, sep=";", form="%.12g")
    found = imported(text.encode())
    same_stretch(found)
    assert "true" in str([g for g in found.guesses if g.what == "nominal stress"])


def test_true_strain_is_told_by_the_travel() -> None:
    text = lines(
        "Extension (mm),Strain (%),Stress (MPa)", 1e3 * TRAVEL, 100 * np.log(STRETCH), 1e-6 * STRESS, form="%.9g"
    )
    found = imported(text.encode())
    same_stretch(found)
    assert any(g.what == "strain" and "is true" in g.value for g in found.guesses)


def test_a_stress_that_grows_with_the_stretch_is_true() -> None:
    columns = (100 * (STRETCH - 1), FORCE, 1e-6 * STRESS * STRETCH)
    found = imported(lines("Strain (%),Force (N),Stress (MPa)", *columns, form="%.9g").encode())
    same_stretch(found)
    assert any(g.what == "stress" and "is true" in g.value for g in found.guesses)


def test_a_date_has_no_decimal_sign() -> None:
    text = lines("Time (s);Extension (mm);Load (N);Datum", TIME, 1e3 * TRAVEL, FORCE, sep=";")
    same_force(imported(text.replace("\n", ";20.02.2008\n").replace("Datum;20.02.2008", "Datum").encode()))


def test_thousands_in_quotes() -> None:
    force = [f'"{v:,.5f}"' for v in 5e4 * FORCE]
    rows = "".join(f'"{t:.3f}","{1e3 * x:.5f}",{f}\n' for t, x, f in zip(TIME, TRAVEL, force, strict=True))
    found = imported(('"Time (s)","Extension (mm)","Load (mN)"\n' + rows).encode())
    assert found.columns["force"] == pytest.approx(50 * FORCE, abs=1e-4)


def test_thousands_with_points() -> None:
    force = [f"{v:,.2f}".translate(str.maketrans(",.", ".,")) for v in 5e4 * FORCE]
    rows = "".join(f"{1e3 * x:.5f};".replace(".", ",") + f"{f}\n" for x, f in zip(TRAVEL, force, strict=True))
    found = imported(("Weg [mm];Kraft [mN]\n" + rows).encode())
    assert found.columns["force"] == pytest.approx(50 * FORCE, abs=1e-4)


PREAMBLES = {
    "english": "Specimen name:,film 3\nGauge length (mm),50\nWidth,10,mm\nThickness,0.5 mm\nTest speed,100,mm/min\n\n",
    "german": "Probenbezeichnung;film 3\nMesslänge;50;mm\nProbenbreite b0;10;mm\nProbendicke a0;0,5;mm\n",
    "french": "Éprouvette;film 3\nLongueur initiale;50;mm\nLargeur;10;mm\nÉpaisseur;0,5;mm\n",
    "spanish": "Muestra;film 3\nLongitud calibrada;50;mm\nAnchura;10;mm\nEspesor;0,5;mm\n",
    "polish": "Próbka;film 3\nDługość pomiarowa;50;mm\nSzerokość;10;mm\nGrubość;0,5;mm\n",
    "chinese": "试样;film 3\n标距;50;mm\n宽度;10;mm\n厚度;0.5;mm\n",
    "units in brackets, then a colon": "Próbka:;film 3\nDługość pomiarowa [mm]:;50\nSzerokość [mm]:;10\n"
    "Grubość [mm]:;0,5\nPrędkość [mm/min]:;100\n",
    "area": "Sample;film 3\nL0;50;mm\nThickness;0,5;mm\nCross-section;5;mm²\n",
    "inches": "Specimen;film 3\nGauge length;1,968503937007874;in\nWidth;0,3937007874015748;in\nThickness;500;µm\n",
}


@pytest.mark.parametrize("language", PREAMBLES)
def test_a_strip_by_its_preamble(language: str) -> None:
    comma = language == "english"
    head = "Time (s),Extension (mm),Load (N)" if comma else "Time (s);Extension (mm);Load (N)"
    sep, decimal = (",", ".") if comma else (";", ",")
    text = lines(head, TIME, 1e3 * TRAVEL, FORCE, sep=sep, decimal=decimal, before=PREAMBLES[language])
    found = imported(text.encode())
    same_stretch(found)
    assert found.rig == "uniaxial"
    assert found.film.name == "film 3"
    sizes = (found.film.length, found.film.width, found.film.thickness)
    assert sizes == pytest.approx((LENGTH, WIDTH, THICKNESS))


def test_a_strip_by_what_is_said() -> None:
    text = lines("Extension (mm),Load (N)", 1e3 * TRAVEL, FORCE)
    same_stretch(imported(text.encode(), rig="uniaxial", gauge_length=LENGTH, width=WIDTH, thickness=THICKNESS))


def test_no_header_but_names_said() -> None:
    text = lines((), TIME, 0 * TIME + 7, 1e3 * TRAVEL, FORCE, sep="   ")
    same_force(imported(text.encode(), columns="time_s,-,travel_mm,force_N"))


def test_units_said() -> None:
    text = lines("Time,Extension,Load", TIME, 1e3 * TRAVEL, FORCE)
    same_force(imported(text.encode(), units="time=s,travel=mm,load=N"))


@pytest.mark.parametrize(
    ("unit", "per_one"), [("ratio", 1), ("Ratio", 1), ("1", 1), ("mm/mm", 1), ("percent", 100), ("%", 100)]
)
def test_units_of_a_strain_said(unit: str, per_one: int) -> None:
    text = lines("Strain,Stress (MPa)", per_one * (STRETCH - 1), STRESS / 1e6, form="%.9g")
    found = imported(text.encode(), units=f"strain={unit}")
    same_stretch(found)
    assert not any("in one" in g.value for g in found.guesses)


def test_compression_and_zero() -> None:
    text = lines("Position (mm),Force (N)", -212.5 - 1e3 * TRAVEL, -FORCE)
    same_force(imported(text.encode()), times=False)


def test_blank_lines_comments_and_empty_columns() -> None:
    text = lines("# Time [s];;Weg [mm];Kraft [N];", TIME, TIME, 1e3 * TRAVEL, FORCE, sep=";")
    rows = text.split("\n")
    spaced = "\n\n".join(
        [rows[0], *(";".join([*r.split(";")[:1], "", *r.split(";")[2:], ""]) for r in rows[1:] if r), ""]
    )
    same_force(imported(spaced.encode()))


def test_clock_times() -> None:
    clock = [f"00:{int(t // 60):02d}:{t % 60:06.3f}" for t in TIME]
    rows = "".join(f"{c}\t{1e3 * x:.6f}\t{f:.7f}\n" for c, x, f in zip(clock, TRAVEL, FORCE, strict=True))
    same_force(imported(("Time\tDisplacement (mm)\tLoad (N)\n" + rows).encode()))
