# ruff: noqa: E501 - a line for each file
"""What an export leaves open is refused with its place and the option that settles it, or said; nothing is invented."""

import numpy as np
import pytest

from bayesmembrane.ground.errors import BayesmembraneError
from tests.data.exports.test_layouts import FORCE, LENGTH, STRESS, STRETCH, TIME, TRAVEL, imported, lines

MM = 1e3 * TRAVEL
STRIP = {"rig": "uniaxial", "gauge_length": 0.05, "width": 0.01, "thickness": 5e-4}


def refusal(text: str | bytes, **said: object) -> str:
    data = text if isinstance(text, bytes) else text.encode()
    with pytest.raises(BayesmembraneError) as caught:
        imported(data, **said)
    return str(caught.value)


def damaged(text: str, line: int, cell: int, value: str, sep: str = ",") -> str:
    rows = text.split("\n")
    cells = rows[line - 1].split(sep)
    cells[cell] = value
    rows[line - 1] = sep.join(cells)
    return "\n".join(rows)


PLAIN = lines("Time (s),Extension (mm),Load (N)", TIME, MM, FORCE)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (lines((), TIME, MM, FORCE), ["line 1", "names them", "--columns time_s,travel_mm,force_N"]),
        (lines("A,B,C", TIME, MM, FORCE), ["line 1", "no column is known to hold travel and force", "A, B, C"]),
        (lines("Time (s),Extension (mm)", TIME, MM), ["line 1", "the force or stress", "--columns"]),
        (lines("Time (s),Load (N)", TIME, FORCE), ["line 1", "how far the film was pulled", "--columns"]),
        (lines("Time (s),Extension,Load (N)", TIME, MM, FORCE), ['"Extension" names no unit', "--units travel=mm"]),
        (lines("Extension (furlong),Load (N)", MM, FORCE), ['"furlong" is none of it', "--units travel=mm"]),
        (lines("Load 1 (N),Load 2 (N),Weg (mm)", FORCE, 2 * FORCE, MM), ["may each be the force", '--columns "force=Load 1']),
        (lines("Strain,Stress (MPa)", 0.4 * TIME, STRESS / 1e6), ['"Strain" names no unit', "--units strain=percent, or mm/mm, 1 or ratio"]),
        (lines("Strain (mm/mm),Stress (MPa)", STRETCH, STRESS / 1e6), ["starts at 1", "--strain stretch"]),
        (lines("Stretch,Stress (MPa)", STRETCH - 1, STRESS / 1e6), ["called a stretch and starts at 0", "strain=Stretch"]),
        (lines("Strain (%),Load (N)", 100 * (STRETCH - 1), FORCE), ["nominal stress", "--width-mm and --thickness-um"]),
        (lines("Weg;Kraft", MM + 1, FORCE + 1, sep=";", form="%.3f"), ["may have decimals or thousands", "--decimal point"]),
        (damaged(PLAIN, 9, 2, "0.2x31"), ["line 9", "Load (N)", '"0.2x31" is not a number']),
        (damaged(PLAIN, 9, 1, ""), ["line 9", "Extension (mm)", "the cell is empty"]),
        (damaged(PLAIN, 9, 1, "NaN"), ["line 9", "Extension (mm)", '"NaN" is not a measured value']),
        (damaged(PLAIN, 9, 0, "1.5"), ["line 9", "the time falls", "--readings-per-s"]),
        (PLAIN.replace("\n3.5000000,", "\nstopped by the operator\n3.5000000,"), ["line 9", "stands within the numbers"]),
        (b"PK\x03\x04" + 100 * b"a", ["the workbook cannot be opened"]),
        ("hello, world\n", ["no two lines"]),
        (lines("Weg (mm),Kraft (N)", MM, 0 * FORCE + 1), ["the force is the same in all rows", "--columns"]),
        (lines("Travel (mm),Load (N)", MM + 0.5 * np.ptp(MM), FORCE + 0.4), ["starts at 10 mm", "--zero none", "--zero travel"]),
    ],
)  # fmt: skip
def test_a_file_that_leaves_something_open_is_refused(text: str | bytes, said: list[str]) -> None:
    message = refusal(text)
    assert "export" in message
    assert [s for s in said if s not in message] == []


