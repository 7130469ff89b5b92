"""The shape of the film: boundary values, equilibrium and consistency with the forces."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import simpson

from bayesmembrane.physics.materials.gent import Gent
from bayesmembrane.physics.materials.mooney_rivlin import MooneyRivlin
from bayesmembrane.physics.materials.neo_hookean import NeoHookean
from bayesmembrane.physics.mechanics import Status, profile, profiles, request, solve
from tests.physics.mechanics.films import INNER, MM, OUTER, RADII, every_material, silicone


@every_material
@pytest.mark.parametrize("prestretch", [1.0, 1.05])
@pytest.mark.parametrize("deflection", [2 * MM, 35.1 * MM, 91.5 * MM])
def test_profile_is_an_equilibrium_with_these_boundary_values(material, prestretch, deflection):
    film = material.from_vector(silicone(material))
    shape = profile(film, deflection, prestretch=prestretch, points=2001, **RADII)
    assert shape.status is Status.OK
    assert shape.f[[0, -1]] == pytest.approx([INNER, OUTER], rel=1e-12)
    assert shape.height[[0, -1]] == pytest.approx([deflection, 0.0], abs=1e-12 * deflection)
    assert shape.l2[[0, -1]] == pytest.approx([prestretch, prestretch], rel=1e-12)
    # Lengths per stress-free length: df/dR = l1 cos(theta), dh/dR = -l1 sin(theta), R the clamped radius over l0.
    free = shape.radius / prestretch
    inside = slice(5, -5)
    f_slope, h_slope = (np.gradient(v, free, edge_order=2)[inside] for v in (shape.f, shape.height))
    assert f_slope == pytest.approx((shape.l1 * np.cos(shape.angle))[inside], rel=1e-4, abs=1e-4)
    assert h_slope == pytest.approx(-(shape.l1 * np.sin(shape.angle))[inside], rel=1e-4, abs=1e-4)
    # First integral and force.
    lift = 2 * np.pi * free * shape.tension_1 * np.sin(shape.angle)
    assert lift == pytest.approx(np.full(2001, shape.force), rel=2e-3)
    # Energy, and agreement with the force curve.
    w = film.energy(shape.l1, shape.l2)
    assert simpson(2 * np.pi * free**2 * w, x=np.log(free)) == pytest.approx(shape.energy, rel=1e-5)
    curves = solve(request(material, film.vector, deflection, prestretch=prestretch, **RADII))
    assert shape.force == pytest.approx(curves.force[0, 0], rel=1e-9)


def test_tensions_and_stretches_are_those_of_the_material():
    film = MooneyRivlin(6.2, 1.5)
    shape = profile(film, 60 * MM, **RADII)
    p1, p2 = film.tension(shape.l1, shape.l2)
    np.testing.assert_allclose(shape.tension_1, p1)
    np.testing.assert_allclose(shape.tension_2, p2)
    np.testing.assert_allclose(shape.f, shape.radius * shape.l2)


def test_films_side_by_side_are_what_each_is_alone():
    """Of films that take few elements and many, that lock, and that nothing is known of; up, down and flat."""
    parameters = np.array([[5.0, 2.0], [7.5, 60.0], [5.0, 0.5], [-5.0, 2.0], [5.0, 30.0]])
    deflection = np.array([91.5, -20.0, 91.5, 10.0, 0.0]) * MM
    side_by_side = profiles(request(Gent, parameters, deflection[:, None], INNER, OUTER))
    for film, d, found in zip(parameters, deflection, side_by_side, strict=True):
        alone = profile(Gent(*film), d, **RADII)
        assert found.status is alone.status
        for name in ("f", "height", "l1", "l2", "angle", "tension_1", "tension_2", "force", "energy"):
            np.testing.assert_allclose(getattr(found, name), getattr(alone, name), rtol=1e-9, atol=1e-12)
    assert {p.status for p in side_by_side} > {Status.OK, Status.LOCKED}


def test_pushing_down_mirrors_the_shape():
    up, down = profile(NeoHookean(7.5), 20 * MM, **RADII), profile(NeoHookean(7.5), -20 * MM, **RADII)
    np.testing.assert_array_equal(down.height, -up.height)
    np.testing.assert_array_equal(down.angle, -up.angle)
    np.testing.assert_array_equal(down.f, up.f)
    assert down.force == -up.force
    assert down.energy == up.energy


def test_flat_film_stays_flat():
    shape = profile(NeoHookean(7.5), 0.0, prestretch=1.1, **RADII)
    assert shape.force == 0
    np.testing.assert_allclose(shape.l1, 1.1, rtol=1e-6)
    np.testing.assert_allclose(shape.height, 0.0, atol=1e-5 * MM)


@pytest.mark.parametrize("prestretch", [1.0, 1.05])
@pytest.mark.parametrize(("inner", "outer"), [(0.0086, 0.0486), (0.003, 0.060), (0.010, 0.035)])
@pytest.mark.parametrize("deflection", [1e-9, -1e-8, 1e-7, 3e-6])
def test_a_film_that_is_all_but_flat_has_the_shape_of_one_lifted_further(inner, outer, prestretch, deflection):
    film, radii = NeoHookean(7.5), {"inner_radius": inner, "outer_radius": outer, "prestretch": prestretch}
    shape, lifted = profile(film, deflection, **radii), profile(film, 4e-4 * (outer - inner), **radii)
    part = deflection / (4e-4 * (outer - inner))
    assert shape.status is Status.OK
    np.testing.assert_allclose(shape.height, part * lifted.height, atol=1e-5 * abs(deflection))
    np.testing.assert_allclose(shape.l2 - prestretch, part**2 * (lifted.l2 - prestretch), atol=1e-11)
    np.testing.assert_allclose(shape.l1 - prestretch, part**2 * (lifted.l1 - prestretch), atol=1e-11)
    curves = solve(request(NeoHookean, film.vector, deflection, inner, outer, prestretch=prestretch))
    assert shape.force == pytest.approx(curves.force[0, 0], rel=1e-9)


@pytest.mark.filterwarnings("error")
def test_a_film_at_rest_that_round_off_has_made_slack_is_flat():
    shape = profile(NeoHookean(7.5), 0.0, prestretch=1 - 1e-13, **RADII)
    np.testing.assert_allclose(shape.height, 0.0, atol=1e-5 * MM)
    np.testing.assert_allclose(shape.l1, 1.0, rtol=1e-6)


def test_a_film_without_a_state_says_why():
    shape = profile(Gent(5.0, 2.0), 91.5 * MM, **RADII)
    assert shape.status is Status.LOCKED
    assert np.isnan(shape.force)
    assert np.all(np.isnan(shape.f))
    assert shape.radius[[0, -1]] == pytest.approx([INNER, OUTER])
