"""Compression and simple shear: closed forms from the textbook, differences of the energy, files and their signs."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.calibration.fit import fit
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.data.writing import write_measurement
from bayesmembrane.ground.errors import BayesmembraneError, DataError
from bayesmembrane.ground.registry import components, materials
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.base import Films, Trial, rig_of
from tests.data.exports.test_layouts import imported, lines

C1, C2 = 150.0, 40.0
OGDEN = [200.0, 2.0, -8.0, 1.5, 4.8, -1.2]
D = 1e-3  # thickness, m
STRETCH = np.linspace(0.98, 0.35, 20)
SHEAR = np.linspace(0.02, 1.8, 20)
# Nominal stress of a Mooney-Rivlin solid, dW/dl of W(l, l2(l), 1 / (l l2)) by hand (equibiaxial: half of it).
PRESSED: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "compression": lambda x: 2 * (x - x**-2) * (C1 + C2 / x),
    "planar_compression": lambda x: 2 * (C1 + C2) * (x - x**-3),
    "equibiaxial_compression": lambda x: 2 * (x - x**-5) * (C1 + C2 * x**2),
}
LATERAL = {"compression": -0.5, "planar_compression": 0.0, "equibiaxial_compression": 1.0}


def on(kind: str, deflection: np.ndarray, force: np.ndarray | None = None) -> Measurement:
    rig = components("rigs")[kind]()
    return Measurement(deflection, np.ones_like(deflection) if force is None else force, rig, Specimen("block", D))


def pressed(kind: str, stretch: np.ndarray = STRETCH) -> Measurement:
    return on(kind, components("rigs")[kind]().length * (1 - stretch))


def forces(m: Measurement, material: str, film: list[float]) -> np.ndarray:
    return Forward(hypothesis(material), m, m.deflection).film_force(np.array([film]))[0]


@pytest.mark.parametrize("kind", PRESSED)
def test_a_block_pushes_back_as_the_closed_form_says(kind: str) -> None:
    m = pressed(kind)
    assert forces(m, "mooney_rivlin", [C1, C2]) == pytest.approx(-m.rig.width * PRESSED[kind](STRETCH), rel=1e-12)


def test_shear_of_neo_hookean_and_mooney_rivlin_solids_is_linear() -> None:
    """tau = 2 (c1 + c2) g (Mooney 1940), with either sign of g."""
    shear = np.concatenate([SHEAR, -SHEAR])
    m = on("shear", 0.05 * shear)
    assert forces(m, "neo_hookean", [C1]) == pytest.approx(m.rig.width * 2 * C1 * shear, rel=1e-12)
    assert forces(m, "mooney_rivlin", [C1, C2]) == pytest.approx(m.rig.width * 2 * (C1 + C2) * shear, rel=1e-12)


def ogden(*stretches: np.ndarray) -> np.ndarray:
    """sum_i c_i / a_i (sum of l^a_i - 3): with the factor that the package's constants have, found at small strain."""
    c, a = OGDEN[:3], OGDEN[3:]
    return sum(ci / ai * (sum(x**ai for x in stretches) - 3) for ci, ai in zip(c, a, strict=True))


def test_an_ogden_solid_is_the_slope_of_its_energy() -> None:
    film = materials()["ogden"](*OGDEN)
    one = np.array([1.3])
    factor = float(film.energy(one, one**-0.5)[0] / ogden(one, one**-0.5, one**-0.5)[0])
    h = 1e-5
    for kind, power in LATERAL.items():
        m = pressed(kind)

        def energy(x: np.ndarray, power: float = power) -> np.ndarray:
            return factor * ogden(x, x**power, x ** (-1 - power))

        pairs = 2.0 if kind == "equibiaxial_compression" else 1.0
        numeric = -(energy(STRETCH + h) - energy(STRETCH - h)) / (2 * h) / pairs
        assert forces(m, "ogden", OGDEN) == pytest.approx(m.rig.width * numeric, rel=1e-6)

    def sheared(g: np.ndarray) -> np.ndarray:
        root = np.sqrt(np.linalg.eigvalsh(np.array([[[1 + x * x, x], [x, 1.0]] for x in g])))
        return factor * ogden(root[:, 0], root[:, 1], np.ones(g.size))

    m = on("shear", 0.05 * SHEAR)
    numeric = (sheared(SHEAR + h) - sheared(SHEAR - h)) / (2 * h)
    assert forces(m, "ogden", OGDEN) == pytest.approx(m.rig.width * numeric, rel=1e-6)