@pytest.mark.parametrize("encoding", ["cp1252", "gb18030"])
def test_a_refusal_names_an_encoding_that_was_guessed(encoding: str) -> None:
    name = {"cp1252": "Verlängerung", "gb18030": "位移"}[encoding]
    data = lines(f"{name},Load (N)", MM, FORCE).encode(encoding)
    guessed = f"say --units travel=mm, or what it is; the text was read as {encoding}, and --encoding says another."
    assert refusal(data).endswith(guessed)
    assert "--encoding" not in refusal(data, encoding=encoding)
    assert "--encoding" not in refusal(data.decode(encoding))


def test_without_times_a_curve_must_be_in_order() -> None:
    noisy = MM + 0.5 * np.sin(40 * np.arange(MM.size))
    text = lines("Extension (mm),Load (N)", noisy, FORCE)
    assert "--readings-per-s 10" in refusal(text)
    found = imported(text.encode(), readings_per_s=2.0)
    assert found.columns["time"] == pytest.approx(TIME)


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ({"columns": "time_s,travel_mm,force_N,force_N"}, "names 4 columns, and the file has 3"),
        ({"columns": "time_s,banana_mm,force_N"}, '"banana" in --columns is no kind of column'),
        ({"columns": "force=Weg"}, '"Weg" in --columns is none of its columns'),
        ({"units": "mm"}, '"mm" in --units is no pair'),
        ({"units": "travel=furlong"}, "names no unit of length"),
        ({"decimal": "dot"}, '--decimal cannot be "dot"; choose point, comma'),
        ({"zero": "yes"}, "choose none, travel, force"),
        ({"encoding": "klingon"}, 'there is no encoding "klingon"'),
        ({"sheet": "Values"}, 'there is no sheet "Values"'),
        ({"rig": "uniaxial"}, "the gauge length is not known; say --gauge-length-mm"),
        ({"rig": "trampoline"}, 'there is no rig called "trampoline"'),
        ({"width": -1.0}, "width must be positive"),
    ],
)
def test_wrong_options_say_what_there_is(said: dict[str, object], message: str) -> None:
    assert message in refusal(PLAIN, **said)


@pytest.mark.parametrize(("decimal", "other", "sep"), [("point", "comma", ";"), ("comma", "point", ",")])
def test_numbers_with_another_decimal_sign_than_was_said_are_not_to_be_removed(
    decimal: str, other: str, sep: str
) -> None:
    text = lines(f"Weg (mm){sep}Kraft (N)", MM, FORCE, sep=sep, decimal={"comma": ",", "point": "."}[other])
    assert f"; say --decimal {other} if all are written so" in refusal(text, decimal=decimal)


def test_several_specimens_are_listed_and_chosen() -> None:
    second = lines(("Sample B", "Time (s),Extension (mm),Load (N)"), TIME, MM, 2 * FORCE)
    text = "Sample A\n" + PLAIN + second
    message = refusal(text)
    assert "2 sets of readings (1: Sample A, 2: Sample B)" in message
    assert "--part 1" in message
    for part, times in (("1", 1), ("Sample B", 2)):
        assert imported(text.encode(), part=part).columns["force"] == pytest.approx(times * FORCE, abs=1e-6)


def test_specimens_beside_each_other() -> None:
    heads = ("1 _ 1,,,1 _ 2,,", "Time,Force,Stroke,Time,Force,Stroke", "sec,N,mm,sec,N,mm")
    text = lines(heads, TIME, FORCE, MM, TIME, 2 * FORCE, MM)
    rows = text.strip().split("\n")
    rows[-3:] = [",".join([*r.split(",")[:3], "", "", ""]) for r in rows[-3:]]  # the second was shorter
    text = "\n".join(rows)
    assert "1: 1 _ 1, 2: 1 _ 2" in refusal(text)
    assert len(imported(text.encode(), part="1").columns["force"]) == TIME.size
    assert imported(text.encode(), part="1 _ 2").columns["force"] == pytest.approx(2 * FORCE[:-3], abs=1e-6)


# ---- what a file says twice ------------------------------------------------------------------------------------------


def contradictions(text: str, **said: object) -> str:
    return " ".join(imported(text.encode(), **said).contradictions)


def test_strain_against_travel_is_reported_with_its_rows() -> None:
    strain = 100 * (STRETCH - 1)
    strain[10:14] *= 1.2
    text = lines("Extension (mm),Strain (%),Stress (MPa)", MM, strain, STRESS / 1e6)
    found = contradictions(text, gauge_length=LENGTH)
    assert "contradict each other in 4 of 25 rows (lines 12 to 15" in found


