"""The compiled shooting solver against SciPy alone, its own residuals, and the branches it must not land on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.physics.materials.gent import Gent
from bayesmembrane.physics.materials.mooney_rivlin import MooneyRivlin
from bayesmembrane.physics.materials.neo_hookean import NeoHookean
from bayesmembrane.physics.materials.ogden import Ogden
from bayesmembrane.physics.materials.yeoh import Yeoh
from bayesmembrane.physics.mechanics import Status, request, solve
from bayesmembrane.physics.mechanics.ritz import solver as ritz
from bayesmembrane.physics.mechanics.shooting import solver as shooting
from tests.physics.mechanics.films import (
    FIFTEEN,
    INNER,
    MM,
    OUTER,
    RADII,
    WIDE,
    asked,
    every_material,
    prior_draws,
    silicone,
)
from tests.reference.slow_solver import force_curve


@every_material
def test_parameters_in_any_layout_are_compiled_for_once(material):
    """A second code for parameters that are not in one piece cost a user eight seconds a material, once."""
    film = asked(material, silicone(material), FIFTEEN[:3])
    apart = np.asfortranarray(np.repeat(film.parameters, 2, axis=0))
    ahead = shooting.solve(film)
    again = shooting.solve(replace(film, parameters=apart[:1]))
    assert np.array_equal(again.force, ahead.force)
    assert len(shooting.compiled(material).shoot.signatures) == 1


@every_material
def test_shooting_equals_solve_ivp_and_root(material):
    few = FIFTEEN[[0, 4, 9, 14]]
    slow = force_curve(material.from_vector(silicone(material)), few, INNER, OUTER, rtol=1e-9)
    assert shooting.solve(asked(material, silicone(material), few)).force[0] == pytest.approx(slow, rel=1e-7)


@every_material
@pytest.mark.parametrize("prestretch", [1.0, 1.001, 1.3])
def test_first_integral_is_constant_and_boundary_values_are_met(material, prestretch):
    p = silicone(material)
    question = asked(material, p, WIDE[1:-2], prestretch)
    assert np.all(shooting.solve(question).variation < 1e-7)
    found, lines = np.empty((WIDE.size - 3, 3)), np.empty((WIDE.size - 2, 12))
    span = np.log(question.ratio)
    shooting.compiled(material).shoot(question.scaled[0], 2.0, prestretch, span, p, 1e-9, found, lines)
    k = shooting.kernels
    assert np.all(lines[:-1, [k.MISS_1, k.MISS_2]] < 1e-6)
    assert np.all(np.isnan(lines[-1])), "a path that does not end has no last state"


@every_material
def test_tolerance_does_not_matter(material):
    question = asked(material, prior_draws(material, 10, seed=201), FIFTEEN)
    normal, tight = shooting.solve(question), shooting.solve(question, rtol=1e-12)
    both = normal.ok & tight.ok
    assert np.any(both)
    assert normal.force[both] == pytest.approx(tight.force[both], rel=1e-7)
    assert normal.slope[both] == pytest.approx(tight.slope[both], rel=1e-5)


@every_material
def test_slope_is_the_derivative_of_the_force(material):
    d, h = np.array([5.0, 20.0, 60.0, 85.0]) * MM, 1e-4

    def at(factor):
        return shooting.solve(asked(material, silicone(material), d * factor), rtol=1e-11)

    f = [at(1 + k * h).force for k in (-2, -1, 1, 2)]
    assert at(1.0).slope == pytest.approx((8 * (f[2] - f[1]) - (f[3] - f[0])) / (12 * h * d), rel=1e-7)


@pytest.mark.parametrize("material", [NeoHookean, Ogden])
def test_sensitivities_agree_with_those_of_the_ritz_solver(material):
    question = asked(material, silicone(material), FIFTEEN[::5], 1.02)
    question = replace(question, sensitivities=True)
    one, other = shooting.solve(question), ritz.solve(question)
    scale = np.abs(other.sensitivity).max(axis=1, keepdims=True)
    np.testing.assert_allclose(one.sensitivity / scale, other.sensitivity / scale, atol=1e-5)


@every_material
def test_forces_are_positive_and_rise_so_no_mirror_image_was_met(material):
    for p in prior_draws(material, 20, seed=202):
        curves = shooting.solve(asked(material, p, WIDE))
        force = curves.force[curves.ok]
        assert np.all(force > 0)
        if material in (NeoHookean, Gent):
            assert np.all(np.diff(force) > 0)


def test_shooting_stops_at_the_fold_instead_of_jumping_to_a_state_stretched_tenfold():
    curves = shooting.solve(asked(MooneyRivlin, [10.44, -2.94], WIDE))
    assert curves.status[0].tolist() == [Status.OK] * 7 + [Status.INDEFINITE] * 3
    assert np.nanmax(curves.max_stretch) < 4


def test_loss_of_ellipticity_is_named():
    curves = shooting.solve(asked(Yeoh, [8.0, 0.0, -0.05], WIDE))
    assert curves.status[0].tolist() == [Status.OK] * 6 + [Status.NOT_ELLIPTIC] * 4


def test_locked_deflections_are_named_and_the_others_solved():
    curves = shooting.solve(asked(Gent, [5.0, 2.0], WIDE))
    assert curves.status[0].tolist() == [Status.OK] * 7 + [Status.LOCKED] * 3


def test_zero_deflection_has_a_stiffness_and_no_force():
    curves = solve(request(NeoHookean, [7.5], [0.0, 10 * MM], prestretch=1.1, solver="shooting", **RADII))
    other = solve(request(NeoHookean, [7.5], [0.0, 10 * MM], prestretch=1.1, **RADII))
    assert curves.force[0, 0] == 0
    assert curves.slope == pytest.approx(other.slope, rel=1e-6)


def test_order_signs_and_repeats_do_not_matter():
    mixed = np.array([20.0, -5.0, 20.0, 60.0, 5.0]) * MM
    curves = solve(request(NeoHookean, [7.5], mixed, solver="shooting", **RADII))
    single = [solve(request(NeoHookean, [7.5], d, solver="shooting", **RADII)).force[0, 0] for d in mixed]
    assert curves.force[0] == pytest.approx(single, rel=1e-8)


def test_next_to_a_film_that_is_lost_slopes_are_those_of_the_side_that_is_there():
    """A little softer and the film is no longer elliptic at its last deflections: no difference has both sides."""
    film, radii = [16.94512975, -4.12303456, 0.70933148], (0.008318723918681005, 0.04223791947291318)
    d = np.linspace(0.0225 / 21, 0.02250385410179133, 21)[-4:]
    softer = shooting.solve(request(Yeoh, np.array(film) * [1 - 1e-4, 1, 1], d, *radii))
    assert softer.status[0, -1] == Status.NOT_ELLIPTIC
    curves = shooting.solve(request(Yeoh, film, d, *radii, sensitivities=True))
    assert curves.ok.all()
    assert np.all(np.isfinite(curves.sensitivity))
    # The force is linear in all constants together: sum c_i dF/dc_i = F, to first order in the step.
    assert (curves.sensitivity @ film)[0] == pytest.approx(curves.force[0], rel=0.05)


def test_slopes_are_sought_where_there_is_a_force_and_nowhere_else(monkeypatch):
    """A lost deflection costs as much as many that are found, and would again for every step of every parameter."""
    lost, radii = [16.94, -4.9, 0.70933148], (0.008318723918681005, 0.04223791947291318)
    film = [16.94512975, -4.12303456, 0.70933148]
    d = np.linspace(0.0, 0.0225, 9)[1:]
    question = request(Yeoh, [film, lost], d, *radii, sensitivities=True)
    forces = shooting.solve(replace(question, sensitivities=False))
    assert forces.ok[0].all()
    assert 0 < np.count_nonzero(forces.ok[1]) < d.size
    solved, one_film = [], shooting._film

    def listening(asked, film, *more):
        solved.append(set(asked.deflection[film]))
        return one_film(asked, film, *more)

    monkeypatch.setattr(shooting, "_film", listening)
    curves = shooting.solve(question)
    assert set().union(*solved[3::2]) == set(d[forces.ok[1]])
    np.testing.assert_array_equal(np.isfinite(curves.sensitivity).all(axis=2), forces.ok)
    alone = shooting.solve(question.of([0]))
    np.testing.assert_array_equal(curves.sensitivity[:1], alone.sensitivity)
