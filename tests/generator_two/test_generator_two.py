"""The second generator: its film against the reference forces, its faults, its noise, and that it knows nobody."""

import ast
from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.data.reading import read_measurement
from bayesmembrane.ground.registry import materials, ordinary_materials
from tests.generator_two.course import Way, course
from tests.generator_two.datasets import generate
from tests.generator_two.elastic import COMMON, ELASTIC
from tests.generator_two.faults import EFFECTS, FAULTS, FOREIGN, Done, Trial
from tests.generator_two.membrane import LockedError, Membrane
from tests.generator_two.scatter import Scatter

FOLDER = Path(__file__).parent
INNER, OUTER = 0.010, 0.035
AT = np.array([0.5, 2.0, 5.0, 10.0, 20.0, 35.1, 60.0, 91.5]) * 1e-3
# Two solvers, neither of them this one, agree on these (N); the last column is the pre-stretch.
REFERENCE = (
    ("neo_hookean", (7.5,), 1.0, "3.11351e-05 0.00197445 0.0293379 0.19882 0.95419 2.3151 4.3786 6.83061"),
    (
        *("mooney_rivlin", (6.21436, 1.4703426), 1.0),
        "3.19017e-05 0.0020229 0.0300446 0.203356 0.973959 2.34886 4.31855 6.47332",
    ),
    ("gent", (5.312, 17.42), 1.0, "2.2052e-05 0.00139844 0.020781 0.141017 0.688575 1.82753 4.64874 18.7046"),
    (
        *("yeoh", (8.840838, -0.6303258, 0.05632747), 1.0),
        "3.67014e-05 0.00232743 0.0345747 0.233541 1.07159 2.25269 4.53009 18.6213",
    ),
    (
        *("ogden", (11.060008, 0.1959017, -0.3679535, 1.5196142, 5.805068, -1.1529809), 1.0),
        "1.90634e-05 0.00120888 0.0179599 0.121693 0.58786 1.56417 4.57207 18.0476",
    ),
    ("neo_hookean", (7.5,), 1.03, "0.00614218 0.0262679 0.0870964 0.292408 1.04611 2.36642 4.39977 6.83908"),
)


def trial(stretch: float = 1.0) -> Trial:
    film = Membrane("gent", (6.0, 30.0), INNER, OUTER, 0.045, stretch)
    ways = [Way(0.02, 1e-3), Way(0.0, 1e-3), Way(0.04, 1e-3, 30.0), Way(0.0, 1e-3), Way(0.04, 5e-3), Way(0.0, 5e-3)]
    return Trial(film, course("c", ways, 300, np.random.default_rng(1)))


# ---- independence ----------------------------------------------------------------------------------------------------


def test_it_shares_nothing_with_the_first_generator_and_the_package() -> None:
    files = [f for f in FOLDER.glob("*.py") if not f.name.startswith("test_")]
    assert len(files) > 4
    for file in files:
        nodes = list(ast.walk(ast.parse(file.read_text())))
        names = {a.name for n in nodes if isinstance(n, ast.Import) for a in n.names}
        names |= {n.module or "." for n in nodes if isinstance(n, ast.ImportFrom)}
        for name in names:
            assert name.startswith("tests.generator_two") or name.partition(".")[0] in {
                *("__future__", "collections", "dataclasses", "functools", "pathlib", "typing", "numpy", "scipy"),
            }, name
        assert "importlib" not in file.read_text()


def test_the_common_energies_are_those_of_the_package_by_name_and_order() -> None:
    for name in COMMON:
        assert materials()[name].field_names() == ELASTIC[name].names
    assert not set(ELASTIC) - set(COMMON) & set(ordinary_materials())


# ---- film ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("family", "constants", "stretch", "forces"), REFERENCE, ids=lambda v: str(v)[:14])
def test_forces_agree_with_the_reference_solutions(family, constants, stretch, forces) -> None:
    film = Membrane(family, constants, INNER, OUTER, 0.0915, stretch)
    grid = np.unique(np.concatenate([AT, np.linspace(1.0, 91.5, 50) * 1e-3]))
    found = film.forces(grid)[np.searchsorted(grid, AT)]
    np.testing.assert_allclose(found, [float(x) for x in forces.split()], rtol=5e-6)


@pytest.mark.parametrize("family", ELASTIC)
def test_the_spline_is_the_solution_and_more_points_change_nothing(family) -> None:
    constants = ELASTIC[family].draw(np.random.default_rng(4), 50e-6)
    film = Membrane(family, constants, 0.006, 0.050, 0.055)
    at = np.linspace(1.5, 54.5, 31) * 1e-3
    exact = Membrane(family, constants, 0.006, 0.050, 0.055, points=49).forces(at)
    np.testing.assert_allclose(film.forces(at), exact, rtol=1e-7)
    np.testing.assert_allclose(film.force(at), exact, rtol=2e-6)


@pytest.mark.parametrize("family", ELASTIC)
def test_tensions_are_slopes_of_one_energy(family) -> None:
    energy, rng = ELASTIC[family], np.random.default_rng(6)
    c = energy.draw(rng, 50e-6)
    a, b = rng.uniform(1.05, 1.8, (2, 30))
    e = 1e-6
    across = (energy.tensions(c, a, b + e)[0] - energy.tensions(c, a, b - e)[0]) / (2 * e)
    along = (energy.tensions(c, a + e, b)[1] - energy.tensions(c, a - e, b)[1]) / (2 * e)
    np.testing.assert_allclose(across, along, rtol=1e-6, atol=1e-6)
    rest = energy.tensions(c, np.ones(1), np.ones(1))
    assert np.max(np.abs(rest)) < 1e-12
    # Free of force across, whatever the energy: l2 = l1^(-1/2).
    assert np.max(np.abs(energy.tensions(c, a, a**-0.5)[1])) < 1e-10