def test_true_against_engineering_stress() -> None:
    text = lines("Strain (%),Stress (MPa),True stress (MPa)", 100 * (STRETCH - 1), STRESS / 1e6, STRESS / 1e6)
    assert "true stress and engineering stress times stretch contradict" in contradictions(text)
    text = lines("Strain (%),Stress (MPa),True stress (MPa)", 100 * (STRETCH - 1), STRESS / 1e6, STRESS * STRETCH / 1e6)
    assert contradictions(text) == ""


TWICE = (100 * np.log(STRETCH), STRESS * STRETCH / 1e6, 100 * (STRETCH - 1), STRESS / 1e6)


@pytest.mark.parametrize(
    "header",
    [
        "True strain (%),True stress (MPa),Engineering strain (%),Engineering stress (MPa)",
        "Wahre Dehnung [%],Wahre Spannung [MPa],Technische Dehnung [%],Technische Spannung [MPa]",
        "Log strain (%),True stress (MPa),Nominal strain (%),Nominal stress (MPa)",
        "True strain (%),True stress (MPa),Strain (%),Stress (MPa)",
    ],
)
def test_of_true_and_engineering_columns_the_engineering_ones_are_taken(header: str) -> None:
    names = header.split(",")
    found = imported(lines(header, *TWICE).encode())
    assert found.columns["stretch"] == pytest.approx(STRETCH, abs=1e-6)
    assert found.columns["nominal_stress"] == pytest.approx(STRESS, rel=1e-4, abs=20)
    assert not found.contradictions
    assert f"compared with the curve, and not used: {names[0]}, {names[1]}" in found.notes
    assert not any("ignored" in note for note in found.notes)
    true = imported(lines(header, *TWICE).encode(), strain="true", stress="true")
    assert true.columns["stretch"] == pytest.approx(STRETCH, abs=1e-6)
    assert true.columns["nominal_stress"] == pytest.approx(STRESS, rel=1e-4, abs=20)
    assert any(g.value == f'"{names[0]}" is true' for g in true.guesses)


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ("", "true"),
        ("strain=Strain,stress=Stress (MPa)", "true"),
        ("strain=3", "true"),
        ("strain=True strain,stress=True stress (MPa)", "engineering"),
    ],
)
def test_what_a_choice_of_columns_leaves_over_is_compared_with_the_curve(columns: str, words: str) -> None:
    header = "True strain,True stress (MPa),Strain,Stress (MPa)"
    strain, stress = np.log(STRETCH), TWICE[1].copy()
    strain[-2:] *= 1.2
    stress[-5:] *= 1.15
    text = lines(header, strain, stress, STRETCH - 1, TWICE[3])
    found = imported(text.encode(), columns=columns, units="strain=mm/mm").contradictions
    assert [f"{words} strain and" in found[0], f"{words} stress and" in found[1], len(found)] == [True, True, 2]
    assert "in 2 of 25 rows (lines 25 to 26" in found[0]
    assert found[0].endswith(" mm/mm)")
    assert "in 5 of 25 rows (lines 22 to 26" in found[1]
    assert "MPa against 0.1" in found[1]


def test_a_column_left_out_by_its_place_is_not_compared() -> None:
    text = lines("True strain (%),True stress (MPa),Strain (%),Stress (MPa)", *TWICE[:1], TWICE[3], *TWICE[2:])
    assert "true stress and" in contradictions(text)
    assert contradictions(text, columns="-,-,strain,stress") == ""


def test_a_column_that_is_only_compared_keeps_its_own_unit_and_may_have_gaps() -> None:
    text = lines("True strain (%),True stress (MPa),Strain,Stress (MPa)", *TWICE[:2], STRETCH - 1, TWICE[3])
    assert contradictions(text, columns="strain=Strain", units="strain=mm/mm") == ""
    found = imported(damaged(text, 9, 0, "-.-").encode(), columns="strain=Strain", units="strain=mm/mm")
    assert not found.contradictions
    assert "ignored columns: True strain (%)" in found.notes


def test_true_stress_against_force_over_area() -> None:
    text = lines("Strain (%),Force (N),True stress (kPa)", 100 * (STRETCH - 1), FORCE, STRESS / 1e3)
    found = contradictions(text, width=0.01, thickness=5e-4)
    assert "true stress and force over width and thickness times stretch contradict" in found
    assert "kPa against" in found


