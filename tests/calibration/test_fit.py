"""The optimum: recovery from another solver's curves, linear cases in closed form, constraints, open ends."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bayesmembrane.app.demo import shipped_measurement
from bayesmembrane.calibration import fit as searches
from bayesmembrane.calibration.fit import fit
from bayesmembrane.calibration.objective import Objective
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.shipped import shipped
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.registry import components, material
from bayesmembrane.ground.stored import answer, read, store
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics import Request, request, solve
from bayesmembrane.physics.mechanics.film_law import FAR
from bayesmembrane.physics.mechanics.solution import Curves
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from tests.physics.predicting import predict

FILMS = {
    "neo_hookean": (7.5,),
    "mooney_rivlin": (6.6, 0.5),
    "gent": (5.3, 30.0),
    "yeoh": (8.0, -0.2, 0.03),
    "ogden": (11.0, 0.2, -0.4, 1.5, 4.8, -1.2),
}


def test_what_no_film_can_meet_is_said_by_its_name(film) -> None:  # type: ignore[no-untyped-def]
    m = film("gent", FILMS["gent"])
    with pytest.raises(SettingsError, match="all forces are zero"):
        fit(replace(m, force=0 * m.force), hypothesis("gent"))
    with pytest.raises(SettingsError, match="check the units and signs of deflection and force"):
        fit(replace(m, deflection=1e-3 * m.deflection), hypothesis("gent"))
    with pytest.raises(SettingsError, match=r"no neo_hookean film with a shear modulus .* carries"):
        fit(replace(m, force=-m.force), hypothesis("neo_hookean"))


@pytest.mark.parametrize("name", [n for n in FILMS if n != "ogden"])
def test_a_film_without_noise_comes_back(film, name: str) -> None:  # type: ignore[no-untyped-def]
    """The curve is the textbook solver's, so that this also says how well the two agree."""
    found = fit(film(name, FILMS[name]), hypothesis(name, convexity="none"), seed=11)
    assert found.status == "converged"
    assert found.rmse_N < 1e-6
    assert not found.at_bound
    for estimate, truth in zip(found.parameters.values(), FILMS[name], strict=True):
        assert estimate.value == pytest.approx(truth, rel=2e-5)
        assert estimate.sd is not None
        assert estimate.sd < 1e-3 * abs(truth)


def test_a_film_that_loses_ellipticity_comes_back() -> None:
    """It has a force all the same, and no search may leave it out: only the convexity prior excludes it."""
    m, h = shipped_measurement("OP2"), hypothesis("mooney_rivlin", convexity="none")
    films = h.films(np.array([[3.86, -0.10]]))
    rig = {"inner_radius": m.rig.inner_radius, "outer_radius": m.rig.outer_radius}
    curves = solve(request(material("mooney_rivlin"), films, m.deflection, solver="shooting", **rig))
    assert np.min(curves.ellipticity) < -0.01
    found = fit(replace(m, force=curves.force[0], covariance=None, force_sd=None), h)
    assert found.coordinates[1] == pytest.approx(-0.10, abs=1e-3)


def test_an_ogden_curve_comes_back_if_not_its_six_parameters(film) -> None:  # type: ignore[no-untyped-def]
    curve = film("ogden", FILMS["ogden"], noise=0.002, seed=5)
    found = fit(curve, hypothesis("ogden", convexity="none"), starts=[FILMS["ogden"]])
    truth = np.linalg.norm(
        predict(hypothesis("ogden"), material("ogden").to_coordinates(FILMS["ogden"]), curve).force - curve.force
    )
    assert found.loss_N <= truth
    assert found.loss_N > 0.2 * truth


def test_a_linear_fit_is_the_closed_form(film) -> None:  # type: ignore[no-untyped-def]
    """F = c1 F(1): c1 = <F, y> / <F, F> with variance s^2 / <F, F>, weighted or not."""
    curve = film("neo_hookean", (7.5,), noise=0.02, seed=3, stated=True)
    unit = solve(request(material("neo_hookean"), [1.0], curve.deflection, 0.01, 0.035)).force[0]
    c1 = unit @ curve.force / (unit @ unit)
    r = curve.force - c1 * unit
    for loss in ("euclidean", "weighted"):
        found = fit(curve, hypothesis("neo_hookean"), loss=loss)
        estimate = found.parameters["neo_hookean.c1"]
        assert estimate.value == pytest.approx(c1, rel=1e-7)
        assert estimate.sd == pytest.approx(np.sqrt(r @ r / (len(curve) - 1) / (unit @ unit)), rel=1e-5)
        assert found.loss_N == pytest.approx(np.linalg.norm(r))
        assert found.rmse_N == pytest.approx(np.linalg.norm(r) / np.sqrt(len(curve)))
        assert found.objective == pytest.approx(found.loss_N / (0.02 if loss == "weighted" else 1.0))


