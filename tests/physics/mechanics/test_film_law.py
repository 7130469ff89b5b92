"""The interpolated film: as exact as the solver, with slopes, sensitivities and honest ends."""

from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.ground.registry import material
from bayesmembrane.physics.mechanics import Status, request, solve
from bayesmembrane.physics.mechanics.film_law import KNOTS, FilmLaw, Gap, film_law, knots

GAP = Gap(0.010, 0.035)
RADII = {"inner_radius": 0.010, "outer_radius": 0.035}
END = 91.5e-3
D = np.linspace(1e-4, END, 181)
FILMS = [
    ("neo_hookean", [7.5]),
    ("mooney_rivlin", [6.2, 0.4]),
    ("gent", [5.312, 17.42]),
    ("yeoh", [8.840838, -0.6303258, 0.05632747]),
    ("ogden", [11.060008, 0.1959017, -0.3679535, 1.5196142, 5.805068, -1.1529809]),
]


def law_of(name: str, films: list[float] | np.ndarray, l0: float = 1.0, end: float = END, **options: bool) -> FilmLaw:
    p = np.atleast_2d(films)
    ones = np.ones(len(p))
    asked = request(material(name), p, [0.01], GAP.inner_radius, GAP.outer_radius, prestretch=l0, **options)
    return film_law(replace(asked, deflection=asked.deflection[:, :0]), end * ones)[0]


@pytest.mark.parametrize(("name", "film"), FILMS)
def test_interpolated_is_solved(name: str, film: list[float]) -> None:
    force, slope = law_of(name, film)(D[None])
    exact = solve(request(material(name), film, D, **RADII))
    assert force == pytest.approx(exact.force, rel=1e-6)
    assert slope == pytest.approx(exact.slope, rel=2e-5)


@pytest.mark.parametrize("l0", [1.0005, 1.01, 1.1])
def test_a_tense_film_too(l0: float) -> None:
    """To 1e-5 of the largest force, close to locking too, and where a small pre-stretch gives way to the deflection."""
    for name, film in FILMS:
        force, _ = law_of(name, film, l0)(D[None])
        exact = solve(request(material(name), film, D, prestretch=l0, **RADII)).force
        apart = np.abs(force - exact) / np.nanmax(exact)
        assert np.nanmax(apart) < (1e-5 if l0 > 1.001 else 3e-5)
        assert np.nanmedian(apart) < 1e-6


@pytest.mark.parametrize(("name", "film"), FILMS)
def test_a_varied_film_is_another_film(name: str, film: list[float]) -> None:
    law = law_of(name, film, sensitivities=True)
    exact = solve(request(material(name), film, D, sensitivities=True, **RADII)).sensitivity
    for i, value in enumerate(film):
        change = np.zeros((1, len(film)))
        change[0, i] = 1e-6 * abs(value)
        found = (law.varied(change)(D[None])[0] - law(D[None])[0]) / change[0, i]
        assert np.max(np.abs(found - exact[:, :, i])) < 2e-4 * np.max(np.abs(exact[:, :, i]))


def test_a_locked_film_ends_where_it_locks() -> None:
    film = np.array([[5.3, 1.5], [5.3, 40.0]])
    force, _ = law_of("gent", film)(np.stack([D, D]))
    exact = solve(request(material("gent"), film, D, **RADII))
    both = np.isfinite(force) & np.isfinite(exact.force)
    assert force[both] == pytest.approx(exact.force[both], rel=1e-3)
    assert np.array_equal(np.isfinite(force[1]), np.isfinite(exact.force[1]))
    first, limit = np.argmax(np.isnan(force[0])), np.argmax(np.isnan(exact.force[0]))
    assert 0 < first <= limit
    assert D[limit] - D[first] < 0.2 * D[limit]
    assert law_of("gent", film).status[0] == Status.LOCKED


def test_nothing_at_rest_and_nothing_below() -> None:
    law = law_of("yeoh", FILMS[3][1])
    force, slope = law(np.array([[-0.01, 0.0]]))
    assert np.all(force == 0)
    assert np.all(slope == 0)
    assert np.isnan(law(np.array([[1.01 * END, np.nan]]))[0]).all()


@pytest.mark.parametrize("l0", [1.01, 1.1])
def test_a_taut_film_pulls_a_disc_back_that_lies_below_it(l0: float) -> None:
    for name, film in FILMS:
        law, below = law_of(name, film, l0), -D[:90]
        exact = solve(request(material(name), film, below, prestretch=l0, **RADII))
        force, slope = law(below[None])
        assert np.max(np.abs(force - exact.force)) < 1e-5 * law(D[None])[0].max()
        assert slope == pytest.approx(law(-below[None])[1], rel=1e-12)
        near = 1e-7 * np.array([[-1.0, 0.0, 1.0]])
        assert np.diff(law(near)[0]) / 1e-7 == pytest.approx(law(near)[1][:, 1:], rel=1e-6)
        assert np.isnan(law(np.array([[-1.01 * END, np.nan]]))[0]).all()
        longer = law(below[None], np.full((1, below.size), 2e-3))[0]
        assert longer == pytest.approx(-law(-below[None], np.full((1, below.size), 2e-3))[0], rel=1e-12)


def test_no_excess_length_is_none() -> None:
    law = law_of("yeoh", FILMS[3][1])
    for a, b in zip(law(D[None]), law(D[None], np.zeros((1, D.size))), strict=True):
        assert np.array_equal(a, b)


def test_films_stack_and_keep_apart() -> None:
    soft, stiff = law_of("neo_hookean", [7.5]), law_of("neo_hookean", [75.0], end=0.05)
    force, _ = FilmLaw.stack([soft, stiff])(np.stack([D, D / 2]))
    assert np.array_equal(force[:1], soft(D[None])[0])
    assert np.array_equal(force[1:], stiff(D[None] / 2)[0])


def test_a_film_alone_is_the_film_in_a_batch() -> None:
    films = np.array([[8.0, -0.2, 0.03], [8.84, -0.63, 0.0563], [8.0, 0.0, 0.0]])
    together, _ = law_of("yeoh", films)(np.tile(D, (3, 1)))
    for film, force in zip(films, together, strict=True):
        assert force == pytest.approx(law_of("yeoh", film)(D[None])[0][0], rel=1e-9)


def test_knots_are_even_about_zero() -> None:
    for count in KNOTS:
        at = knots(GAP, np.array([END]), count)[0]
        assert at[-1] == pytest.approx(END, rel=1e-12)
        u = np.arcsinh(at / (1.6 * GAP.length))
        assert u == pytest.approx(u[0] * (2 * np.arange(count) + 1))
