"""The generator of synthetic measurements: its solver, its noise, its faults, and its ignorance of the package."""

import ast
from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.data.reading import read_measurement
from tests.generator.datasets import Bench, generate
from tests.generator.distortions import DISTORTIONS, LIBRARY, OUTSIDE, Active, convolved, give, memory, response
from tests.generator.energies import DECLARED, FAMILIES, relaxed
from tests.generator.film import LARGEST_SLIP, Edges, Film, forces
from tests.generator.noise import Noise
from tests.generator.protocols import PROTOCOLS, Protocol, sample
from tests.generator.setups import setup

FOLDER = Path(__file__).parent
INNER, OUTER = 0.010, 0.035
AT = np.array([0.5, 2.0, 5.0, 10.0, 20.0, 35.1, 60.0, 91.5]) * 1e-3
# Two independent solvers agree on these, to six digits (N).
REFERENCE = {
    ("neo_hookean", (7.5,), 1.0): (3.11351e-05, 0.00197445, 0.0293379, 0.19882, 0.95419, 2.3151, 4.3786, 6.83061),
    ("mooney_rivlin", (6.21436, 1.4703426), 1.0): (
        *(3.19017e-05, 0.0020229, 0.0300446, 0.203356, 0.973959, 2.34886, 4.31855, 6.47332),
    ),
    ("gent", (5.312, 17.42), 1.0): (2.2052e-05, 0.00139844, 0.020781, 0.141017, 0.688575, 1.82753, 4.64874, 18.7046),
    ("yeoh", (8.840838, -0.6303258, 0.05632747), 1.0): (
        *(3.67014e-05, 0.00232743, 0.0345747, 0.233541, 1.07159, 2.25269, 4.53009, 18.6213),
    ),
    ("ogden", (11.060008, 0.1959017, -0.3679535, 1.5196142, 5.805068, -1.1529809), 1.0): (
        *(1.90634e-05, 0.00120888, 0.0179599, 0.121693, 0.58786, 1.56417, 4.57207, 18.0476),
    ),
    ("neo_hookean", (7.5,), 1.03): (0.00614218, 0.0262679, 0.0870964, 0.292408, 1.04611, 2.36642, 4.39977, 6.83908),
}
every_family = pytest.mark.parametrize("family", FAMILIES.values(), ids=FAMILIES.keys())
FAULTS = tuple(k for k in DISTORTIONS if k != "gain")


# ---- independence ----------------------------------------------------------------------------------------------------


def imported_by(path: Path) -> set[str]:
    nodes = list(ast.walk(ast.parse(path.read_text())))
    plain = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    return plain | {node.module or "." for node in nodes if isinstance(node, ast.ImportFrom)}


def test_the_generator_imports_nothing_of_the_package() -> None:
    files = [f for f in FOLDER.glob("*.py") if not f.name.startswith("test_")]
    assert files
    for name in {n for f in files for n in imported_by(f)}:
        root = name.partition(".")[0]
        assert root in {"__future__", "collections", "dataclasses", "functools", "pathlib", "typing", "zlib"} | {
            "numpy",
            "scipy",
        } or name.startswith("tests.generator."), name
    assert not any("importlib" in f.read_text() or "__import__" in f.read_text() for f in files)


# ---- film ------------------------------------------------------------------------------------------------------------


@every_family
def test_stresses_are_slopes_of_the_energy_and_so_on(family) -> None:
    rng = np.random.default_rng(1)
    p = family.draw(rng)
    a, b = rng.uniform(1.05, 1.9, (2, 20))
    _, w1, w2, w11, w12, w22 = family.derivatives(p, a, b)
    e = 1e-5
    up, down = family.derivatives(p, a + e, b), family.derivatives(p, a - e, b)
    for found, k in ((w1, 0), (w11, 1), (w12, 2)):
        np.testing.assert_allclose(found, (up[k] - down[k]) / (2 * e), rtol=1e-6, atol=1e-6)
    up, down = family.derivatives(p, a, b + e), family.derivatives(p, a, b - e)
    for found, k in ((w2, 0), (w12, 1), (w22, 2)):
        np.testing.assert_allclose(found, (up[k] - down[k]) / (2 * e), rtol=1e-6, atol=1e-6)


