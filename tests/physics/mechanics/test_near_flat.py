"""Forces of a film that is all but flat: a drive that comes back to rest reads some nanometres."""

import numpy as np
import pytest

from bayesmembrane.ground.registry import materials, ordinary_materials
from bayesmembrane.physics.mechanics.api import solve
from bayesmembrane.physics.mechanics.near_flat import FLAT
from bayesmembrane.physics.mechanics.request import request
from bayesmembrane.physics.mechanics.ritz import solver as ritz
from bayesmembrane.physics.mechanics.solution import Status
from tests.physics.mechanics.films import SILICONE

RIGS = ((0.010, 0.035), (0.0086, 0.0486), (0.020, 0.023), (0.003, 0.060), (0.002, 0.120))
STRETCHES = (1.0, 1 + 1e-9, 1 + 1e-7, 1 + 1e-5, 1.001, 1.05)


def asked(name, deflection, inner, outer, **more):
    parameters = materials()[name].from_vector(np.array(SILICONE[name])).vector
    return request(materials()[name], parameters, deflection, inner, outer, **more)


@pytest.mark.parametrize("name", sorted(ordinary_materials()))
@pytest.mark.parametrize(("inner", "outer"), RIGS)
def test_every_film_has_a_force_however_little_it_is_lifted(name, inner, outer):
    d = (outer - inner) * np.array([1.0, 10.0, 1e2, 1e4, 3e5, 1e7, 5e7]) * 1e-8
    for l0 in STRETCHES:
        found = solve(asked(name, [0.0, *d, *-d], inner, outer, prestretch=l0))
        assert np.all(found.status == Status.OK), l0
        force = found.force[0]
        assert force[0] == 0.0
        assert np.all(np.diff(force[: d.size + 1]) > 0)
        np.testing.assert_array_equal(force[d.size + 1 :], -force[1 : d.size + 1])


@pytest.mark.parametrize(("inner", "outer"), RIGS)
@pytest.mark.parametrize("l0", [1.0, 1.001, 1.05])
def test_the_law_of_a_flat_film_equals_what_the_solver_finds_where_it_finds_it(inner, outer, l0):
    d = (outer - inner) * FLAT * np.array([0.3, 0.5, 0.7, 0.999])
    found = asked("mooney_rivlin", d, inner, outer, prestretch=l0, sensitivities=True)
    law, solved = solve(found), ritz.solve(found)
    ok = solved.status == Status.OK
    assert np.any(ok)
    for name in ("force", "slope", "sensitivity"):
        np.testing.assert_allclose(getattr(law, name)[ok], getattr(solved, name)[ok], rtol=2e-5)
    np.testing.assert_allclose(law.energy[ok], solved.energy[ok], rtol=1e-6, atol=1e-6 * np.max(solved.energy[ok]))
    np.testing.assert_allclose(law.max_stretch[ok], solved.max_stretch[ok], rtol=1e-9)


@pytest.mark.parametrize("name", sorted(ordinary_materials()))
@pytest.mark.parametrize(("inner", "outer"), RIGS)
@pytest.mark.parametrize("l0", [1.0, 1 + 3e-8, 1 + 1e-6, 1.05])
def test_force_and_sensitivities_go_on_from_the_solver_s(name, inner, outer, l0):
    """On the two sides of `FLAT`, each followed along its slope to the boundary."""
    least, step = FLAT * (outer - inner), 1e-6
    found = solve(asked(name, least * np.array([1 - step, 1 + step]), inner, outer, prestretch=l0, sensitivities=True))
    (below, above), (rise, _) = found.force[0], found.slope[0]
    assert below + 2 * step * least * rise == pytest.approx(above, rel=1e-6)
    parameters = np.abs(np.array(SILICONE[name]))
    np.testing.assert_allclose(*(found.sensitivity[0] * parameters / found.force[0][:, None]), rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("l0", [1.0, 1 + 3e-8, 1 + 1e-6, 1.05])
def test_energy_force_and_slope_are_derivatives_of_one_another(l0):
    least = FLAT * 0.025
    d = least * np.linspace(0.2, 1.0, 50)
    found = solve(asked("neo_hookean", d, 0.010, 0.035, prestretch=l0))
    force, slope = found.force[0], found.slope[0]
    middle = 0.5 * (d[1:] + d[:-1])
    at = solve(asked("neo_hookean", middle, 0.010, 0.035, prestretch=l0))
    np.testing.assert_allclose(np.diff(force) / np.diff(d), at.slope[0], rtol=1e-3)
    assert np.all(slope > 0)
    flat = solve(asked("neo_hookean", [0.0], 0.010, 0.035, prestretch=l0)).energy[0, 0]
    done = found.energy[0, 0] + np.concatenate([[0.0], np.cumsum(np.diff(d) * at.force[0])])
    np.testing.assert_allclose(found.energy[0] - flat, done - flat, rtol=1e-3, atol=1e-13 * abs(flat))


@pytest.mark.filterwarnings("error")
def test_a_slack_film_at_rest_beside_a_taut_one_warns_of_nothing():
    two = np.array([SILICONE["neo_hookean"]] * 2)
    found = solve(
        request(materials()["neo_hookean"], two, [0.0, 1e-9, 1e-6, 1e-3], 0.010, 0.035, prestretch=[1 - 1e-13, 1.0])
    )
    assert np.all(np.isfinite(found.force[1]))


@pytest.mark.parametrize("name", sorted(ordinary_materials()))
@pytest.mark.parametrize("apart", [1e-10, 1e-9, 2e-9, 5e-9, 2e-8, 1e-7, 1e-6])
def test_readings_that_are_nanometres_apart_have_the_forces_of_those_alone(name, apart):
    up = np.linspace(0.0, 12.5e-3, 36)[1:]
    alone = ritz.solve(asked(name, up, 0.0113, 0.0226))
    both = ritz.solve(asked(name, np.sort(np.concatenate([up, up + apart])), 0.0113, 0.0226))
    assert np.all(both.status == Status.OK)
    np.testing.assert_allclose(both.force[0, ::2], alone.force[0], rtol=1e-8)
