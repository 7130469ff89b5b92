"""Homogeneous tests: closed forms against the energy, published data, and files."""

from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.calibration.fit import fit
from bayesmembrane.data.measurement import Measurement, Specimen, read_measurement, write_measurement
from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.registry import components, materials
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics.strip_law import StripLaw
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