@every_family
def test_every_family_walks_to_the_neo_hookean_film_of_its_modulus(family) -> None:
    p = family.draw(np.random.default_rng(2))
    one = np.ones(1)
    np.testing.assert_allclose(family.toward_neo_hookean(p, 1.0), p, rtol=1e-12)
    near = family.toward_neo_hookean(p, 1e-6)
    slope = family.derivatives(p, one, one)[3]
    np.testing.assert_allclose(family.derivatives(near, one, one)[3], slope, rtol=1e-5)
    at = np.array([1.6]), np.array([1.2])
    expected = FAMILIES["neo_hookean"].derivatives(slope / 8, *at)[1]
    np.testing.assert_allclose(family.derivatives(near, *at)[1], expected, rtol=1e-4)


def test_a_wrinkled_film_pulls_as_a_strip_and_a_slack_one_not_at_all() -> None:
    family, p = FAMILIES["gent"], np.array([5.0, 20.0])
    l1, l2 = np.array([1.5]), np.array([0.7])
    w, p1, p2, p11, *_ = relaxed(family, p, l1, l2)
    free = family.derivatives(p, l1, l1**-0.5)
    assert abs(free[2][0]) < 1e-12
    assert w == free[0]
    assert p1 == free[1]
    assert p2 == 0
    e = 1e-5
    np.testing.assert_allclose(p11, (relaxed(family, p, l1 + e, l2)[1] - p1) / e, rtol=1e-4)
    assert all(float(np.max(np.abs(x))) == 0 for x in relaxed(family, p, np.array([0.98]), np.array([0.99])))


@pytest.mark.parametrize("case", REFERENCE, ids=lambda c: f"{c[0]}-{c[2]:g}")
def test_forces_agree_with_the_reference_solutions(case) -> None:
    name, p, l0 = case
    grid = np.unique(np.concatenate([AT, np.linspace(1.0, 91.5, 60) * 1e-3]))
    found = forces(FAMILIES[name], np.array(p), Edges(INNER / l0, OUTER / l0, INNER, OUTER), grid)
    np.testing.assert_allclose(found[np.searchsorted(grid, AT)], REFERENCE[case], rtol=1e-5)


@every_family
def test_the_interpolated_law_is_the_solved_one(family) -> None:
    p = family.draw(np.random.default_rng(3))
    law = Film(family.name, tuple(p), INNER, OUTER, 0.0435)
    at = np.linspace(0.8, 43.0, 37) * 1e-3
    exact = forces(family, p, Edges(INNER, OUTER, INNER, OUTER), at, 40)
    np.testing.assert_allclose(law.force(at), exact, rtol=2e-5, atol=1e-7)
    np.testing.assert_array_equal(law.force(-at), -law.force(at))


@pytest.mark.parametrize(("prestretch", "slip"), [(1.02, 0.0), (1.0, 0.31e-3), (1.02, 0.31e-3)])
def test_the_law_of_a_stretched_or_slipped_film_is_the_solved_one(prestretch, slip) -> None:
    p = np.array([8.84, -0.63, 0.056])
    law = Film("yeoh", tuple(p), INNER, OUTER, 0.0435)
    at = np.linspace(6.0, 40.0, 18) * 1e-3
    edges = Edges(INNER / prestretch, (OUTER + slip) / prestretch, INNER, OUTER)
    found = law.force(at, prestretch, np.full(at.size, slip))
    # Slack regions make kinks that splines round off; a fortieth of the noise is enough.
    atol = 1e-4 if slip else 2e-6
    np.testing.assert_allclose(found, forces(FAMILIES["yeoh"], p, edges, at, 40), rtol=1e-5, atol=atol)


