"""What least squares minimises, and a search of it."""

import numpy as np

from bayesmembrane.calibration.objective import Objective
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.registry import component
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics import api


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