def test_a_locked_film_is_an_error_and_a_longer_one_is_slack() -> None:
    with pytest.raises(LockedError):
        Membrane("gent", (6.0, 3.0), INNER, OUTER, 0.09).forces(np.linspace(0.01, 0.09, 30))
    film = trial().film
    at = np.linspace(0.0, 0.04, 9)
    assert np.all(film.force(at, 1e-3)[at < 0.006] == 0)
    assert np.all(film.force(at, 1e-3)[2:] < film.force(at)[2:])
    exact = [np.trapezoid(film.force(x), x) for x in np.linspace(0, at[1:], 4000).T]
    np.testing.assert_allclose(film.work(at[1:]), exact, rtol=1e-5, atol=1e-6 * exact[-1])


def test_slopes_by_the_constants_are_the_force_itself_for_a_modulus() -> None:
    film, at = trial().film, np.linspace(0.002, 0.04, 25)
    np.testing.assert_allclose(film.slopes(at)[:, 0], film.force(at), rtol=1e-4, atol=1e-6)


# ---- faults ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FAULTS)
def test_every_form_of_a_fault_fades_with_its_size(name) -> None:
    t = trial()
    plain = t.reading({})
    for form, ranges in FAULTS[name].forms.items():
        details = {k: 0.5 * (a + b) for k, (a, b) in ranges.items()}
        change = [np.max(np.abs(t.reading({name: Done(s, form, details)}) - plain)) for s in (0.0, 1e-4, 1e-2)]
        assert change[0] < 1e-9, form
        assert 0 < change[1] < change[2] or name == "clipped", form
        assert np.all(np.isfinite(change))


def test_hysteresis_knows_no_speed_and_relaxation_does() -> None:
    def loop(name: str, form: str, speed: float) -> np.ndarray:
        film = trial().film
        c = course("c", [Way(0.04, speed), Way(0.0, speed)], 200, np.random.default_rng(1))
        details = {k: 0.5 * (a + b) for k, (a, b) in FAULTS[name].forms[form].items()}
        return Trial(film, c).reading({name: Done(0.2, form, details)})

    for form in FAULTS["hysteresis"].forms:
        np.testing.assert_allclose(loop("hysteresis", form, 1e-4), loop("hysteresis", form, 1e-2), rtol=1e-9)
    t = trial()
    held = (t.course.way == 0) & (t.course.at > 0.039)
    for form, ranges in FAULTS["viscoelastic"].forms.items():
        lazy = Done(0.4, form, {k: 0.5 * (a + b) for k, (a, b) in ranges.items()})
        assert np.all(np.diff(t.reading({"viscoelastic": lazy})[held]) < 0), form


def test_a_step_that_relaxes_by_a_power_of_time_does_so() -> None:
    film = trial().film
    c = course("c", [Way(0.02, 10.0, 100.0)], 400, np.random.default_rng(1))
    lazy = Done(0.5, "power_law", {"time": 0.05, "power": 0.3})
    force = Trial(film, c).reading({"viscoelastic": lazy})
    top = film.force(np.array([0.02]))[0]
    after = c.time > 1.0
    expected = top * (0.5 + 0.5 * (1 + c.time / (0.05 * c.time[-1])) ** -0.3)
    np.testing.assert_allclose(force[after], expected[after], rtol=1e-3)


def test_the_frame_yields_until_it_balances_the_film() -> None:
    t = trial()
    length, top = t.lengths
    force = t.reading({"machine_compliance": Done(0.05, "linear", {})})
    np.testing.assert_allclose(force, t.film.force(t.course.at - 0.05 * length * force / top), atol=1e-6 * top)


# ---- noise and files -------------------------------------------------------------------------------------------------


def test_noise_has_the_deviation_that_it_claims_and_strays_at_turns_alone() -> None:
    t = trial()
    force = np.repeat(t.reading({}), 40)
    c = t.course
    noise = Scatter(0.002, 0.001, 5.0, 0.001, 0.0)
    read, lost = noise.read(force, c, np.random.default_rng(2))
    assert lost == []
    z = (read - force) / noise.deviations(force)
    assert np.std(z) == pytest.approx(1.0, rel=0.1)
    np.testing.assert_allclose(read / 0.001, np.round(read / 0.001), atol=1e-9)
    astray = Scatter(1e-6, 0.0, 5.0, 0.0, 0.1)
    read, lost = astray.read(t.reading({}), c, np.random.default_rng(3))
    assert lost
    assert set(lost) <= set(c.turns)
    assert set(np.flatnonzero(np.abs(read - t.reading({})) > 1e-4)) <= set(lost)


@pytest.mark.parametrize(
    ("family", "ratios"),
    [("yeoh", {"friction": 40.0, "force_drift": 8.0}), ("knowles", {"mullins": 60.0}), ("gent", {"ripple": 20.0})],
)
def test_one_seed_is_one_measurement_with_the_ratios_asked_for(family, ratios, tmp_path) -> None:
    one, two = (generate(family, ratios, 17) for _ in range(2))
    assert one.csv == two.csv
    assert one.truth["reached"]
    assert one.truth["snr"] == pytest.approx(ratios, rel=0.03)
    assert all(one.truth["snr_own"][k] <= v * 1.001 for k, v in one.truth["snr"].items())
    assert generate(family, ratios, 18).csv != one.csv
    read = read_measurement(*one.write(tmp_path))
    np.testing.assert_allclose(read.force, one.force_N, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(read.deflection, one.path.at, atol=1e-9)
    assert np.all(np.diff(read.time) > 0)


def test_the_kinds_are_those_of_the_plan() -> None:
    assert set(EFFECTS) | set(FOREIGN) == set(FAULTS)