def test_a_film_that_slipped_far_carries_nothing_near_the_start() -> None:
    law = Film("neo_hookean", (7.5,), INNER, OUTER, 0.0435)
    slip = LARGEST_SLIP / 2
    slack = np.sqrt((OUTER - INNER + slip) ** 2 - (OUTER - INNER) ** 2)
    at = np.array([0.5, 0.99, 1.01, 1.5]) * slack
    found = law.force(at, 1.0, np.full(4, slip))
    assert np.all(found[:2] == 0)
    assert np.all(found[2:] > 0)
    assert np.all(found < law.force(at))


@pytest.mark.parametrize("name", DECLARED)
def test_sensitivities_are_differences_of_forces(name) -> None:
    p = FAMILIES[name].draw(np.random.default_rng(4))
    at = np.linspace(2, 40, 12) * 1e-3
    slopes = Film(name, tuple(p), INNER, OUTER, 0.0435).sensitivities(at)
    edges = Edges(INNER, OUTER, INNER, OUTER)
    for j in range(p.size):
        step = np.zeros(p.size)
        step[j] = 1e-3 * abs(p[j])
        change = forces(FAMILIES[name], p + step, edges, at) - forces(FAMILIES[name], p - step, edges, at)
        scale = np.max(np.abs(slopes[:, j]))
        np.testing.assert_allclose(slopes[:, j], change / (2 * step[j]), rtol=1e-4, atol=1e-4 * scale)


# ---- protocols and noise ---------------------------------------------------------------------------------------------


def test_protocols_have_the_legs_that_their_names_promise() -> None:
    rng = np.random.default_rng(0)
    legs = {"single": 1, "staircase": 10, "staircase_twice": 16, "two_speeds": 8}
    points = {"single": 366, "staircase": 700, "staircase_twice": 700, "two_speeds": 700}
    for name, count in legs.items():
        for uneven in (False, True):
            path = sample(PROTOCOLS[name], rng, uneven)
            assert path.time.size == points[name]
            assert np.all(np.diff(path.time) > 0)
            assert np.array_equal(np.unique(path.leg), np.arange(count))
            assert np.all(path.deflection >= 0)
            for leg in range(count):
                on = path.leg == leg
                steps = np.diff(path.deflection[on])
                assert np.all(steps > 0) if leg % 2 == 0 else np.all(steps < 0)
                np.testing.assert_allclose(np.abs(steps / np.diff(path.time[on])), path.speed[on][0], rtol=1e-6)
                assert path.peak[on][0] - np.max(path.deflection[on]) < 4e-3
    assert len(set(sample(PROTOCOLS["two_speeds"], rng).speed)) == 2


@pytest.mark.parametrize("rho", [0.0, 0.3, 0.5, 0.8])
def test_noise_has_the_deviation_and_the_correlation_that_it_claims(rho) -> None:
    noise = Noise(sd=0.004, rho=rho)
    x = noise.draw(np.random.default_rng(7), np.ones(60_000))
    assert np.std(x) == pytest.approx(0.004, rel=0.03)
    assert np.corrcoef(x[1:], x[:-1])[0, 1] == pytest.approx(rho, abs=0.015)
    c = noise.covariance(np.ones(4))
    np.testing.assert_allclose(c[0], 0.004**2 * rho ** np.arange(4), atol=1e-18)


def test_noise_grows_with_the_deflection_where_it_says_so() -> None:
    noise, at = Noise(sd=0.001, grows=2.0), np.repeat([0.0, 0.04], 30_000)
    x = noise.draw(np.random.default_rng(8), at)
    assert np.std(x[:30_000]) == pytest.approx(0.001, rel=0.03)
    assert np.std(x[30_000:]) == pytest.approx(0.001 * 5**0.5, rel=0.03)
    np.testing.assert_allclose(np.diag(noise.covariance(at[[0, -1]])), [1e-6, 5e-6], rtol=1e-12)
    assert Noise(sd=0.002, quantum=0.001, relative=True).at(3.0) == Noise(sd=0.006, quantum=0.003)


