"""Homogeneous tests: closed forms against the energy, published data, and files."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.calibration.fit import fit
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.data.writing import write_measurement
from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.registry import components, materials
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics.solution import Note
from bayesmembrane.physics.mechanics.strip_law import StripLaw, strip_curves, strip_margins
from bayesmembrane.physics.rigs.base import Strip
from bayesmembrane.physics.rigs.biaxial import Biaxial
from bayesmembrane.physics.rigs.uniaxial import Uniaxial

DATA = Path(__file__).parents[4] / "shared" / "data" / "constitutive"
FILMS = {
    "neo_hookean": [150.0],
    "mooney_rivlin": [120.0, 20.0],
    "gent": [150.0, 60.0],
    "yeoh": [150.0, -1.0, 0.05],
    "ogden": [200.0, 2.0, -8.0, 1.5, 4.8, -1.2],
}
STRETCH = np.linspace(1.05, 3.0, 12)
STRIPS = {k: v for k, v in components("rigs").items() if issubclass(v, Strip) and k != "biaxial"}
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="the published data are not here")


def strip(kind: str, stretch: np.ndarray = STRETCH, force: np.ndarray | None = None) -> Measurement:
    rig = STRIPS[kind]()
    d = rig.length * (stretch - 1)
    return Measurement(d, np.ones_like(d) if force is None else force, rig, Specimen("strip", 1e-3))


def prediction(m: Measurement, material: str):
    h = hypothesis(material)
    return h, Forward(h, m, m.deflection)(materials()[material].to_coordinates(FILMS[material]), sensitivities=True)


@pytest.mark.parametrize("material", FILMS)
@pytest.mark.parametrize("kind", STRIPS)
def test_force_is_the_slope_of_the_energy(kind: str, material: str) -> None:
    """F = d(energy)/d(deflection) along the test, with free sides where the rig leaves them free."""
    m = strip(kind)
    _, p = prediction(m, material)
    film = materials()[material](*FILMS[material])
    step = 1e-5

    def energy(stretch: np.ndarray) -> np.ndarray:
        return film.energy(stretch, m.rig.lateral(stretch)[0])

    pulled = 2.0 if kind == "equibiaxial" else 1.0  # two pairs of sides do work there
    numeric = (energy(STRETCH + step) - energy(STRETCH - step)) / (2 * step) / pulled
    assert p.force[0] == pytest.approx(m.rig.width * numeric, rel=1e-7)


@pytest.mark.parametrize("material", FILMS)
def test_free_sides_carry_nothing(material: str) -> None:
    film = materials()[material](*FILMS[material])
    l2, rate = Uniaxial.lateral(STRETCH)
    assert film.tension(STRETCH, l2)[1] == pytest.approx(0.0, abs=1e-10 * film.shear_modulus(film.vector))
    assert rate == pytest.approx((Uniaxial.lateral(STRETCH + 1e-6)[0] - l2) / 1e-6, rel=1e-4)


@pytest.mark.parametrize("kind", STRIPS)
def test_small_strains_tell_youngs_modulus(kind: str) -> None:
    m = strip(kind, 1 + np.array([1e-5, 2e-5]))
    _, p = prediction(m, "yeoh")
    factor = {"uniaxial": 3.0, "planar": 4.0, "equibiaxial": 6.0}[kind]
    assert p.force[0] / m.deflection == pytest.approx(factor * 2 * 150.0 * m.rig.width / m.rig.length, rel=1e-4)


@pytest.mark.parametrize("material", FILMS)
@pytest.mark.parametrize("kind", STRIPS)
def test_sensitivities_are_slopes(kind: str, material: str) -> None:
    m = strip(kind)
    h, p = prediction(m, material)
    x = materials()[material].to_coordinates(FILMS[material])
    f = Forward(h, m, m.deflection)
    for i in range(x.size):
        step = np.zeros(x.size)
        step[i] = 1e-4
        numeric = (f(x + step).force - f(x - step).force) / 2e-4
        assert p.sensitivity[:, :, i] == pytest.approx(numeric, rel=1e-4, abs=1e-6 * np.max(p.force))
    curves = f.curves(h.films(x), m.deflection, sensitivities=True)
    assert curves.force == pytest.approx(p.force, rel=1e-12)
    chained = np.einsum("bni,bik->bnk", curves.sensitivity, f.jacobian(x[None]))
    assert chained == pytest.approx(p.sensitivity, rel=1e-4, abs=1e-6 * np.max(p.force))


@pytest.mark.parametrize("kind", [*STRIPS, "biaxial"])
def test_files_come_back(kind: str, tmp_path: Path) -> None:
    head = {"biaxial": "stretch_1,stretch_2,nominal_stress_1_MPa,nominal_stress_2_kPa"}
    rows = {"biaxial": "1.1,1,0.2,50\n1.2,1.1,0.3,200\n1.2,1.3,0.4,500\n"}
    csv, toml = tmp_path / "c.csv", tmp_path / "c.toml"
    text = head.get(kind, "time_s,stretch,nominal_stress_MPa") + "\n"
    csv.write_text(text + rows.get(kind, "0,1,0\n1,1.1,0.1\n2,1.3,0.25\n"))
    toml.write_text(f'[specimen]\nthickness_um = 500\n[rig]\nkind = "{kind}"\nwidth_mm = 4\n')
    m = read_measurement(csv, toml)
    assert m.rig.lengths == {"length": 0.050, "width": 0.004}
    if kind == "biaxial":
        assert m.deflection == pytest.approx(0.05 * np.array([0.1, 0.2, 0.2, 0, 0.1, 0.3]))
        assert m.force == pytest.approx(2e-6 * 1e6 * np.array([0.2, 0.3, 0.4, 0.05, 0.2, 0.5]))
        assert m.across == pytest.approx([1, 1.1, 1.3, 1.1, 1.2, 1.2])
    else:
        assert m.deflection == pytest.approx([0, 0.005, 0.015])
        assert m.force == pytest.approx([0, 0.2, 0.5])
        assert m.time == pytest.approx([0, 1, 2])
    write_measurement(m, tmp_path / "d.csv", tmp_path / "d.toml")
    again = read_measurement(tmp_path / "d.csv", tmp_path / "d.toml")
    assert again.deflection == pytest.approx(m.deflection, rel=1e-12, abs=1e-15)
    assert again.force == pytest.approx(m.force, rel=1e-12)
    assert again.rig == m.rig


def test_another_column_is_asked_for(tmp_path: Path) -> None:
    (tmp_path / "c.csv").write_text("deflection_mm,force_N\n1,1\n2,2\n")
    (tmp_path / "c.toml").write_text('[specimen]\nthickness_um = 500\n[rig]\nkind = "uniaxial"\n')
    with pytest.raises(DataError, match="reads stretch, nominal_stress, and the curve has deflection, force"):
        read_measurement(tmp_path / "c.csv", tmp_path / "c.toml")
    (tmp_path / "c.csv").write_text("time_s,nominal_stress_MPa\n1,1\n2,2\n")
    with pytest.raises(DataError, match="the column stretch is missing"):
        read_measurement(tmp_path / "c.csv", tmp_path / "c.toml")


def test_a_thin_strip_is_slack_below_rest_and_a_block_pushes_back() -> None:
    stretch = np.array([0.8, 0.9, 1.1, 1.2])
    _, thin = prediction(strip("uniaxial", stretch, np.array([0.0, 0.0, 1.0, 2.0])), "neo_hookean")
    _, block = prediction(strip("uniaxial", stretch, np.array([-2.0, -1.0, 1.0, 2.0])), "neo_hookean")
    assert np.all(thin.force[0, :2] == 0)
    assert block.force[0] == pytest.approx(0.010 * 300 * (stretch - stretch**-2.0), rel=1e-12)
    assert thin.force[0, 2:] == pytest.approx(block.force[0, 2:], rel=1e-12)


@needs_data
@pytest.mark.parametrize(("test", "kind"), [("UT", "uniaxial"), ("ET", "equibiaxial"), ("PS", "planar")])
def test_natural_rubber_is_an_ogden_solid(test: str, kind: str) -> None:
    """R. W. Ogden's constants (1972) for Treloar's rubber predict all three of Treloar's tests."""
    stress, stretch = np.loadtxt(DATA / f"Treloar_1944_{test}.txt").T
    keep = stretch > 1.01
    stress, stretch = stress[keep], stretch[keep]
    m = strip(kind, stretch, stress)
    # mu = 6.3, 0.012, -0.1 kg/cm^2 with a = 1.3, 5, -2; c_i = d mu_i.
    film = np.array([[630.0, 1.2, -10.0, 1.3, 5.0, -2.0]]) * np.array([0.980665, 0.980665, 0.980665, 1, 1, 1])
    h = hypothesis("ogden")
    force = Forward(h, m, m.deflection).film_force(film)[0] / (m.rig.width * 1e-3) * 1e-6
    assert np.sqrt(np.mean((force - stress) ** 2)) < 0.06 * np.max(stress)


