"""Traced contours: shapes of an independent solver, files, and one calibration of force and contour together."""

from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.calibration.fit import fit
from bayesmembrane.calibration.joint.claim import joint
from bayesmembrane.calibration.joint.fit import fit_jointly
from bayesmembrane.calibration.joint.posterior import JointPosterior
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.data.writing import write_measurement
from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.registry import material
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.materials.mooney_rivlin import MooneyRivlin
from bayesmembrane.physics.mechanics.profile import profile
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.physics.rigs.contour import Contour
from tests.physics.mechanics.films import INNER, MM, OUTER, silicone
from tests.reference.slow_solver import contour, force_curve

LIFT = 35 * MM
RADIUS = np.linspace(11 * MM, 34 * MM, 24)


def traced(name: str, parameters: list[float], sd: float = 0.0, seed: int = 0, lift: float = LIFT) -> Measurement:
    """The contour of a film by collocation, with noise of ``sd`` m."""
    r, h = contour(material(name)(*parameters), lift, INNER, OUTER)
    neck = int(np.argmin(r))  # a Mooney-Rivlin film that is lifted far is narrowest below the disc
    height = np.interp(RADIUS, r[neck:], h[neck:]) + sd * np.random.default_rng(seed).standard_normal(RADIUS.size)
    stated = np.full(RADIUS.size, sd) if sd else None
    return Measurement(RADIUS, height, Contour(INNER, OUTER, lift), Specimen("film", 5e-5), force_sd=stated)


@pytest.mark.parametrize("name", ["neo_hookean", "mooney_rivlin", "gent", "yeoh", "ogden"])
@pytest.mark.parametrize("lift", [5 * MM, 60 * MM])
def test_heights_are_those_of_an_independent_solver(name: str, lift: float) -> None:
    film = list(map(float, silicone(material(name))))
    m, h = traced(name, film, lift=lift), hypothesis(name)
    found = Forward(h, m, m.deflection)(h.material.to_coordinates(film))
    assert np.all(found.ok)
    assert found.force[0] == pytest.approx(m.force, abs=3e-6 * lift)


def test_slopes_in_all_coordinates_are_differences_and_none_is_the_modulus() -> None:
    film = [6.0, 1.5]
    m, h = traced("mooney_rivlin", film), hypothesis("mooney_rivlin")
    x, f = h.material.to_coordinates(film), Forward(h, m, m.deflection)
    found = f(x, sensitivities=True)
    assert found.sensitivity is not None
    assert np.max(np.abs(found.sensitivity[0, :, 0])) < 1e-6 * LIFT
    step = np.array([0.0, 1e-3])
    numeric = (f(x + step).force - f(x - step).force)[0] / 2e-3
    assert found.sensitivity[0, :, 1] == pytest.approx(numeric, rel=1e-3, abs=1e-4 * np.max(np.abs(numeric)))


def test_a_film_that_hangs_over_itself_has_the_heights_seen_from_above() -> None:
    """Such a film reaches beyond its clamp, and comes back below."""
    lift, film = 900 * MM, [110478.0, -307.0]
    shape = profile(MooneyRivlin(*film), lift, inner_radius=INNER, outer_radius=OUTER)
    assert np.max(shape.f) > 1.5 * OUTER
    m = Measurement(RADIUS, 0 * RADIUS, Contour(INNER, OUTER, lift), Specimen("film", 5e-5))
    h = hypothesis("mooney_rivlin")
    found = Forward(h, m, m.deflection)(h.material.to_coordinates(film))
    assert np.all(found.ok)
    before = slice(int(np.argmax(shape.f)))
    assert found.force[0] == pytest.approx(np.interp(RADIUS, shape.f[before], shape.height[before]), abs=1e-3 * lift)