@pytest.mark.parametrize("sign", [{"rig": "compression"}, {"sign": "flip"}])
def test_what_is_only_compared_is_turned_round_with_what_is_used(sign: dict[str, str]) -> None:
    pressed = 1 - 0.2 * (STRETCH - 1)
    columns = TIME, -100 * np.log(pressed), STRESS * pressed / 1e6, 100 * (1 - pressed), STRESS / 1e6
    text = lines("Time (s),True strain (%),True stress (MPa),Nominal strain (%),Nominal stress (MPa)", *columns)
    found = imported(text.encode(), **sign)
    assert found.columns["stretch"] == pytest.approx(pressed, abs=1e-6)
    assert not found.contradictions


@pytest.mark.parametrize(("speed", "agrees"), [(50.0, True), (60.0, False)])
def test_speed_times_time_against_displacement(speed: float, agrees: bool) -> None:
    x = np.linspace(0, 10, 25)  # mm in 12 s
    for key in ("Test speed (mm/min)", "Prędkość [mm/min]", "Prędkość [mm/min]:", "Test speed (mm/min) :"):
        text = lines("Time (s),Extension (mm),Load (N)", TIME, x, FORCE, before=f"{key},{speed}\n")
        assert ("times the time and the travel" not in contradictions(text)) == agrees


def test_stress_against_force_over_area() -> None:
    text = lines("Strain (%),Force (N),Stress (MPa)", 100 * (STRETCH - 1), FORCE, STRESS / 2e6)
    assert "stress and force over width and thickness" in contradictions(text, width=0.01, thickness=5e-4)


def test_area_against_width_and_thickness() -> None:
    text = lines("Extension (mm),Load (N)", MM, FORCE, before="Cross-section (mm2),6\nGauge length (mm),50\n")
    assert "5 mm2" in contradictions(text, width=0.01, thickness=5e-4)


def test_two_thicknesses_count_as_none() -> None:
    text = lines("Extension (mm),Load (N)", MM, FORCE, before="Thickness (mm),0.5\nThickness (mm),0.6\n")
    found = imported(text.encode())
    assert found.film.thickness is None
    assert "neither is used, say --thickness-um" in found.contradictions[0]


def test_a_reading_that_jumps_is_reported() -> None:
    text = damaged(PLAIN, 12, 2, "40.0")
    assert "the force leaves its neighbours and comes back at once in line 12" in contradictions(text)


@pytest.mark.parametrize(
    ("line", "said"),
    [(2, "first reading (line 2): a steep start, or damaged"), (26, "last reading (line 26): a break, or damaged")],
)
def test_an_end_reading_does_not_come_back(line: int, said: str) -> None:
    found = contradictions(damaged(PLAIN, line, 2, "0.25"))
    assert f"the force goes far in one step at the {said}" in found
    assert "comes back" not in found


# ---- every guess -----------------------------------------------------------------------------------------------------


def test_every_guess_is_said() -> None:
    found = imported(lines("Position (mm);Strain (%);Force (N)", MM - 40, 2 * MM, FORCE, sep=";").encode(), **STRIP)
    said = {g.what: g for g in found.guesses}
    assert {
        "encoding",
        "delimiter",
        "decimal sign",
        "column of travel",
        "column of force",
        "zero of the travel",
    } <= set(said)
    assert all(g.why and g.value for g in found.guesses)
    assert {g.option.split()[0] for g in found.guesses} <= {
        "--encoding",
        "--delimiter",
        "--decimal",
        "--columns",
        "--zero",
        "--rig",
        "--strain",
        "--stress",
    }


@pytest.mark.parametrize(
    ("thickness", "width", "said"),
    [
        ("0.5", "10", ""),
        ("10", "10", ""),
        ("18.2", "10", "18.2 mm thick and only 10 mm wide"),
        ("0.5", "10000", "larger than any"),
    ],
)
def test_sizes_that_no_film_has_are_told(thickness: str, width: str, said: str) -> None:
    text = f"Thickness\t{thickness}\tmm\nWidth\t{width}\tmm\nGauge length\t50\tmm\nExtension (mm)\tForce (N)\n"
    told = " ".join(imported((text + "".join(f"{i}\t{0.1 * i:.2f}\n" for i in range(9))).encode()).contradictions)
    assert said in told
    assert bool(told) == bool(said)


def test_a_strip_without_one_of_its_sizes_is_told() -> None:
    text = "Width\t10\tmm\nGauge length\t50\tmm\nExtension (mm)\tForce (N)\n"
    found = imported((text + "".join(f"{i}\t{0.1 * i:.2f}\n" for i in range(9))).encode())
    assert not found.rig
    assert list(found.contradictions) == ["some sizes of a strip are known and others are not: say --thickness-um"]
