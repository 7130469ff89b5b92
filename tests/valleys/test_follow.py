"""Valleys of films whose valley is known: from other solvers, from brute force, and from limits."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from typer.testing import CliRunner

from bayesmembrane.app.cli import assembled
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.writing import write_measurement
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.registry import material
from bayesmembrane.ground.stored import read, store
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.report.sections.valleys import write_valleys
from bayesmembrane.valleys.beside import valleys_beside
from bayesmembrane.valleys.follow import valleys
from bayesmembrane.valleys.result import Valleys
from bayesmembrane.valleys.surface import Chart, Surface
from bayesmembrane.words.valleys import sentence_beside, sentences, valley_sentences
from tests.ground.values import stored_equals_given
from tests.reference.slow_solver import force_curve

Film = Callable[..., Measurement]


@pytest.fixture(scope="module")
def mooney() -> tuple[Measurement, Valleys]:
    # A Yeoh film from the slow solver: no Mooney-Rivlin film fits it exactly.
    at = np.linspace(0.004, 0.035, 8)
    force = force_curve(material("yeoh")(8.8, -0.6, 0.05), at, 0.010, 0.035, rtol=1e-9)
    m = Measurement(at, force, Annulus(0.010, 0.035), Specimen("synthetic", 5e-5))
    return m, valleys(m, hypothesis("mooney_rivlin", convexity="none"), [0.026, 0.035])


def other_loss(m: Measurement, c1: float, c2: float) -> float:
    """|F - y| by shooting."""
    p = np.array([c1, c2])
    force = api.solve(
        api.request(
            hypothesis("mooney_rivlin").material,
            p,
            m.deflection,
            inner_radius=0.010,
            outer_radius=0.035,
            solver="shooting",
        )
    ).force[0]
    return float(np.linalg.norm(force - m.force))


def test_floor_of_mooney_rivlin_is_the_profile_minimum_of_another_solver(mooney: tuple[Measurement, Valleys]) -> None:
    m, found = mooney
    v = found.ranges[1]
    other = 1 - v.along
    for i in (0, len(v.floor) // 3, len(v.floor) - 1):
        held = v.floor[i, v.along]

        def loss(c: float, held: float = held) -> float:
            return other_loss(m, *((held, c) if v.along == 0 else (c, held)))

        middle = v.floor[i, other]
        least = minimize_scalar(loss, bracket=(middle - 0.3, middle, middle + 0.3), options={"xtol": 1e-9})
        assert least.x == pytest.approx(middle, abs=2e-4)
        assert least.fun == pytest.approx(v.floor_loss[i], rel=1e-4)


def test_valley_ends_where_a_grid_of_another_solver_leaves_the_stated_rise(
    mooney: tuple[Measurement, Valleys],
) -> None:
    m, found = mooney
    v = found.ranges[1]
    limit = v.best_loss + v.rise
    ends = [e.value for e in v.profiles[v.along].ends]
    step = (ends[1] - ends[0]) / 20
    for end, outwards in zip(ends, (-1, 1), strict=True):
        for side, inside in ((-outwards, True), (outwards, False)):
            held = end + side * step
            around = np.interp(held, v.chart.natural(v.profiles[v.along].points)[:, v.along],
                               v.chart.natural(v.profiles[v.along].points)[:, 1 - v.along])  # fmt: skip
            grid = np.linspace(around - 0.2, around + 0.2, 41)
            least = min(other_loss(m, *((held, c) if v.along == 0 else (c, held))) for c in grid)
            assert (least < limit) == inside


def test_length_is_the_arc_length_of_the_floor(mooney: tuple[Measurement, Valleys]) -> None:
    _, found = mooney
    v = found.ranges[0]
    length = sum(np.linalg.norm(b - a) for a, b in zip(v.floor[:-1], v.floor[1:], strict=True))
    answer = v.summary()
    assert answer["length"] == pytest.approx(length)
    assert answer["metric"] == {"name": "natural", "unit": "N/m"}
    assert np.max(v.floor_loss) == pytest.approx(v.best_loss + v.rise, rel=1e-6)
    assert np.all(v.floor_loss >= v.best_loss * (1 - 1e-9))


def test_direction_points_along_the_floor_and_condition_number_is_that_of_the_loss(
    mooney: tuple[Measurement, Valleys],
) -> None:
    _, found = mooney
    v = found.ranges[1]
    best = int(np.argmin(v.floor_loss))
    chord = v.floor[best + 1] - v.floor[best - 1]
    weak = v.spectra[0].vectors[:, -1]
    assert abs(chord @ weak) / np.linalg.norm(chord) > 0.99
    surface = Surface(v.hypothesis, mooney[0])
    j = surface.batch(v.best_z[None, :])[1][0]
    assert v.spectra[0].condition_number == pytest.approx(np.linalg.cond(j) ** 2, rel=1e-6)


def test_gent_valley_of_a_neo_hookean_film_is_open_and_no_optimum(film: Film) -> None:
    m = film("mooney_rivlin", (6.0, 1.5), end=0.03, points=8)
    found = valleys(m, hypothesis("gent", convexity="none"))
    v = found.ranges[0]
    assert v.open_end
    assert v.summary()["open_end"] is True
    assert v.limit == "neo_hookean"
    sentence = next(s for s in valley_sentences(v) if "open" in s)
    assert "infinity" in sentence
    assert "neo-Hookean" in sentence
    assert "no value of c2 is an optimum" in sentence
    low, high = v.profiles[v.along].ends
    assert not low.open
    assert high.tends


def test_gent_valley_of_a_gent_film_is_closed_around_it(film: Film) -> None:
    v = valleys(film("gent", (6.0, 12.0), end=0.05, points=9, noise=0.01), hypothesis("gent", convexity="none")).ranges[
        0
    ]
    assert not v.open_end
    low, high = v.profiles[1].ends
    assert low.value < 12.0 * 1.05
    assert high.value > 12.0 / 1.05
    assert 2 * low.value > high.value


def test_ranges_of_one_film_meet_and_ranges_of_a_wrong_family_stay_apart(
    film: Film, mooney: tuple[Measurement, Valleys]
) -> None:
    m = film("mooney_rivlin", (6.0, 1.5), end=0.05, points=12, noise=0.004)
    same = valleys(m, hypothesis("mooney_rivlin", convexity="none"), [0.025, 0.05]).between[0]
    assert same.approach.distance < 2
    wrong = mooney[1].between[0]
    assert wrong.approach.distance > same.approach.distance


def test_published_sets_are_shown_for_the_published_film_only(mooney: tuple[Measurement, Valleys]) -> None:
    assert mooney[1].ranges[0].published == ()


def test_answer_has_the_promised_fields(mooney: tuple[Measurement, Valleys]) -> None:
    answer = mooney[1].summary()
    for field in ("max_deflection_mm", "grid", "valley", "direction", "length", "condition_number", "open_end"):
        assert field in answer["ranges"][0]
    assert answer["closest_approach"]["distance"] >= 0


def test_a_rise_that_is_not_positive_is_refused(film: Film) -> None:
    with pytest.raises(SettingsError, match="positive"):
        valleys(film("neo_hookean", (7.5,)), hypothesis("neo_hookean"), rise=0.0)


@pytest.mark.parametrize("name", ["neo_hookean", "mooney_rivlin", "gent", "yeoh", "ogden"])
def test_chart_and_coordinates_are_inverse_and_signs_are_kept(name: str) -> None:
    chart = Chart(hypothesis(name))
    x = np.array([[0.5 * float(p.prior.quantile(0.6)) + 0.1 for p in chart.hypothesis.material.coordinates]])
    z = chart.from_coordinates(x)
    np.testing.assert_allclose(chart.coordinates(z), x, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(chart.natural(z), chart.hypothesis.films(x), rtol=1e-12)


@pytest.mark.parametrize("name", ["mooney_rivlin", "gent", "yeoh", "ogden"])
def test_slopes_over_the_parameters_are_differences_of_the_residual(name: str, film: Film) -> None:
    surface = Surface(hypothesis(name), film("neo_hookean", (7.5,), end=0.03, points=6))
    start = {"mooney_rivlin": (6.0, 1.0), "gent": (7.0, 40.0), "yeoh": (8.0, -0.3, 0.03)}
    p = start.get(name, (8.0, 0.3, -0.4, 1.5, 5.0, -1.5))
    z = surface.chart.from_natural(np.array([p]))
    slopes = surface.batch(z)[1][0]
    for i in range(z.shape[1]):
        h = np.zeros_like(z)
        h[0, i] = 1e-4 * max(1.0, abs(z[0, i]))
        both = surface.batch(np.concatenate([z + h, z - h]))[0]
        np.testing.assert_allclose(
            slopes[:, i], (both[0] - both[1]) / (2 * h[0, i]), rtol=2e-4, atol=1e-6 * np.max(np.abs(slopes[:, i]))
        )


def test_valleys_with_and_without_an_effect_lie_beside_each_other(film: Film, tmp_path: Path) -> None:
    """A film of one modulus, measured from a zero that is off: only with the offset is its modulus found."""
    plain = film("neo_hookean", (7.0,), end=0.03, points=8, noise=0.001)
    at = plain.deflection + 1e-3
    force = api.solve(api.request(material("neo_hookean"), [7.0], at, 0.01, 0.035)).force[0]
    moved = replace(plain, force=force * (1 + 1e-3 * (-1.0) ** np.arange(8)))
    found = valleys_beside(moved, hypothesis("neo_hookean", ["zero_offset"], convexity="none"))
    (with_,), (without,), (pair,) = found.added.ranges, found.without.ranges, found.pairs
    assert with_.chart.names == ("neo_hookean.c1", "zero_offset.shift")
    assert len(with_.floor) > 10
    assert with_.best_loss < 0.2 * without.best_loss
    assert with_.best[0] == pytest.approx(7.0, rel=0.01)
    assert abs(without.best[0] - 7.0) > 10 * abs(with_.best[0] - 7.0)
    assert pair.closest[0][0] == pytest.approx(without.floor[:, 0][np.argmin(abs(without.floor[:, 0] - 7.0))], rel=1e-2)
    assert f"moves from (c1 {without.best[0]:.4g}) to (c1 {with_.best[0]:.4g})" in sentence_beside(without, with_, pair)
    assert any(s.startswith("Without effects: Up to 30 mm") for s in sentences(found))
    names = [path.name for path in write_valleys(found, tmp_path)]
    assert names == ["valleys.json", "valleys_beside.png", "valleys.png"]
    assert "without_effects" in json.loads((tmp_path / "valleys.json").read_text())
    store(tmp_path / "stored", "valleys", found, {})
    stored_equals_given(found, read(tmp_path / "stored", "valleys"))
    with pytest.raises(SettingsError, match="no effects"):
        valleys_beside(moved, hypothesis("neo_hookean"))


def test_the_command_answers_with_the_promised_fields(film: Film, tmp_path: Path) -> None:
    m = film("mooney_rivlin", (6.0, 1.5), end=0.03, points=8, noise=0.003)
    write_measurement(m, tmp_path / "curve.csv", tmp_path / "film.toml")
    asked = ["valleys", str(tmp_path / "curve.csv"), "--specimen", str(tmp_path / "film.toml"), "--json"]
    asked += ["--material", "neo_hookean", "--ranges-mm", "20,30", "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(assembled(), asked)
    assert done.exit_code == 0, done.output
    answer = json.loads(done.stdout)
    assert [r["max_deflection_mm"] for r in answer["ranges"]] == pytest.approx([1e3 * 0.03 / 8 * 5, 30])
    assert set(answer["closest_approach"]) >= {"distance", "cross", "sentence"}
    other = json.loads(CliRunner().invoke(assembled(), [*asked, "--loss-rise", "0.2"]).stdout)
    assert len({*answer["files"], *other["files"]}) == 4