@needs_data
def test_a_biaxial_set_is_calibrated() -> None:
    l1, l2, p1, p2 = np.genfromtxt(DATA / "Kawabata_1981_biaxial_full.csv", delimiter=",", skip_header=1).T
    rig = Biaxial()
    found = rig.from_columns(dict(zip(rig.columns, (l1, l2, 1e6 * p1, 1e6 * p2), strict=True)), 1e-3)
    m = Measurement(found["deflection"], found["force"], rig, Specimen("rubber", 1e-3), across=found["across"])
    found_fit = fit(m, hypothesis("mooney_rivlin", convexity="none"))
    assert found_fit.rmse_N < 0.09 * np.max(m.force)
    assert found_fit.parameters["mooney_rivlin.c1"].value > 0
    part = m.select(np.arange(20))
    force = [Forward(found_fit.hypothesis, v, v.deflection)(found_fit.coordinates).force[0] for v in (m, part)]
    assert force[1] == pytest.approx(force[0][:20], rel=1e-12)


@pytest.mark.parametrize("kind", STRIPS)
def test_beyond_all_numbers_there_is_no_force_and_no_warning(kind: str) -> None:
    rig = STRIPS[kind]()
    law = StripLaw(materials()["yeoh"], np.array([[1.0, 0.0, 1e308]]), rig)
    force, slope = law(rig.length * (np.array([[1.0, 1.001, 4.0]]) - 1))
    assert np.isfinite(force).tolist() == [[True, True, False]]
    assert np.isfinite(slope).tolist() == [[True, True, False]]
    assert np.isnan(force[0, 2])