def test_dwells_are_readings_at_rest_and_nothing_else_is_moved() -> None:
    plain = Protocol("plain", (0.01, 0.02), (1e-3, 2e-3), 80)
    held = Protocol("held", (0.01, 0.02), (1e-3, 2e-3), 80, dwells=(30.0, 7.0), readings=20)
    for uneven in (False, True):
        before = sample(plain, np.random.default_rng(3), uneven)
        after = sample(held, np.random.default_rng(3), uneven)
        assert after.time.size == 80 + 4 * 20
        assert np.all(np.diff(after.time) > 0)
        assert np.all(np.diff(after.leg) >= 0)
        still = np.concatenate([np.flatnonzero(after.leg == leg)[-20:] for leg in range(4)])
        assert np.array_equal(np.unique(after.deflection[still]), [0.0, 0.01, 0.02])
        moving = np.setdiff1d(np.arange(after.time.size), still)
        for name in ("deflection", "leg", "speed", "peak"):
            np.testing.assert_array_equal(getattr(after, name)[moving], getattr(before, name))
        waited = after.time[moving] - before.time
        np.testing.assert_allclose(waited, np.array([0.0, 30.0, 37.0, 67.0])[before.leg], atol=1e-9)


def test_quantised_and_uneven_measurements_are_so() -> None:
    d = generate("null", "gent", "staircase", "ar1:0.4+quantised:0.01+uneven", seed=1)
    steps = d.force_N / 0.01
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    assert np.std(np.diff(d.time_s)) > 0.3 * np.mean(np.diff(d.time_s))
    assert d.truth["noise"] == {"sd": 0.004, "rho": 0.4, "quantum": 0.01, "uneven": True}
    even = generate("null", "gent", "staircase", seed=1)
    assert np.std(np.diff(even.time_s)) < 1e-9
    with pytest.raises(ValueError, match="no noise"):
        generate("null", noise="pink")


# ---- faults ----------------------------------------------------------------------------------------------------------


def test_one_seed_is_one_measurement() -> None:
    one, two = (generate("mullins+friction", "ogden", "staircase", "ar1", 0.5, 11) for _ in range(2))
    assert one.csv == two.csv
    assert one.truth == two.truth
    assert generate("mullins+friction", "ogden", "staircase", "ar1", 0.5, 12).csv != one.csv


@pytest.mark.parametrize("kind", DISTORTIONS)
def test_a_fault_of_strength_zero_is_no_fault(kind) -> None:
    none, nothing = generate("null", "yeoh", seed=5), generate(kind, "yeoh", strength=0.0, seed=5)
    np.testing.assert_array_equal(nothing.force_N, none.force_N)
    assert nothing.truth["expected"] == none.truth["expected"] == ["adequate"]