@pytest.mark.study
def test_force_and_contour_are_weighed_by_their_own_noise_alone() -> None:
    """ln p of both is the sum of both."""
    d = np.linspace(5 * MM, 35 * MM, 8)
    force = force_curve(material("mooney_rivlin")(6.0, 1.5), d, INNER, OUTER)
    curve = lifted(d, force)
    shape = traced("mooney_rivlin", [6.0, 1.5], 0.1 * MM)
    claim = joint({"force": curve, "shape": shape}, hypothesis("mooney_rivlin"))
    both = JointPosterior(claim)
    x = np.zeros((1, both.size))
    x[0, :2] = hypothesis("mooney_rivlin").material.to_coordinates([6.2, 1.2])
    x[0, 2:] = [p.prior.quantile(0.5) for p in claim.parameters[2:]]
    parts = sum(part.log_likelihood(claim.of(i, x)) for i, part in enumerate(both.parts))
    assert both.log_likelihood(x) == pytest.approx(parts, rel=1e-12)
    exact = joint({"force": curve, "shape": traced("mooney_rivlin", [6.0, 1.5])}, hypothesis("mooney_rivlin"))
    found = fit_jointly(exact)
    assert found.values[:2] == pytest.approx([6.0, 1.5], rel=2e-3)


def lifted(d: np.ndarray, force: np.ndarray) -> Measurement:
    sd = np.full(d.size, 0.002 * float(np.max(force)))
    return Measurement(d, force, Annulus(INNER, OUTER), Specimen("film", 5e-5), force_sd=sd)


@pytest.mark.study
def test_a_contour_alone_says_how_the_energy_is_shaped() -> None:
    found = fit(traced("mooney_rivlin", [6.0, 1.5]), hypothesis("mooney_rivlin"))
    c1, c2 = (found.parameters[f"mooney_rivlin.{n}"].value for n in ("c1", "c2"))
    assert c2 / c1 == pytest.approx(0.25, rel=1e-2)


# ---- files -----------------------------------------------------------------------------------------------------------

TOML = '[specimen]\nname = "shape"\nthickness_um = 50\n[rig]\nkind = "contour"\ninner_radius_mm = 10\n'
TOML += "outer_radius_mm = 35\nlift_mm = 35\n[measurement]\nheight_sd_mm = 0.1\n"


def test_files_come_back(tmp_path: Path) -> None:
    m = traced("neo_hookean", [7.5], 0.1 * MM)
    write_measurement(m, tmp_path / "c.csv", tmp_path / "c.toml")
    assert (tmp_path / "c.csv").read_text().startswith("radius_mm,height_mm,height_sd_mm\n")
    again = read_measurement(tmp_path / "c.csv", tmp_path / "c.toml")
    assert again.rig == m.rig
    for name in ("deflection", "force", "force_sd"):
        assert getattr(again, name) == pytest.approx(getattr(m, name), rel=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("height_sd_mm", "force_sd_N", "known: covariance, height_sd_mm, origin"),
        ("lift_mm = 35\n", "", "the key lift_mm is missing; add it with its value, as in lift_mm = 30"),
        ("lift_mm = 35", "lift_cm = 0", "lift_cm must be a positive length, and 0 cm is not"),
    ],
)
def test_a_fault_of_the_specimen_file_is_told_by_its_own_keys(tmp_path: Path, old: str, new: str, said: str) -> None:
    (tmp_path / "c.csv").write_text("radius_mm,height_mm\n12,20\n13,19\n")
    (tmp_path / "c.toml").write_text(TOML.replace(old, new))
    with pytest.raises(DataError) as caught:
        read_measurement(tmp_path / "c.csv", tmp_path / "c.toml")
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("5,30\n12,20\n", "line 2: a radius of 5 mm is not on the film between 10 and 35 mm"),
        ("12,20\n13,60\n", "line 3: a height of 60 mm lies outside of clamp and disc"),
        ("12,-20\n13,-10\n", "count heights from the clamp, positive towards the disc"),
    ],
)
def test_what_is_no_contour_is_one_sentence(tmp_path: Path, rows: str, said: str) -> None:
    (tmp_path / "c.csv").write_text("radius_mm,height_mm\n" + rows)
    (tmp_path / "c.toml").write_text(TOML)
    with pytest.raises(DataError) as caught:
        read_measurement(tmp_path / "c.csv", tmp_path / "c.toml")
    assert said in str(caught.value)