@pytest.mark.parametrize("kind", [*STRIPS, "biaxial"])
@pytest.mark.parametrize("material", FILMS)
def test_many_films_at_once_are_each_of_them(kind: str, material: str) -> None:
    """Stretches that all films share are computed once; whoever varies them by film gets the same."""
    rig = components("rigs")[kind]()
    films = np.array([FILMS[material]]) * np.array([[1.0], [0.8], [1.1]])
    law = StripLaw(
        materials()[material], films, rig, across=np.linspace(1.1, 1.3, 7) if rig.name == "biaxial" else None
    )
    d = rig.length * (np.linspace(0.98, 1.5, 7) - 1)
    shared, own = law(np.broadcast_to(d, (3, 7))), law(np.tile(d, (3, 1)))
    for a, b in zip(shared, own, strict=True):
        assert a.shape == (3, 7)
        np.testing.assert_array_equal(a, b)
    curves = strip_curves(law, d, sensitivities=True)
    assert {getattr(curves, f.name).shape for f in fields(curves)} == {(3, 7), (3, 7, films.shape[1])}
    np.testing.assert_array_equal(curves.force, own[0])
    np.testing.assert_array_equal(strip_margins(law, d), (curves.convexity, curves.ellipticity))
    alone = strip_curves(replace(law, parameters=films[1:2]), d)
    np.testing.assert_array_equal(alone.energy[0], curves.energy[1])
    np.testing.assert_array_equal(alone.max_stretch[0], curves.max_stretch[1])


# ---- films held across -----------------------------------------------------------------------------------------------


def biaxial(l1: np.ndarray, l2: np.ndarray, p1: np.ndarray, p2: np.ndarray) -> Measurement:
    """Both stretches, and both nominal stresses in Pa of a film 1 mm thick."""
    rig = Biaxial()
    found = rig.from_columns(dict(zip(rig.columns, (l1, l2, p1, p2), strict=True)), 1e-3)
    return Measurement(found["deflection"], found["force"], rig, Specimen("rubber", 1e-3), across=found["across"])


def stresses(m: Measurement, material: str) -> np.ndarray:
    """(2, n) nominal stress in Pa along both directions."""
    force = Forward(hypothesis(material), m, m.deflection).film_force(np.array([FILMS[material]]))[0]
    return force.reshape(2, -1) / (m.rig.lengths["width"] * 1e-3)