def test_a_gent_film_without_a_limit_is_open(film) -> None:  # type: ignore[no-untyped-def]
    """A softer curve than neo-Hookean drives the limit to infinity; its modulus still has an error."""
    found = fit(film("mooney_rivlin", (7.9, -0.2), end=0.035), hypothesis("gent"))
    assert found.at_bound == ("gent.ln_jm",)
    assert found.parameters["gent.c2"].sd is None
    assert found.parameters["gent.c1"].sd is not None


def test_no_loss_lies_above_a_published_start(film) -> None:  # type: ignore[no-untyped-def]
    curve = film("yeoh", (8.84, -0.63, 0.0563), end=0.0351, noise=0.01, seed=9)
    for name in ("mooney_rivlin", "gent", "yeoh"):
        rows = [r.split(",") for r in shipped("paper_parameters.csv").read_text().splitlines()]
        films = [[float(r[3]) for r in rows if r[:2] == [name, column]] for column in ("INI", "OP1", "OP2")]
        force = solve(request(material(name), films, curve.deflection, 0.01, 0.035)).force
        published = np.linalg.norm(force - curve.force, axis=1)
        found = fit(curve, hypothesis(name), starts=films)
        assert found.loss_N <= np.nanmin(published) * (1 + 1e-9)


@pytest.mark.parametrize("mode", ["reached", "box", "elliptic"])
def test_the_constrained_optimum_meets_its_prior(film, mode: str) -> None:  # type: ignore[no-untyped-def]
    curve = film("mooney_rivlin", (3.0, 4.5), end=0.05, noise=0.005, seed=2)
    found = fit(curve, hypothesis("mooney_rivlin", convexity=mode))
    assert found.constrained is not None
    if mode == "elliptic":
        assert found.convex
        assert found.constrained.loss_N == found.loss_N
        return
    assert not found.convex
    assert found.constrained.convex
    assert 0 <= found.constrained.margins[mode] < 0.02
    assert found.constrained.loss_N > found.loss_N
    share = [f.parameters["mooney_rivlin.c2"].value for f in (found, found.constrained)]
    assert share[0] == pytest.approx(4.5, rel=0.05)
    assert share[1] < share[0]
    answer = found.summary()
    assert answer["convex"] is False
    assert answer["constrained"]["convex"] is True


def test_the_constrained_optimum_is_the_best_of_a_scan(film) -> None:  # type: ignore[no-untyped-def]
    """In two dimensions the boundary can be walked: no feasible film on a fine grid of shares fits better."""
    curve = film("mooney_rivlin", (3.0, 4.5), end=0.05, noise=0.005, seed=2)
    h = hypothesis("mooney_rivlin")
    held = fit(curve, h).constrained
    assert held is not None
    share = np.linspace(-0.2, 0.8, 400)
    unit = predict(h, np.column_stack([np.zeros(400), share]), curve)
    scale = unit.force @ curve.force / np.sum(unit.force**2, axis=1)
    loss = np.linalg.norm(scale[:, None] * unit.force - curve.force, axis=1)
    best = np.min(loss[(unit.convexity >= 0) & unit.ok])
    assert held.loss_N <= best * (1 + 1e-6)
    assert held.loss_N > 0.98 * best


@pytest.mark.parametrize("beyond", [0.9995, 1.0005])
def test_the_constrained_optimum_is_found_where_films_are_solved_at_more_places_beside_it(film, beyond: float) -> None:  # type: ignore[no-untyped-def]
    """Films that are lifted further than some gaps have more knots, and an offset of the zero leads across that."""
    curve = film("mooney_rivlin", (4.0, 3.0), end=beyond * FAR * 0.025, noise=0.005, seed=2)
    found = fit(curve, hypothesis("mooney_rivlin", ["zero_offset"]))
    assert found.constrained is not None
    assert found.constrained.convex
    assert found.constrained.loss_N > found.loss_N