@pytest.mark.parametrize("kind", FAULTS)
def test_every_form_of_size_zero_changes_nothing(kind) -> None:
    film, path = generate("null", "mooney_rivlin", seed=5).film, sample(PROTOCOLS["two_speeds"], None)
    clean = response(film, path, {})
    for form in DISTORTIONS[kind].forms:
        active = Active(0.0, form, DISTORTIONS[kind].middle(form))
        np.testing.assert_allclose(response(film, path, {kind: active}), clean, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize(
    ("strength", "noise", "seed"), [(1.0, "white", 21), (0.5, "ar1:0.5", 22), (0.25, "ar1:0.3+quantised+uneven", 23)]
)
def test_the_projected_signature_is_as_strong_as_was_asked(strength, noise, seed) -> None:
    for kind in FAULTS:
        d = generate(kind, "yeoh", "two_speeds", noise, strength, seed)
        root = np.linalg.inv(np.linalg.cholesky(d.covariance))
        signature = root @ (d.clean_N - d.null_N)
        absorbed = root @ d.film.sensitivities(d.path.deflection)
        absorbed /= np.linalg.norm(absorbed, axis=0)
        left = signature - absorbed @ np.linalg.lstsq(absorbed, signature, rcond=None)[0]
        if d.truth["reached"]:
            assert np.linalg.norm(left) == pytest.approx(20 * strength, rel=0.03), kind
        else:  # nothing of a sensible size shows that much
            assert abs(d.truth["effects"][kind]["size"]) == pytest.approx(DISTORTIONS[kind].largest), kind
    # Those that show on a protocol like this one must have been reached.
    d = generate("rate+friction", "yeoh", "two_speeds", noise, strength, seed)
    assert d.truth["reached"]


def test_the_material_absorbs_a_gain_error() -> None:
    d = generate("gain", "ogden", seed=3)
    assert np.max(np.abs(d.clean_N - d.null_N)) > 0.02
    assert d.truth["snr"]["gain"] < 1e-3
    assert d.truth["expected"] == ["adequate"]


def test_faults_without_a_trace_say_so() -> None:
    for kind in ("mullins", "rate"):
        d = generate(kind, "gent", "single", seed=2)
        assert not d.truth["reached"]
        assert d.truth["snr"][kind] < 1e-6
        assert "adequate" in d.truth["expected"]
        assert not d.identifiable


def test_the_machine_gives_way_until_it_balances_the_film() -> None:
    d = generate("machine_compliance+force_offset", "neo_hookean", seed=8)
    film_force = d.clean_N - d.at_work["force_offset"].size
    moved = d.path.deflection - give(d.at_work["machine_compliance"], film_force)
    np.testing.assert_allclose(d.film.force(moved), film_force, atol=1e-9)


def test_relaxation_of_a_steady_pull_is_the_integral_of_its_kernel() -> None:
    time = np.linspace(0, 60, 90)
    active = Active(0.4, "two_times", {"time": 10.0, "ratio": 8.0, "share": 0.6})
    found = convolved(active, 0.1 * time, memory(active, time))
    lost = time - sum(s * t * -np.expm1(-time / t) for s, t in ((0.6, 10.0), (0.4, 80.0)))
    np.testing.assert_allclose(found, 0.1 * (time - 0.4 * lost), atol=2e-5)


def test_angles_tell_what_a_protocol_can_separate() -> None:
    assert generate("friction", "yeoh", "single", seed=4).angles["friction"]["force_offset"] < 20
    assert generate("friction", "yeoh", "staircase", seed=4).identifiable
    for kind in OUTSIDE:
        d = generate(kind, "yeoh", "staircase", seed=4)
        assert min(d.angles[kind].values()) > 10
        assert d.truth["expected"] == ["unknown"]
    compliance = generate("machine_compliance", "yeoh", "staircase", seed=4)
    assert not compliance.identifiable
    assert set(compliance.angles["machine_compliance"]) <= set(LIBRARY) - {"machine_compliance"}


def test_hysteresis_within_the_material_is_the_same_at_any_speed() -> None:
    film = generate("null", "gent", seed=5).film
    slow, quick = (sample(Protocol("p", (0.03, 0.03), (v, v), 300), None) for v in (1e-4, 1e-2))
    for form in DISTORTIONS["hysteresis"].forms:
        active = {"hysteresis": Active(0.1, form, DISTORTIONS["hysteresis"].middle(form))}
        found = response(film, slow, active)
        np.testing.assert_allclose(found, response(film, quick, active), rtol=1e-12, atol=1e-15)
        change = found - response(film, slow, {})
        deep = (slow.deflection > 0.01) & (slow.deflection < 0.02)
        assert np.all(change[deep & slow.loading] > 0)
        assert np.all(change[deep & ~slow.loading] < 0)


@pytest.mark.parametrize("bench", [Bench(0.005, 0.030, 20e-6), Bench(0.015, 0.060, 200e-6)], ids=["thin", "thick"])
def test_other_rigs_and_thicknesses_have_faults_of_the_strength_asked_for(bench) -> None:
    protocol = Protocol("p", tuple((bench.outer - bench.inner) * x for x in (0.6, 1.2, 1.2)), (1e-3,) * 3, 300)
    kind, strengths = "friction+clamp_slip+force_drift", (1.0, 0.5, 0.2)
    d = generate(kind, "yeoh", protocol, Noise(0.002, relative=True), strengths, 31, bench)
    assert d.truth["snr"] == pytest.approx(dict(zip(kind.split("+"), (20.0, 10.0, 4.0), strict=True)), rel=0.05)
    assert d.truth["reached"]
    assert d.truth["strength"] == list(strengths)
    assert d.truth["noise"]["sd"] == pytest.approx(0.002 * np.max(d.null_N), rel=0.01)
    thin = generate(kind, "yeoh", protocol, Noise(0.002, relative=True), strengths, 31, Bench(bench.inner, bench.outer))
    np.testing.assert_allclose(d.null_N, thin.null_N * bench.thickness / 50e-6, rtol=1e-9)
    exact = forces(FAMILIES["yeoh"], d.film.p, Edges(bench.inner, bench.outer, bench.inner, bench.outer), AT[2:5], 80)
    np.testing.assert_allclose(d.film.force(AT[2:5]), exact, rtol=5e-5)


def test_setups_are_drawn_by_their_seed_within_what_they_promise() -> None:
    for seed in range(60):
        faults = (("rate",), ("friction", "mullins"), ())[seed % 3]
        s = setup(faults, seed)
        assert s == setup(faults, seed)
        assert 0.005 <= s.bench.inner <= 0.015 < 0.030 <= s.bench.outer <= 0.060
        assert 20e-6 <= s.bench.thickness <= 200e-6
        assert 0.9 <= max(s.protocol.peaks) / (s.bench.outer - s.bench.inner) <= 1.7
        assert max(setup(faults, seed, 0.5).protocol.peaks) == pytest.approx(0.5 * max(s.protocol.peaks))
        if faults == ("rate",):
            assert len(set(s.protocol.speeds)) == 2
            assert max(s.protocol.dwells) == 0
        if faults:
            assert len(s.protocol.peaks) > 1


def test_a_pair_is_two_faults_of_the_strength_asked_for() -> None:
    d = generate("prestretch+clamp_slip", "gent", "staircase", "white", 0.5, 9)
    assert d.truth["snr"] == pytest.approx({"prestretch": 10.0, "clamp_slip": 10.0}, rel=0.02)
    assert set(d.truth["snr_own"]) == {"prestretch", "clamp_slip"}
    assert all(d.truth["snr_own"][k] <= d.truth["snr"][k] for k in d.at_work)


@pytest.mark.parametrize(("declared", "family"), [("neo_hookean", "gent"), ("gent", "fung"), ("yeoh", "lopez_pamies")])
def test_a_wrong_family_is_as_far_from_the_declared_one_as_was_asked(declared, family) -> None:
    d = generate(f"family:{family}", declared, "single", "white", 0.5, 6)
    left = np.linalg.norm((d.clean_N - d.null_N) / 0.004)
    assert left == pytest.approx(d.truth["snr"][f"family:{family}"], rel=0.02)
    assert not d.truth["reached"] or left == pytest.approx(10.0, rel=0.06)
    assert d.truth["family"] == family
    assert d.truth["expected"] == ["material", "unknown"] + ([] if d.truth["reached"] else ["adequate"])


def test_a_typical_film_of_another_family_is_as_it_was_drawn() -> None:
    d = generate("typical:arruda_boyce", "neo_hookean", "single", seed=1)
    assert d.truth["snr"]["typical:arruda_boyce"] > 40
    assert d.refit_snr == pytest.approx(d.truth["snr"]["typical:arruda_boyce"], rel=0.01)


def test_the_files_are_those_that_the_package_reads(tmp_path) -> None:
    d = generate("zero_offset", "yeoh", "staircase", "uneven", seed=2)
    read = read_measurement(*d.write(tmp_path / "case"))
    np.testing.assert_allclose(read.force, d.force_N, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(read.deflection, 1e-3 * d.deflection_mm, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(read.time, d.time_s, rtol=1e-8, atol=1e-12)
    assert np.max(read.cycle) == 5
    assert "SYNTHETIC" in d.toml