@pytest.mark.parametrize("material", FILMS)
def test_a_film_held_across_is_taut_below_rest(material: str) -> None:
    """Down to l2 = l1^-1/2 both stresses are the slopes of the energy, though l2 is below 1."""
    l1 = np.array([1.3, 1.3, 2.0, 2.0, 3.0])
    l2 = np.array([0.99, 0.89, 0.95, 0.72, 0.6])
    film = materials()[material](*FILMS[material])
    tension = np.array(film.tension(l1, l2))
    assert np.all(tension > 0)
    found = stresses(biaxial(l1, l2, 1e6 + 0 * l1, 1e5 + 0 * l1), material)
    assert found == pytest.approx(tension / 1e-3, rel=1e-12)
    swapped = stresses(biaxial(l2, l1, 1e5 + 0 * l1, 1e6 + 0 * l1), material)
    assert swapped[::-1] == pytest.approx(found, rel=1e-12)


@pytest.mark.parametrize("material", FILMS)
def test_a_film_narrower_than_a_free_strip_wrinkles(material: str) -> None:
    """Across nothing, along the stress of a strip with free sides; below rest both ways nothing at all."""
    l1 = np.array([1.3, 2.0, 2.0, 0.99, 0.8])
    l2 = np.array([0.8, 0.6, 0.2, 0.99, 0.95])
    m = biaxial(l1, l2, 1e6 + 0 * l1, 0 * l1)
    found = stresses(m, material)
    film = materials()[material](*FILMS[material])
    free = np.asarray(film.tension(l1[:3], l1[:3] ** -0.5))[0] / 1e-3
    assert found[0, :3] == pytest.approx(free, rel=1e-12)
    assert np.all(found[0, 3:] == 0)
    assert np.all(found[1] == 0)
    curves = Forward(hypothesis(material), m, m.deflection).curves(np.array([FILMS[material]]), m.deflection, True)
    assert curves.note[0].tolist() == 2 * [*(3 * [Note.WRINKLED]), Note.SLACK, Note.SLACK]
    assert np.all(curves.sensitivity[0, 5:] == 0)
    assert np.all(curves.ok)


@pytest.mark.parametrize("material", FILMS)
def test_stress_is_continuous_and_its_slope_right_where_a_film_becomes_taut(material: str) -> None:
    stretch = np.linspace(0.5, 1.5, 401)
    for across in (0.7, 1.0, 1.5):
        law = StripLaw(materials()[material], np.array([FILMS[material]]), Biaxial(), across=np.full(401, across))
        force, slope = law(law.rig.length * (stretch - 1)[None])
        assert np.all(force >= 0)
        assert np.max(np.abs(np.diff(force))) < 0.05 * np.max(force)
        numeric = np.gradient(force[0], law.rig.length * stretch)
        smooth = np.abs(stretch - max(across, 1.0) ** -0.5) > 0.01
        smooth &= np.abs(stretch - across**-2.0) > 0.01
        assert slope[0][smooth] == pytest.approx(numeric[smooth], rel=2e-2, abs=2e-3 * np.max(slope))


def test_a_block_pushes_back_in_a_biaxial_test_too_and_noise_about_zero_is_no_push() -> None:
    l1, l2 = np.array([2.0, 1.5]), np.array([0.6, 0.7])
    film = materials()["neo_hookean"](*FILMS["neo_hookean"])
    p1, p2 = np.asarray(film.tension(l1, l2)) / 1e-3
    assert np.all(p2 < 0)
    assert stresses(biaxial(l1, l2, p1, p2), "neo_hookean") == pytest.approx(np.array([p1, p2]), rel=1e-12)
    assert np.all(stresses(biaxial(l1, l2, p1, -1e-3 * p1), "neo_hookean")[1] == 0)


@needs_data
def test_every_taut_reading_of_kawabata_is_computed() -> None:
    """All his readings lie on the taut side, up to the rounding of the stretches; Ogden fits them to 10 kPa."""
    l1, l2, p1, p2 = np.genfromtxt(DATA / "Kawabata_1981_biaxial_full.csv", delimiter=",", skip_header=1).T
    m = biaxial(l1, l2, 1e6 * p1, 1e6 * p2)
    for material in FILMS:
        found = stresses(m, material)
        assert np.all(found[0] > 0)
        pulled = p2 > 0
        assert np.all(found[1][pulled] > 0)
        assert np.count_nonzero(pulled & (l2 < 1)) == 22
        film = materials()[material](*FILMS[material])
        direct = np.asarray(film.tension(l1, l2)) / 1e-3
        taut = l2 > l1**-0.5
        assert found[:, taut] == pytest.approx(direct[:, taut], rel=1e-12)
    ogden = fit(m, hypothesis("ogden", convexity="none"))
    assert ogden.rmse_N / (m.rig.lengths["width"] * 1e-3) < 1e4


