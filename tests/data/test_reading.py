"""Reading a measurement, and every fault that a file can have."""

import pickle
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.data.thinning import READ
from bayesmembrane.ground.errors import DataError
from bayesmembrane.physics.rigs.annulus import Annulus

CURVE = "deflection_mm,force_N\n5,0.03\n10,0.2\n20,0.95\n"
SPECIMEN = """
[specimen]
name = "film 1"
thickness_um = 50.0
[rig]
kind = "annulus"
inner_radius_mm = 10.0
outer_radius_mm = 35.0
"""


class Files:
    """A curve and a specimen file in a folder of their own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.curve, self.specimen = folder / "curve.csv", folder / "film.toml"

    def read(self, curve: str | bytes = CURVE, specimen: str | bytes = SPECIMEN) -> Measurement:
        for path, content in ((self.curve, curve), (self.specimen, specimen)):
            path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_measurement(self.curve, self.specimen)

    def fault(self, curve: str | bytes = CURVE, specimen: str | bytes = SPECIMEN) -> str:
        with pytest.raises(DataError) as caught:
            self.read(curve, specimen)
        return str(caught.value).replace(f"{self.folder}/", "")


@pytest.fixture
def files(tmp_path: Path) -> Files:
    return Files(tmp_path)


# ---- what is read ----------------------------------------------------------------------------------------------------


def test_curve_in_si(files: Files) -> None:
    m = files.read()
    assert np.array_equal(m.deflection, [0.005, 0.01, 0.02])
    assert np.array_equal(m.force, [0.03, 0.2, 0.95])
    assert m.rig == Annulus(0.01, 0.035)
    assert m.specimen == Specimen("film 1", 5e-5)
    assert m.time is None
    assert m.noise_covariance is None
    assert m.full_range == 0.02
    assert (m.provenance.curve, m.provenance.specimen) == ("curve.csv", "film.toml")


def test_units_of_the_header_do_not_change_the_curve(files: Files) -> None:
    other = files.read("Force_mN,time_min,deflection_um\n30,1,5000\n200,2,10000\n950,3,20000\n")
    assert np.allclose(other.deflection, [0.005, 0.01, 0.02], rtol=1e-15)
    assert np.allclose(other.force, [0.03, 0.2, 0.95], rtol=1e-15)
    assert other.time is not None
    assert np.array_equal(other.time, [60, 120, 180])


@pytest.mark.parametrize(
    "curve",
    [
        "\ufeff" + CURVE,
        CURVE.replace("\n", "\r\n"),
        CURVE.replace("\n", "\r"),
        "# a comment\n\n" + CURVE + "\n\n",
        CURVE.replace(",", " , "),
        'deflection_mm,force_N\n"5","0.03"\n"10",".2"\n+2e1,9.5E-1,\n',
    ],
)
def test_spellings_of_the_same_file(files: Files, curve: str) -> None:
    assert files.read(curve).data_hash == files.read().data_hash


def test_other_columns_are_ignored_and_noted(files: Files) -> None:
    m = files.read("deflection_mm,force_N,remark\n5,0.03,slow\n10,0.2,\n")
    assert m.provenance.notes == ("ignored columns: remark",)


def test_origin_is_kept(files: Files) -> None:
    m = files.read(specimen=SPECIMEN + '[measurement]\norigin = "bench 2"\n[origin]\nyear = 2022\ndoi = "x"\n')
    assert m.provenance.origin == "bench 2; year: 2022; doi: x"


def test_noise_as_one_value_as_column_and_as_covariance(files: Files) -> None:
    one = files.read(specimen=SPECIMEN + "[measurement]\nforce_sd_mN = 4\n")
    column = files.read("deflection_mm,force_N,force_sd_N\n5,0.03,0.004\n10,0.2,0.004\n20,0.95,0.004\n")
    (files.folder / "cov.csv").write_text("# N^2\n" + "16e-6,0,0\n0,16e-6,0\n0,0,16e-6\n")
    matrix = files.read(specimen=SPECIMEN + '[measurement]\ncovariance = "cov.csv"\n')
    for m in (one, column, matrix):
        assert m.force_sd is not None
        assert m.noise_covariance is not None
        assert np.allclose(m.force_sd, 0.004)
        assert np.allclose(m.noise_covariance, np.diag([16e-6] * 3))
    assert matrix.provenance.covariance == "cov.csv"


def test_covariance_wins_over_a_column_that_agrees(files: Files) -> None:
    (files.folder / "cov.csv").write_text("a b c\n16e-6 8e-6 0\n8e-6 16e-6 0\n0 0 16e-6\n")
    curve = "deflection_mm,force_N,force_sd_N\n5,0.03,0.004\n10,0.2,0.004\n20,0.95,0.004\n"
    specimen = SPECIMEN + '[measurement]\ncovariance = "cov.csv"\n'
    m = files.read(curve, specimen)
    assert m.covariance is not None
    assert m.covariance[0, 1] == 8e-6
    assert "not the square of the column force_sd" in files.fault(curve.replace("0.004", "0.1"), specimen)


def test_arrays_are_read_only_and_pickles_are_equal(files: Files) -> None:
    m = files.read()
    with pytest.raises(ValueError, match="read-only"):
        m.force[0] = 1.0
    assert pickle.loads(pickle.dumps(m)).data_hash == m.data_hash


def test_hash_depends_on_what_a_likelihood_depends_on(files: Files) -> None:
    base = files.read()
    others = [
        files.read(CURVE.replace("0.95", "0.96")),
        files.read(specimen=SPECIMEN.replace("50.0", "51.0")),
        files.read(specimen=SPECIMEN.replace("35.0", "36.0")),
        files.read(specimen=SPECIMEN + "[measurement]\nforce_sd_N = 0.1\n"),
        base.up_to(0.011),
    ]
    hashes = {m.data_hash for m in (base, *others)}
    assert len(hashes) == len(others) + 1
    assert files.read(specimen=SPECIMEN.replace("film 1", "film 2")).data_hash == base.data_hash


# ---- faults of the curve ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("curve", "said"),
    [
        ("", "curve.csv: the file is empty"),
        ("# only words\n", "nothing but comments"),
        (b"\xff\xfe\x00\x01", "not a text file"),
        (b"deflection_mm,force_N\n1,2\n\xb5,3\n", "line 3: the text is not UTF-8"),
        ("1,2\n3,4\n", "line 1: there is no header line"),
        (
            "deflection_mm,farce_N\n1,2\n",
            'the column force_N is missing among deflection_mm, farce_N; rename "farce_N"',
        ),
        ("deflection_mm\n1\n2\n", "the column force_N is missing"),
        (
            "时间,位移,力\n0,1,2\n1,2,3\n",
            "is missing among 时间, 位移, 力; name its columns with their units or use `bayesmembrane import`.",
        ),
        ("deflection_mm,force_N\n", "at least two points, and this one has 0"),
        ("deflection_mm,force_N\n1,2\n", "at least two points, and this one has 1"),
        ("deflection_mm,force_n\n1,2\n3,4\n", 'there is no unit "n" of force; did you mean "N"?'),
        ("deflection_N,force_N\n1,2\n3,4\n", '"N" is a unit of force, not of length'),
        ("deflection,force_N\n1,2\n3,4\n", 'the column "deflection" names no unit; call it deflection_mm'),
        ("deflection_mm,force_N,force_mN\n1,2,3\n3,4,5\n", 'the columns "force_N" and "force_mN" both give the force'),
        ("deflection_mm,force_N,force_N\n1,2,3\n3,4,5\n", "stands there twice"),
        (
            'deflection_mm,force_N\n1,0.1\n2,"0,25"\n',
            'line 3, column force_N: "0,25" has a decimal comma; write 0.25 or use `bayesmembrane import`.',
        ),
        ("deflection_mm,force_N\n1,0,1\n", "line 2: the line has 3 cells and the header 2"),
        ("deflection_mm,force_N\n1,0,0,1\n", "as decimal commas would cause"),
        ("deflection_mm;force_N\n1;2\n", "separated by semicolons; separate them by commas or use"),
        ("deflection_mm\tforce_N\n1\t2\n", "separated by tabs"),
        ("deflection_mm,force_N\n1,2\n2,\n", "line 3, column force_N: the cell is empty"),
        ("deflection_mm,force_N\n1,2\n2\n", "line 3, column force_N: the cell is empty"),
        ("deflection_mm,force_N\n1,NaN\n2,3\n", 'line 2, column force_N: "NaN" is not a measured value'),
        ("deflection_mm,force_N\n1,-inf\n2,3\n", '"-inf" is not a measured value'),
        ("deflection_mm,force_N\n1,1e999\n2,3\n", "too large to be measured"),
        ("deflection_mm,force_N\nslow,1\n2,3\n", 'line 2, column deflection_mm: "slow" is not a number'),
        ("deflection_mm,force_N\n1_0,1\n2,3\n", '"1_0" is not a number'),
        ("deflection_mm,force_N\n1,1\n1,2\n2,3\n", "line 3: the deflection 1 mm stands there twice"),
        ("deflection_mm,force_N\n1,1\n3,2\n2,3\n4,4\n", "line 4: the deflection is not in order (2 mm after 3 mm)"),
        ("deflection_mm,force_N\n3,1\n2,2\n1,3\n", "line 3: the deflection falls from the first line on; sort"),
        ("time_s,deflection_mm,force_N\n0,1,1\n0,3,2\n", "line 3: the time does not increase (0 s after 0 s)"),
        ("deflection_mm,force_N\n-3,1\n-2,2\n1,3\n", "the deflection is negative at most points"),
        ("deflection_mm,force_N\n1,-1\n2,-2\n3,-3\n", "the force is negative where the disc is lifted most"),
        (
            "deflection_m,force_N\n1,1\n2,2\n3,3\n",
            "line 4: a deflection of 3000 mm on a rig of 35 mm looks like a wrong",
        ),
        ("deflection_mm,force_N,force_sd_N\n1,1,1\n2,2,0\n", "line 3: the standard deviation of the force must be pos"),
    ],
)
def test_fault_of_the_curve_is_one_sentence(files: Files, curve: str | bytes, said: str) -> None:
    message = files.fault(curve)
    assert said in message
    assert "\n" not in message
    assert message.startswith("curve.csv")


@pytest.mark.parametrize("force", [(-9.0, -8.0, -6.0, -5.0, -4.0), (0.0, -0.2, 0.7, -0.4, -0.3)])
def test_an_offset_and_friction_may_leave_most_forces_negative(files: Files, force: tuple[float, ...]) -> None:
    """Of a load cell with an offset, and of a guide that rubs on the way back: the film pulls in the right sense."""
    at = (1, 2, 3, 4, 5) if force[-1] > force[0] else (1, 2, 5, 2, 1)
    rows = "".join(f"{t},{d},{f}\n" for t, d, f in zip(range(5), at, force, strict=True))
    assert np.array_equal(files.read("time_s,deflection_mm,force_N\n" + rows).force, force)


def test_a_film_that_tears_before_an_offset_is_no_wrong_sign(files: Files) -> None:
    rows = "".join(f"{d},{0.05 * d if d <= 14 else -0.01}\n" for d in range(1, 21))
    assert files.read("deflection_mm,force_N\n" + rows).force[-1] == -0.01


def test_reversals_of_several_steps_are_a_protocol_without_times(files: Files) -> None:
    m = files.read("deflection_mm,force_N\n" + "".join(f"{x},{x}\n" for x in (1, 2, 3, 4, 2, 1, 3, 5)))
    assert m.cycle.tolist() == [1, 1, 1, 1, 1, 1, 2, 2]


def test_missing_files_and_folders(files: Files) -> None:
    with pytest.raises(DataError, match="there is no such file"):
        read_measurement(files.curve, files.specimen)
    with pytest.raises(DataError, match="this is a folder"):
        read_measurement(files.folder, files.specimen)
    with pytest.raises(DataError, match="cannot be read"):
        read_measurement("a\0b", files.specimen)


# ---- faults of the specimen file -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("50.0", "-50.0", "[specimen]: the thickness must be positive, and -50 um is not"),
        ("50.0", "50000.0", "[specimen]: a specimen 50 mm thick looks like a wrong unit"),
        ("50.0", '"50"', "thickness_um must be a finite number, and it is '50'"),
        ("50.0", "true", "thickness_um must be a finite number, and it is True"),
        ("50.0", "nan", "thickness_um must be a finite number"),
        ("50.0", "1" + 400 * "0", "thickness_um must be a finite number"),
        ("50.0", "50,0", "not valid TOML"),
        ("50.0", "+.5", "a number has digits on both sides of its point: write +0.5"),
        ("50.0", "5. # um", "a number has digits on both sides of its point: write 5.0"),
        (
            "thickness_um = 50.0\n",
            "",
            "the key thickness_um is missing; add it with its value, as in thickness_um = 50",
        ),
        ("thickness_um", "thickness", "the key thickness names no unit; call it thickness_um"),
        ("thickness_um", "thickness_micron", 'there is no unit "micron" of length'),
        ("thickness_um", "thikness_um", 'the key thickness_um is missing; rename "thikness_um" if that is it'),
        ('name = "film 1"', 'nmae = "film 1"', 'the key "nmae" is unknown; did you mean "name"?'),
        ('name = "film 1"', "name = 3", "name must be a text in quotes, and it is 3"),
        ("inner_radius_mm = 10.0", "inner_radius_mm = 35.0", "the inner radius (35 mm) must be smaller than the outer"),
        ("inner_radius_mm = 10.0", "inner_radius_mm = 0", "inner_radius_mm must be a positive length, and 0 mm is not"),
        ("_mm = 35.0", "_m = 35.0", "a rig of 35 m looks like a wrong unit"),
        (
            "inner_radius_mm = 10.0\n",
            "",
            "[rig]: the key inner_radius_mm is missing",
        ),
        ("[rig]", "[rgi]", 'the section [rig] is missing; rename "rgi" if that is it'),
        ("annulus", "planr", 'no rig of the kind "planr"'),
        ("annulus", "anulus", 'there is no rig of the kind "anulus"'),
        ('kind = "annulus"', "", "the key kind is missing"),
        ("[specimen]", "[extra]\na = 1\n[specimen]", 'the key "extra" is unknown'),
        (
            "[specimen]",
            "[measurement]\nforce_sd_N = -1\n[specimen]",
            "standard deviation of the force must be positive",
        ),
        ("[specimen]", "[measurement]\nforce_sd_N = 1e-30\n[specimen]", "looks like a wrong unit"),
        ("[specimen]", "[measurement]\nforce_sd_N = 5e-8\n[specimen]", "looks like a wrong unit"),
        ("outer_radius_mm = 35.0\n", "", "the key outer_radius_mm is missing; add it with its value"),
        ("[specimen]", "[measurement]\nforce_sd = 1\n[specimen]", "the key force_sd names no unit"),
        ("[specimen]", 'measurement = "x"\n[specimen]', '"measurement" must be a section'),
        ("[specimen]", '[measurement]\ncovariance = "no.csv"\n[specimen]', "no.csv: there is no such file"),
    ],
)
def test_fault_of_the_specimen_file(files: Files, old: str, new: str, said: str) -> None:
    assert old in SPECIMEN
    message = files.fault(specimen=SPECIMEN.replace(old, new, 1))
    assert said in message
    assert "\n" not in message


def test_a_noise_in_newtons_of_a_stress_needs_the_width(files: Files) -> None:
    curve = "stretch,nominal_stress_MPa\n1.1,0.1\n1.5,0.3\n2,0.5\n"
    strip = "[specimen]\nthickness_um = 500\n[rig]\nkind = 'uniaxial'\n"
    noise = "[measurement]\nforce_sd_N = 0.01\n"
    assert "no width says how the two go together" in files.fault(curve, strip + noise)
    whole = files.read(curve, f"{strip}width_mm = 4\n{noise}")
    assert whole.force_sd == pytest.approx(0.01)
    assert "no width says" in files.fault(
        "stretch,nominal_stress_MPa,force_sd_N\n1.1,0.1,0.01\n1.5,0.3,0.01\n2,0.5,0.01\n", strip
    )
    files.read(curve, f"{strip}[measurement]\nnominal_stress_sd_MPa = 0.002\n")
    sheared = "shear,shear_stress_MPa\n0.1,0.1\n0.5,0.3\n1,0.5\n"
    assert "no width says" in files.fault(sheared, strip.replace("uniaxial", "shear") + noise)


@pytest.mark.parametrize("specimen", ["", " \r\n", "# film 1\n"])
def test_a_specimen_file_that_says_nothing_is_told_what_it_must_say(files: Files, specimen: str) -> None:
    message = files.fault(specimen=specimen)
    assert message.startswith("film.toml: the file says nothing of film and rig; write [specimen] with thickness_um")
    assert "[rig]" in message


@pytest.mark.parametrize(
    ("curve", "kind", "theirs", "right"),
    [
        (
            "stretch_1,stretch_2,nominal_stress_1_MPa,nominal_stress_2_kPa\n1.1,1.1,0.1,0.1\n",
            "uniaxial",
            "stretch_1, stretch_2, nominal_stress_1, nominal_stress_2",
            "biaxial",
        ),
        ("stretch,nominal_stress_MPa\n1.1,0.1\n", "biaxial", "stretch, nominal_stress", "uniaxial"),
        (CURVE, "uniaxial", "deflection, force", "annulus"),
    ],
)
def test_columns_of_another_rig_are_a_fault_of_its_kind(
    files: Files, curve: str, kind: str, theirs: str, right: str
) -> None:
    message = files.fault(curve, f'[specimen]\nthickness_um = 50.0\n[rig]\nkind = "{kind}"\n')
    assert message.startswith(f'film.toml, [rig]: a rig of the kind "{kind}" reads ')
    assert f"and the curve has {theirs}; write a kind that reads these: " in message
    assert right in message.split(": ")[-1]


def test_syntax_error_names_the_line(files: Files) -> None:
    assert "film.toml: this is not valid TOML" in files.fault(specimen="[specimen]\nname = film\n")
    assert "line 2" in files.fault(specimen="[specimen]\nname = film\n")
    assert "nested too deeply" in files.fault(specimen="a = " + "[" * 20000)


def test_noise_is_given_once(files: Files) -> None:
    curve = "deflection_mm,force_N,force_sd_N\n5,0.03,0.004\n10,0.2,0.004\n"
    assert "both give the noise" in files.fault(curve, SPECIMEN + "[measurement]\nforce_sd_N = 1\n")


@pytest.mark.parametrize(
    ("matrix", "said"),
    [
        ("1,0\n0,1\n", "cov.csv: the covariance is 2 x 2, and the curve has 3 points"),
        ("1,0,0\n0,1\n0,0,1\n", "cov.csv, line 2: the line has 2 numbers, and the first has 3"),
        ("1,0,0\n0,x,0\n0,0,1\n", 'cov.csv, line 2, column 2: "x" is not a number'),
        ("1,0,0\n0,1,nan\n0,0,1\n", "cov.csv, line 2, column 3"),
        ("1,0,0\n0,0,0\n0,0,1\n", "entry 2 of the diagonal is a variance, and it is not positive"),
        ("1,.5,0\n0,1,0\n0,0,1\n", "not symmetric"),
        ("1,1,1\n1,1,1\n1,1,1\n", "not positive definite"),
        ("1e-300,1e10,0\n1e10,1e-300,0\n0,0,1\n", "cov.csv"),
        ("a,b,c\n", "cov.csv: the file holds no numbers"),
    ],
)
def test_fault_of_the_covariance(files: Files, matrix: str, said: str) -> None:
    (files.folder / "cov.csv").write_text(matrix)
    assert said in files.fault(specimen=SPECIMEN + '[measurement]\ncovariance = "cov.csv"\n')


BLANK = SPECIMEN + '[measurement]\nblank_run = "blank.csv"\n'
FRAME = "deflection_um,force_mN\n0,0\n2,250\n4,500\n7,900\n"


def test_a_blank_run_is_read_beside_the_curve_and_its_reach_is_told(files: Files) -> None:
    (files.folder / "blank.csv").write_text(FRAME)
    m = files.read(specimen=BLANK)
    assert m.blank_run == pytest.approx(np.array([[0, 0], [2e-6, 0.25], [4e-6, 0.5], [7e-6, 0.9]]))
    assert m.provenance.notes == ("the frame is that of blank.csv, 4 readings up to 0.9 N",)
    assert m.data_hash != files.read().data_hash
    stronger = files.read(CURVE.replace("0.95", "2.5"), BLANK)
    assert stronger.provenance.notes == (
        "the frame is that of blank.csv, 4 readings up to 0.9 N; "
        "the test goes to 2.5 N: its curve is drawn on straight",
    )


@pytest.mark.parametrize(
    ("run", "said"),
    [
        (None, "blank.csv: there is no such file"),
        ("deflection_um,force_mN\n0,0\n2,250\n4,500\n4,500\n", "blank.csv: a blank run needs readings at 3 different"),
        ("deflection_um,force_mN\n0,0\n-2,250\n-4,500\n-6,800\n", "blank.csv: the crosshead goes the less"),
        (
            "deflection_um,force_mN\n0,0\n-2,-250\n-4,-500\n-6,-800\n",
            "load the rigid dummy up to the forces of the test",
        ),
        (
            "deflection_mm,force_mN\n0,0\n5,250\n10,500\n15,800\n",
            "17.9 mm under the 0.95 N of the test, which goes 20 mm",
        ),
        ("deflection_um,force_mN\n0,0\n2,x\n", "blank.csv, line 3, column force_mN"),
        ("force_mN\n0\n2\n", "blank.csv"),
    ],
)
def test_fault_of_a_blank_run(files: Files, run: str | None, said: str) -> None:
    if run is not None:
        (files.folder / "blank.csv").write_text(run)
    assert said in files.fault(specimen=BLANK)


def test_a_rig_that_reads_stretches_has_no_blank_run(files: Files) -> None:
    strip = '[specimen]\nthickness_um = 50.0\n[rig]\nkind = "uniaxial"\n[measurement]\nblank_run = "blank.csv"\n'
    (files.folder / "blank.csv").write_text(FRAME)
    assert "does not read its travel and force" in files.fault("stretch,nominal_stress_MPa\n1.1,0.1\n1.2,0.2\n", strip)


# ---- rubbish ---------------------------------------------------------------------------------------------------------

rubbish = settings(deadline=None, max_examples=120, suppress_health_check=[HealthCheck.function_scoped_fixture])
cells = st.one_of(
    st.floats().map(repr),
    st.integers(-9, 99).map(str),
    st.text(max_size=6),
    st.sampled_from(["", "0,25", "nan", '"', "'", "1e400", "-", "٣", "\x0b", "#", "5e-324", "-0.0"]),
)
headers = st.sampled_from(
    ["deflection_mm", "force_N", "time_s", "force_sd_N", "force", "force_mm", "stretch", "", '"', "deflection_m", "#"]
)
scalars = st.one_of(st.integers(), st.floats(), st.booleans(), st.text(max_size=8), st.dates(), st.lists(st.integers()))
keys = st.sampled_from(
    ["name", "thickness_um", "thickness", "kind", "inner_radius_mm", "outer_radius_mm", "force_sd_N", "covariance", "é"]
)


def survives(files: Files, curve: str | bytes, specimen: str | bytes) -> None:
    """The measurement is good, or it is refused with a `DataError`; nothing else comes out of the reader."""
    try:
        m = files.read(curve, specimen)
    except DataError:
        return
    assert len(m) >= 2
    assert m.leg.shape == m.cycle.shape == m.is_first_loading.shape


@given(st.binary(max_size=200), st.binary(max_size=200))
@rubbish
def test_reader_survives_bytes(files: Files, curve: bytes, specimen: bytes) -> None:
    survives(files, curve, SPECIMEN)
    survives(files, CURVE, specimen)
    survives(files, CURVE.encode() + curve, SPECIMEN.encode() + specimen)


@given(st.lists(headers, max_size=5), st.lists(st.lists(cells, max_size=5), max_size=8), st.sampled_from(",;\t"))
@rubbish
def test_reader_survives_tables(files: Files, header: list[str], rows: list[list[str]], delimiter: str) -> None:
    lines = [delimiter.join(row) for row in [header, *rows]]
    survives(files, "\n".join(lines).encode("utf-8", "replace"), SPECIMEN)
    lines[0] = "deflection_mm,force_N,force_sd_N"
    survives(files, "\n".join(lines).encode("utf-8", "replace"), SPECIMEN)


@given(
    st.dictionaries(st.sampled_from(["specimen", "rig", "measurement", "x"]), st.dictionaries(keys, scalars) | scalars)
)
@rubbish
def test_reader_survives_specimen_files(files: Files, content: dict[str, object]) -> None:
    try:
        text = tomli_w.dumps(content)
    except (ValueError, UnicodeError):
        return
    survives(files, CURVE, text.encode("utf-8", "replace"))


@given(st.lists(st.lists(cells, min_size=3, max_size=3), min_size=3, max_size=3))
@rubbish
def test_reader_survives_covariances(files: Files, rows: list[list[str]]) -> None:
    text = "\n".join(",".join(row) for row in rows)
    (files.folder / "cov.csv").write_bytes(text.encode("utf-8", "replace"))
    survives(files, CURVE, SPECIMEN + '[measurement]\ncovariance = "cov.csv"\n')


@given(st.lists(st.floats(0.1, 90), min_size=2, max_size=30, unique=True), st.floats(0.1, 100))
@rubbish
def test_any_sorted_curve_is_read(files: Files, x: list[float], force: float) -> None:
    rows = "".join(f"{v!r},{force * v!r}\n" for v in sorted(x))
    m = files.read("deflection_mm,force_N\n" + rows)
    assert np.allclose(m.deflection, np.sort(x) * 1e-3, rtol=1e-15)
    assert np.all(m.is_first_loading)


def test_of_a_very_long_file_some_readings_are_used_and_it_says_so(tmp_path: Path) -> None:
    """A turning point among 30 000 readings stays, and the noise of each reading is what it was."""
    n = 30_001
    stretch = 1.0 + 1e-4 * np.concatenate([np.arange(15_001), np.arange(14_999, -1, -1)])
    rows = "".join(f"{s:.6f},{0.3 * (s - s**-2):.9f}\n" for s in stretch)
    (tmp_path / "long.csv").write_text("stretch,nominal_stress_MPa\n" + rows)
    (tmp_path / "long.toml").write_text(
        '[specimen]\nthickness_um = 500\n[rig]\nkind = "uniaxial"\n[measurement]\nnominal_stress_sd_MPa = 0.001\n'
    )
    found = read_measurement(tmp_path / "long.csv", tmp_path / "long.toml")
    assert len(found) <= READ < n
    assert found.provenance.notes[-1].startswith(f"{len(found)} of {n} readings are used")
    assert found.deflection.max() == pytest.approx(found.full_range)
    assert len(found.path.deflection) == len(found)
    assert found.force_sd is not None
    assert np.ptp(found.force_sd) == 0