@pytest.mark.parametrize("kind", [*PRESSED, "shear"])
@pytest.mark.parametrize("material", ["gent", "yeoh", "ogden"])
def test_sensitivities_and_slopes_are_differences(kind: str, material: str) -> None:
    m = on("shear", 0.05 * SHEAR) if kind == "shear" else pressed(kind)
    h = hypothesis(material)
    x = materials()[material].to_coordinates(materials()[material].typical())
    f = Forward(h, m, m.deflection)
    p = f(x, sensitivities=True)
    assert np.all(p.force > 0)
    assert p.sensitivity is not None
    for i in range(x.size):
        step = 1e-4 * np.eye(x.size)[i]
        numeric = (f(x + step).force - f(x - step).force) / 2e-4
        assert p.sensitivity[:, :, i] == pytest.approx(numeric, rel=1e-4, abs=1e-6 * np.max(p.force))
    curves = f.curves(h.films(x), m.deflection, sensitivities=True)
    assert curves.force == pytest.approx(p.force, rel=1e-12)
    chained = np.einsum("bni,bik->bnk", curves.sensitivity, f.jacobian(x[None]))
    assert chained == pytest.approx(p.sensitivity, rel=1e-4, abs=1e-6 * np.max(p.force))


def test_plates_do_not_pull_and_nothing_is_pressed_flat() -> None:
    m = on("compression", np.array([-0.001, 0.0, 0.01, 0.0499, 0.06]))
    h = hypothesis("neo_hookean")
    found = Forward(h, m, m.deflection)(h.material.to_coordinates([C1]))
    assert np.all(found.force[0, :2] == 0)
    assert found.force[0, 2] > 0
    assert np.isnan(found.force[0, 3:]).all()
    law, _ = rig_of(m).law(*_asked(m))
    moved = law(np.array([[0.01]]), np.array([[0.04]]))[0]
    stretch = 0.8 / 0.96  # shorter by 4 % for good
    assert moved == pytest.approx(-m.rig.width * 2 * C1 * (stretch - stretch**-2), rel=1e-12)


def _asked(m: Measurement) -> tuple[Films, Trial]:
    return Films(materials()["neo_hookean"], np.array([[C1]])), Trial(m, m.path)


# ---- files -----------------------------------------------------------------------------------------------------------

PUSH = 1e-6 * -PRESSED["compression"](STRETCH) / D  # MPa


def written(folder: Path, kind: str, stretch: np.ndarray, stress: np.ndarray, header: str = "") -> Measurement:
    rows = "".join(f"{x:.12g},{s:.12g}\n" for x, s in zip(stretch, stress, strict=True))
    (folder / "c.csv").write_text((header or "stretch,nominal_stress_MPa") + "\n" + rows)
    (folder / "c.toml").write_text(f'[specimen]\nthickness_um = 1000\n[rig]\nkind = "{kind}"\nlength_mm = 20\n')
    return read_measurement(folder / "c.csv", folder / "c.toml")


def test_compression_is_read_whatever_its_sign(tmp_path: Path) -> None:
    """As uniaxial with a stress that pushes, or as compression with either sign: the same measurement."""
    found = [
        written(tmp_path, "uniaxial", STRETCH, -PUSH),
        written(tmp_path, "compression", STRETCH, -PUSH),
        written(tmp_path, "compression", STRETCH, PUSH),
    ]
    for m in found:
        assert m.rig.name == "compression"
        assert m.data_hash == found[0].data_hash
        assert np.all(m.force > 0)
        assert m.full_range == pytest.approx(0.02 * 0.65)
        assert np.all(m.leg == 1)
        assert "a stress that pushes counts as positive" in m.provenance.notes[-1]
    assert written(tmp_path, "planar", STRETCH, -PUSH).rig.name == "planar_compression"
    assert written(tmp_path, "equibiaxial", STRETCH, -PUSH).rig.name == "equibiaxial_compression"