# ---- noise and signs in files ----------------------------------------------------------------------------------------


class Files:
    """A curve and a specimen file of a strip 5 mm wide and 0.2 mm thick: 1 MPa is 1 N."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def read(self, curve: str, kind: str = "uniaxial", noise: str = "") -> Measurement:
        (self.folder / "c.csv").write_text(curve)
        rig = f'[specimen]\nthickness_um = 200\n[rig]\nkind = "{kind}"\nwidth_mm = 5\n'
        (self.folder / "c.toml").write_text(rig + (f"[measurement]\n{noise}\n" if noise else ""))
        return read_measurement(self.folder / "c.csv", self.folder / "c.toml")

    def fault(self, *arguments: str) -> str:
        with pytest.raises(DataError) as caught:
            self.read(*arguments)
        return str(caught.value).replace(f"{self.folder}/", "")


@pytest.fixture
def files(tmp_path: Path) -> Files:
    return Files(tmp_path)


PULLED = "stretch,nominal_stress_MPa\n1.1,0.2\n1.2,0.3\n1.4,0.5\n"
BOTH = "stretch_1,stretch_2,nominal_stress_1_MPa,nominal_stress_2_MPa"


def with_column(name: str, values: tuple[float, ...] = (1, 2, 3)) -> str:
    head, *rows = PULLED.splitlines()
    return "\n".join([f"{head},{name}", *(f"{r},{v}" for r, v in zip(rows, values, strict=True))]) + "\n"


@pytest.mark.parametrize(
    ("name", "scale"),
    [("nominal_stress_sd_MPa", 1.0), ("nominal_stress_sd_kPa", 1e-3), ("nominal_stress_sd_psi", 6894.757e-6)],
)
@pytest.mark.parametrize("kind", STRIPS)
def test_noise_may_be_stated_in_stress(files: Files, kind: str, name: str, scale: float) -> None:
    column = files.read(with_column(name), kind)
    assert column.force_sd == pytest.approx(scale * np.array([1, 2, 3]), rel=1e-6)
    assert column.provenance.notes == ()
    single = files.read(PULLED, kind, f"{name} = 4")
    assert single.force_sd == pytest.approx(4 * scale * np.ones(3), rel=1e-6)
    newton = files.read(with_column("force_sd_mN"), kind)
    assert newton.force_sd == pytest.approx([1e-3, 2e-3, 3e-3], rel=1e-9)


def test_noise_of_a_biaxial_test_is_stated_for_both_directions_or_for_each(files: Files) -> None:
    rows = ("1.1,1,0.2,0.1", "1.3,1.1,0.3,0.2")
    each = f"{BOTH},nominal_stress_1_sd_MPa,nominal_stress_2_sd_kPa\n{rows[0]},0.01,20\n{rows[1]},0.03,40\n"
    m = files.read(each, "biaxial")
    assert m.force_sd == pytest.approx([0.01, 0.03, 0.02, 0.04])
    write_measurement(m, files.folder / "d.csv", files.folder / "d.toml")
    assert read_measurement(files.folder / "d.csv", files.folder / "d.toml").force_sd == pytest.approx(m.force_sd)
    one = files.read(f"{BOTH},nominal_stress_sd_MPa\n{rows[0]},0.01\n{rows[1]},0.03\n", "biaxial")
    assert one.force_sd == pytest.approx([0.01, 0.03, 0.01, 0.03])
    single = files.read(f"{BOTH}\n{rows[0]}\n{rows[1]}\n", "biaxial", "nominal_stress_sd_kPa = 5")
    assert single.force_sd == pytest.approx(4 * [0.005])
    half = f"{BOTH},nominal_stress_2_sd_kPa\n{rows[0]},20\n{rows[1]},40\n"
    assert "nominal_stress_2_sd states the noise of one direction alone" in files.fault(half, "biaxial")
    three = each.replace("sd_kPa\n", "sd_kPa,force_sd_N\n").replace(",20\n", ",20,1\n").replace(",40\n", ",40,1\n")
    assert "both give the noise" in files.fault(three, "biaxial")


@pytest.mark.parametrize(
    ("curve", "noise", "said"),
    [
        (with_column("nominal_stress_sd_N"), "", '"N" is a unit of force, not of stress'),
        (with_column("nominal_stress_sd"), "", 'the column "nominal_stress_sd" names no unit'),
        (with_column("nominal_stress_sd_MPa", (1, 0, 1)), "", "line 3: the standard deviation of the force must be"),
        (with_column("nominal_stress_sd_MPa"), "nominal_stress_sd_MPa = 1", "both give the noise"),
        (with_column("nominal_stress_sd_MPa,force_sd_N").replace(",1\n", ",1,1\n").replace(",2\n", ",2,2\n")
         .replace(",3\n", ",3,3\n"), "", "both give the noise"),
        (PULLED, "nominal_stress_sd_MPa = 1\nforce_sd_N = 1", "both give the noise"),
        (PULLED, "nominal_stress_sd_MPa = 0", "must be positive"),
        (PULLED, "nominal_stress_sd_N = 1", '"N" is a unit of force, not of stress'),
    ],
)  # fmt: skip
def test_a_fault_of_the_stated_noise_is_one_sentence(files: Files, curve: str, noise: str, said: str) -> None:
    assert said in files.fault(curve, "uniaxial", noise)


def test_readings_of_a_wrinkled_film_are_noted(files: Files) -> None:
    """Those below l2 = l1^-1/2, and no others: neither taut ones below 1 nor what rounding puts on the border."""
    rows = "1.5,0.9,0.2,0.1\n1.5,0.816,0.2,0\n1.5,0.7,0.2,0\n0.99,0.98,0,0\n"
    m = files.read(f"{BOTH}\n{rows}", "biaxial")
    assert m.provenance.notes == ("3 of 8 readings lie where a film is slack or wrinkled, and carries nothing",)
    assert files.read(f"{BOTH}\n1.5,0.9,0.2,0.1\n1.2,1.2,0.2,0.1\n", "biaxial").provenance.notes == ()


def test_a_column_that_nobody_reads_is_noted(files: Files) -> None:
    m = files.read(with_column("nominal_stress_std_MPa"))
    assert m.force_sd is None
    assert m.provenance.notes == ("ignored columns: nominal_stress_std_MPa",)


def compressed(stretch: np.ndarray, sign: float = 1.0) -> str:
    stress = sign * 0.4 * (stretch - stretch**-2.0)
    rows = "".join(f"{x:.6g},{s:.6g}\n" for x, s in zip(stretch, stress, strict=True))
    return "stretch,nominal_stress_MPa\n" + rows


def test_an_order_that_no_press_has_is_refused(files: Files) -> None:
    said = files.fault(compressed(np.linspace(0.5, 0.98, 9)))
    assert "the stretch rises from the first line on" in said
    assert "from a stretch of 1 down" in said


@pytest.mark.parametrize(
    ("kind", "low", "high"), [("uniaxial", 0.5, 1.2), ("uniaxial", 0.7, 2.0), ("planar", 0.6, 1.1)]
)
def test_a_block_that_was_pushed_and_pulled_is_fitted_as_it_is(
    files: Files, kind: str, low: float, high: float
) -> None:
    """Though most readings push: the modulus comes from both sides."""
    m = files.read(compressed(np.linspace(low, high, 21)), kind)
    found = fit(m, hypothesis("neo_hookean"))
    if kind == "uniaxial":
        assert found.parameters["neo_hookean.c1"].value == pytest.approx(0.2e6 * 200e-6, rel=1e-5)
        assert found.rmse_N < 1e-5 * np.max(m.force)
    assert np.all(Forward(found.hypothesis, m, m.deflection)(found.coordinates).force[0][:5] < 0)


def test_signs_that_contradict_each_other_are_refused(files: Files) -> None:
    for stretch in (np.linspace(1.05, 2, 9), np.linspace(0.5, 0.95, 9), np.linspace(0.5, 1.3, 9)):
        said = files.fault(compressed(stretch, -1.0))
        assert "the stress is negative above a stretch of 1 or positive below it" in said
    rows = "1.2,1.1,-0.2,-0.1\n1.3,1.1,-0.3,-0.2\n"
    assert "the stress is negative above a stretch of 1" in files.fault(f"{BOTH}\n{rows}", "biaxial")


@needs_data
def test_a_published_test_in_both_directions_is_read(files: Files) -> None:
    stress, stretch = np.loadtxt(DATA / "Meunier_2008_UT.txt").T
    rows = "".join(f"{x},{s}\n" for x, s in zip(stretch, stress, strict=True))
    m = files.read("stretch,nominal_stress_MPa\n" + rows)
    found = fit(m, hypothesis("yeoh", convexity="none"))
    assert found.rmse_N < 0.1 * np.max(m.force)
    part = m.select(m.deflection < 0)
    force = Forward(found.hypothesis, part, part.deflection)(found.coordinates).force[0]
    assert np.corrcoef(force, part.force)[0, 1] > 0.99


@pytest.mark.parametrize(
    ("low", "high", "side", "said"),
    [
        (0.5, 2.5, -1, "line 2: every stress below a stretch of 1, where the specimen is pressed, is positive"),
        (0.3, 1.3, 1, "line 13: every stress above a stretch of 1, where the specimen is pulled, is negative"),
    ],
)
def test_a_side_with_the_wrong_sign_is_refused(files: Files, low: float, high: float, side: int, said: str) -> None:
    """Though on the other side, where most of the readings lie, all is well."""
    stretch = np.append(np.linspace(low, 0.95, 11), np.linspace(1.05, high, 11 - side * 3))
    stress = 0.4 * (stretch - stretch**-2.0) * np.where(side * (stretch - 1) > 0, -1, 1)
    rows = "".join(f"{x:.6g},{s:.6g}\n" for x, s in zip(stretch, stress, strict=True))
    assert said in files.fault("stretch,nominal_stress_MPa\n" + rows)


def test_a_zero_that_is_off_is_no_wrong_sign(files: Files) -> None:
    m = files.read("stretch,nominal_stress_MPa\n0.97,0.02\n0.99,0.05\n1.2,0.3\n1.6,0.5\n")
    assert m.force[0] > 0


@pytest.mark.parametrize(
    ("kind", "curve", "said"),
    [
        ("shear", "shear,shear_stress_MPa\n0,0\n1,0.4\n1,0.4\n2,0.7\n", "line 4: the shear 1 stands there twice"),
        ("uniaxial", PULLED + "1.4,0.5\n", "line 5: the stretch 1.4 stands there twice"),
        (
            "uniaxial",
            PULLED + "1.3,0.4\n1.5,0.6\n1.6,0.7\n",
            "line 5: the stretch is not in order (1.3 after 1.4); sort",
        ),
        (
            "compression",
            "stretch,nominal_stress_MPa\n0.9,-0.1\n0.8,-0.2\n0.8,-0.2\n",
            "line 4: the compression to a stretch of 0.8 stands there twice",
        ),
    ],
)
def test_an_order_that_no_test_has_is_told_as_the_file_has_it(files: Files, kind: str, curve: str, said: str) -> None:
    assert said in files.fault(curve, kind)


UP_AND_DOWN = [*np.linspace(1.0, 1.5, 11), *np.linspace(1.45, 1.0, 10)]


def labelled(column: str, values: list[int]) -> str:
    rows = zip(UP_AND_DOWN, values, strict=True)
    return f"stretch,nominal_stress_MPa,{column}\n" + "".join(f"{x:.6g},{x - 1:.6g},{v}\n" for x, v in rows)


def test_a_direction_against_the_motion_is_noted(files: Files) -> None:
    said = [1] * 11 + [-1] * 10
    assert files.read(labelled("direction", said)).provenance.notes == ()
    m = files.read(labelled("direction", [-s for s in said]))
    assert "the column direction contradicts the motion in 21 of 21 rows" in m.provenance.notes[0]
    assert m.leg.tolist() == [-s for s in said]


@pytest.mark.parametrize(
    ("cycle", "said"),
    [
        ([3] * 10 + [2] * 11, "line 2, column cycle: the cycles begin with 3, and 2 follows in line 12; write 1, 2, 3"),
        ([1] * 8 + [2] * 2 + [1] * 11, "line 12, column cycle: cycle 1 comes after cycle 2; write 1, 2, 3"),
        ([1] * 20 + [0], "line 22, column cycle: 0 is no cycle"),
    ],
)
def test_cycles_that_fall_are_blamed_where_the_wrong_one_stands(files: Files, cycle: list[int], said: str) -> None:
    assert said in files.fault(labelled("cycle", cycle))
