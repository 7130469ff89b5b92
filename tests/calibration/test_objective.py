"""What least squares minimises, and a search of it."""

import numpy as np

from bayesmembrane.calibration.objective import Objective
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.registry import component
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.mechanics.request import Spared


def test_a_search_ends_where_the_film_is_slack_whatever_its_parameters() -> None:
    """The loss is level there: a step of zero by zero would be nan, and so would all that follows."""
    deflection = np.linspace(5e-5, 1e-3, 12)
    strip = Measurement(deflection, 40.0 * deflection, component("rigs", "equibiaxial")(), Specimen("strip", 5e-5))
    objective = Objective(hypothesis("neo_hookean", ["clamp_slip"]), strip, "euclidean", api.solve)
    slips = objective.centre.copy()
    names = [p.name for p in objective.parameters]
    slips[names.index("clamp_slip.slip")], slips[names.index("clamp_slip.jump")] = 0.4, 0.0
    r, jacobian = objective(slips)
    np.testing.assert_array_equal(r, -strip.force)
    assert not np.any(jacobian)
    x, size, status = objective.polish(slips)
    np.testing.assert_allclose(x, slips, rtol=1e-5, atol=2e-6)
    assert size == np.linalg.norm(strip.force)
    assert status == "converged"


def test_films_that_are_not_spared_have_the_same_residuals_and_those_that_are_are_not_elliptic() -> None:
    d = np.linspace(2e-3, 40e-3, 9)
    ring = Measurement(d, 20.0 * d, component("rigs", "annulus")(0.010, 0.035), Specimen("ring", 5e-5))
    every = Objective(hypothesis("mooney_rivlin"), ring, "euclidean", api.solve)
    fewer = Objective(hypothesis("mooney_rivlin"), ring, "euclidean", api.solve, Spared.NOT_ELLIPTIC)
    x = np.random.default_rng(3301).uniform(every.low, every.high, (200, every.low.size))
    (r, slopes), (some, fewer_slopes) = every.batch(x), fewer.batch(x)
    both = np.all(np.isfinite(some), axis=1)
    assert np.count_nonzero(both) > 20
    np.testing.assert_allclose(some[both], r[both], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(fewer_slopes[both], slopes[both], rtol=1e-6, atol=1e-9)
    spared = np.all(np.isfinite(r), axis=1) & ~both
    assert np.any(spared)
    assert np.all(every.forward(x[spared], reached=False).ellipticity < 0)
    assert not np.any(np.isfinite(some[~np.all(np.isfinite(r), axis=1)]).all(axis=1))