def test_what_is_fitted_is_what_was_pressed_and_sheared(tmp_path: Path) -> None:
    h = hypothesis("mooney_rivlin", convexity="none")
    found = fit(written(tmp_path, "uniaxial", STRETCH, -PUSH), h)
    assert found.parameters["mooney_rivlin.c1"].value == pytest.approx(C1, rel=1e-5)
    assert found.parameters["mooney_rivlin.c2"].value == pytest.approx(C2, rel=1e-4)
    m = written(tmp_path, "shear", SHEAR, 1e-6 * 2 * C1 * SHEAR / D, "shear,shear_stress_MPa")
    assert fit(m, hypothesis("neo_hookean")).parameters["neo_hookean.c1"].value == pytest.approx(C1, rel=1e-6)


@pytest.mark.parametrize("kind", ["compression", "shear"])
def test_files_come_back_as_they_were(kind: str, tmp_path: Path) -> None:
    m = pressed(kind) if kind == "compression" else on("shear", 0.05 * SHEAR)
    write_measurement(m, tmp_path / "d.csv", tmp_path / "d.toml")
    again = read_measurement(tmp_path / "d.csv", tmp_path / "d.toml")
    assert again.rig == m.rig
    assert again.deflection == pytest.approx(m.deflection, rel=1e-12)
    assert again.force == pytest.approx(m.force, rel=1e-12)


def test_what_no_press_gives_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(DataError, match='say kind = "compression" if it is positive where it pushes'):
        written(tmp_path, "uniaxial", STRETCH, PUSH)
    with pytest.raises(DataError, match="what is pressed has stretches below 1"):
        written(tmp_path, "compression", 2 - STRETCH, PUSH)
    with pytest.raises(DataError, match=r"a stretch of -0\.2 cannot be"):
        written(tmp_path, "compression", STRETCH - 0.55, PUSH)
    with pytest.raises(DataError, match="at most points the stress is against the shear"):
        written(tmp_path, "shear", SHEAR, -SHEAR, "shear,shear_stress_MPa")
    both = np.linspace(-1.5, 1.8, 24)
    with pytest.raises(DataError, match="line 2: every stress of a negative shear is against it"):
        written(tmp_path, "shear", both, np.abs(both), "shear,shear_stress_MPa")
    assert len(written(tmp_path, "shear", both, both, "shear,shear_stress_MPa")) == both.size
    with pytest.raises(DataError, match="change the signs of shear and stress"):
        written(tmp_path, "shear", -SHEAR, -SHEAR, "shear,shear_stress_MPa")


def test_exports_of_a_press_are_read_with_either_sign() -> None:
    travel, force = np.linspace(0, 8, 25), 100 * np.linspace(0, 1, 25) ** 1.2
    said = {"rig": "compression", "gauge_length": 0.02, "width": 0.01, "thickness": 0.01}
    found = [
        imported(lines("Time (s),Extension (mm),Load (N)", np.arange(25.0), a * travel, b * force).encode(), **said)
        for a in (1, -1)
        for b in (1, -1)
    ]
    for one in found:
        assert one.columns["stretch"] == pytest.approx(1 - travel / 20, abs=1e-7)
        assert np.abs(one.columns["nominal_stress"]) == pytest.approx(force / 1e-4, rel=1e-6)
    with pytest.raises(BayesmembraneError, match="bring shear and shear_stress as CSV"):
        imported(lines("Time (s),Extension (mm),Load (N)", np.arange(25.0), travel, force).encode(), rig="shear")


@pytest.mark.parametrize("kind", ["compression", "shear"])
def test_a_block_may_be_thicker_than_any_film(tmp_path: Path, kind: str) -> None:
    names = {"compression": "stretch,nominal_stress_MPa", "shear": "shear,shear_stress_MPa"}[kind]
    rows = {"compression": "0.9,-0.1\n0.8,-0.25\n", "shear": "0.1,0.04\n0.2,0.08\n"}[kind]
    curve, film = tmp_path / "c.csv", tmp_path / "c.toml"
    curve.write_text(f"{names}\n{rows}")
    film.write_text(f'[specimen]\nthickness_mm = 29\n[rig]\nkind = "{kind}"\nlength_mm = 12.5\nwidth_mm = 29\n')
    assert read_measurement(curve, film).specimen.thickness == pytest.approx(0.029)
    film.write_text(film.read_text().replace("thickness_mm = 29", "thickness_mm = 290"))
    with pytest.raises(DataError, match="290 mm thick looks like a wrong unit"):
        read_measurement(curve, film)
