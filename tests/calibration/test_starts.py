"""Where ensembles start."""

import numpy as np
import pytest

from bayesmembrane.calibration.posterior import Outcomes, Posterior
from bayesmembrane.calibration.starts import starting_points
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.data.shipped import shipped
from bayesmembrane.physics.hypothesis import hypothesis


@pytest.mark.parametrize("seed", [1, 3])
def test_films_without_slopes_on_the_way_do_not_end_the_search(seed: int) -> None:
    """Some films next to the end of what is stable have forces and no slopes: a step from there was nan once."""
    curve = read_measurement(shipped("elastosil_50um_op1.csv"), shipped("elastosil_50um_op1.toml"))
    posterior = Posterior(hypothesis("yeoh", ["prestretch"]), curve)
    x = starting_points(posterior, np.random.default_rng(seed), 2, 20, Outcomes())
    assert np.all(np.isfinite(posterior.evaluate(x.reshape(-1, posterior.size)).log_posterior))