def test_seeds_agree(film) -> None:  # type: ignore[no-untyped-def]
    curve = film("yeoh", (8.0, -0.2, 0.03), noise=0.02, seed=8)
    one, two = (fit(curve, hypothesis("yeoh"), seed=s) for s in (1, 2))
    assert one.loss_N == pytest.approx(two.loss_N, rel=1e-6)


def test_a_fit_is_a_value_that_is_stored_and_read_back(film, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    found = fit(film("gent", (5.3, 30.0), noise=0.01, seed=4), hypothesis("gent", ["zero_offset"]))
    store(tmp_path, "fit", found, found.summary())
    again = read(tmp_path, "fit")
    assert again.summary() == found.summary() == answer(tmp_path, "fit")
    assert again.hypothesis == found.hypothesis
    assert again.parameters == found.parameters
    for name in ("coordinates", "covariance", "deflection", "force"):
        assert np.array_equal(getattr(again, name), getattr(found, name), equal_nan=True), name


def test_bad_questions_are_refused(film) -> None:  # type: ignore[no-untyped-def]
    curve = film("neo_hookean", (7.5,))
    with pytest.raises(SettingsError, match='no loss called "euclid"'):
        fit(curve, hypothesis("yeoh"), loss="euclid")
    with pytest.raises(SettingsError, match="needs the noise of the measurement"):
        fit(curve, hypothesis("yeoh"), loss="weighted")
    with pytest.raises(SettingsError, match="4 points cannot fix the 6 parameters"):
        fit(film("neo_hookean", (7.5,), points=4), hypothesis("ogden"))


def without_slopes(keeps: float) -> Any:
    """A solver whose films with |c3 / c1| above ``keeps`` have forces and no slopes, as next to a loss of stability."""

    def solver(asked: Request) -> Curves:
        curves, p = solve(asked), asked.parameters
        if curves.sensitivity is None or p.shape[1] < 3:
            return curves
        lost = np.abs(p[:, 2] / p[:, 0]) > keeps
        return replace(curves, sensitivity=np.where(lost[:, None, None], np.nan, curves.sensitivity))

    return solver


def test_films_without_slopes_are_neither_starts_nor_answers(film) -> None:  # type: ignore[no-untyped-def]
    curve = film("yeoh", (8.0, -0.2, 0.03), noise=0.02, seed=8)
    found = fit(curve, hypothesis("yeoh", convexity="none"), solve=without_slopes(0.003))
    assert found.status == "converged"
    assert np.isfinite(found.rmse_N)
    assert abs(found.coordinates[2]) <= 0.003


@pytest.mark.parametrize("effects", [(), ("force_offset",)])
def test_an_energy_fits_no_worse_than_the_one_inside(film, effects: tuple[str, ...]) -> None:  # type: ignore[no-untyped-def]
    """Next to nothing but the neo-Hookean film itself is left for Yeoh's: it must be found."""
    curve = film("neo_hookean", (7.5,), noise=0.02, seed=8)
    inner = fit(curve, hypothesis("neo_hookean", effects))
    found = fit(curve, hypothesis("yeoh", effects), solve=without_slopes(1e-7))
    assert found.status == "converged"
    assert found.loss_N <= inner.loss_N * (1 + 1e-6)
    assert found.constrained is not None
    assert found.constrained.loss_N <= inner.loss_N * (1 + 1e-6)


def test_what_is_at_a_bound_is_asked_of_the_fit_and_not_of_the_energy_inside(film, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    asked, at_bound = [], searches._at_bound

    def listening(objective: Objective, *more: Any) -> Any:
        asked.append(objective.hypothesis.material.name)
        return at_bound(objective, *more)

    monkeypatch.setattr(searches, "_at_bound", listening)
    fit(film("yeoh", FILMS["yeoh"], noise=0.02, seed=8), hypothesis("yeoh", convexity="none"))
    assert asked == ["yeoh"]


@pytest.mark.parametrize("all_of_them", [False, True])
def test_what_the_starts_cost_is_bounded_however_many_effects_there_are(monkeypatch, all_of_them: bool) -> None:  # type: ignore[no-untyped-def]
    """Each step from a start is worth a curve for each coordinate."""
    up = np.linspace(0.002, 0.06, 40)
    d = np.concatenate([up, up[::-1]])
    rig = Annulus(0.01, 0.035)
    curve = Measurement(d, d * (1 + 50 * d), rig, Specimen("many", 50e-6), time=np.linspace(0, 79, 80))
    occur = [n for n, e in components("effects").items() if e().unavailable(rig, curve.path) == ""]
    effects = tuple(occur) if all_of_them else ("force_offset",)
    looked_at: list[int] = []

    def polish(objective: Objective, x: np.ndarray, *_: Any) -> tuple[np.ndarray, float, str]:
        looked_at.append(x.size)
        return x, float(np.linalg.norm(objective(x)[0])), "converged"

    monkeypatch.setattr(Objective, "polish", polish)
    monkeypatch.setattr(searches, "_at_bound", lambda _, x, __: np.zeros(x.size, bool))
    fit(curve, hypothesis("neo_hookean", effects, convexity="none"))
    cost = sum(looked_at[: -searches.POLISHED])
    assert cost <= max(searches.SLOPES, searches.FEWEST * looked_at[0])
    assert all_of_them == (looked_at[0] > 20)


def test_where_there_is_no_fit_a_sentence_says_so(film) -> None:  # type: ignore[no-untyped-def]
    found = fit(film("neo_hookean", (7.5,), noise=0.02), hypothesis("yeoh"), solve=without_slopes(-1.0))
    assert np.isnan(found.rmse_N)
    assert "no yeoh film was found that reaches 50 mm with finite forces and slopes" in found.status
    assert all(e.sd is None for e in found.parameters.values())


def test_what_the_data_do_not_see_has_an_error_beyond_all_bounds_and_no_warning() -> None:
    """A misfit of kilonewtons: the fuzz, seed 22217, heard an overflow."""
    slopes = np.column_stack([np.ones(5), np.zeros(5)])
    with np.errstate(over="raise"):
        found = searches._covariance(np.full(5, 1e6), slopes, np.zeros(2, bool))
    assert found[0, 0] == pytest.approx(1e12 / 3)
    assert 1e100 < found[1, 1] < np.inf


def test_valleys_looked_for_with_a_part_lead_to_the_optimum_of_all(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    strip = Uniaxial(0.05, 0.01)
    d = 0.05 * np.interp(np.linspace(0, 1, 1500), [0, 0.6, 1], [0, 1.2, 0.1])
    stretch = 1 + d / 0.05
    force = 150.0 * 0.01 * (stretch - stretch**-2) + 0.01 * rng.standard_normal(d.size)
    m = Measurement(
        d, force, strip, Specimen("strip", 5e-4), time=np.arange(d.size) * 0.1, force_sd=np.full(d.size, 0.01)
    )
    for loss in ("euclidean", "weighted"):
        whole = fit(m, hypothesis("yeoh"), loss=loss)
        monkeypatch.setattr("bayesmembrane.calibration.fit.MANY", 300)
        part = fit(m, hypothesis("yeoh"), loss=loss)
        monkeypatch.undo()
        assert part.objective == pytest.approx(whole.objective, rel=1e-8)
        assert part.deflection.size == d.size
        for name, e in whole.parameters.items():
            assert e.sd is not None
            assert part.parameters[name].value == pytest.approx(e.value, abs=1e-2 * e.sd)


def test_independent_noise_weighs_as_its_matrix_does() -> None:
    """A standard deviation at each reading is the same claim as a diagonal covariance."""
    d = np.linspace(0.001, 0.05, 12)
    sd = np.linspace(0.01, 0.03, 12)
    force = 1.5 * (1 + d / 0.05 - (1 + d / 0.05) ** -2) + sd * np.sin(7 * np.arange(12.0))
    each = Measurement(d, force, Uniaxial(0.05, 0.01), Specimen("strip", 5e-4), force_sd=sd)
    matrix = Measurement(d, force, Uniaxial(0.05, 0.01), Specimen("strip", 5e-4), covariance=np.diag(sd**2))
    a, b = (fit(m, hypothesis("neo_hookean"), loss="weighted") for m in (each, matrix))
    assert a.objective == pytest.approx(b.objective, rel=1e-10)
    assert a.coordinates == pytest.approx(b.coordinates, rel=1e-8)
