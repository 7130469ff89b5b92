"""Where ensembles start."""

from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.calibration import starts
from bayesmembrane.calibration.objective import Objective
from bayesmembrane.calibration.posterior import Outcomes, Posterior
from bayesmembrane.calibration.starts import starting_points
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.data.shipped import shipped
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.rigs.uniaxial import Uniaxial


@pytest.mark.parametrize("seed", [1, 3])
def test_films_without_slopes_on_the_way_do_not_end_the_search(seed: int) -> None:
    """Some films next to the end of what is stable have forces and no slopes: a step from there was nan once."""
    curve = read_measurement(shipped("elastosil_50um_op1.csv"), shipped("elastosil_50um_op1.toml"))
    posterior = Posterior(hypothesis("yeoh", ["prestretch"]), curve)
    x = starting_points(posterior, np.random.default_rng(seed), 2, 20, Outcomes())
    assert np.all(np.isfinite(posterior.evaluate(x.reshape(-1, posterior.size)).log_posterior))


def test_noise_that_suits_a_film_is_that_of_its_solved_residual() -> None:
    """Films that the pool has solved are not solved again to see how far off they are."""
    curve = read_measurement(shipped("elastosil_50um_op1.csv"), shipped("elastosil_50um_op1.toml"))
    posterior = Posterior(hypothesis("gent"), curve)
    x = starts.candidates(posterior, np.random.default_rng(2))
    force = posterior.forward(x[:, :-1], reached=False).force
    with np.errstate(invalid="ignore"):
        rms = np.sqrt(np.mean((force - curve.force) ** 2, axis=1)) / np.max(curve.force)
    off = x[:, -1] - np.log(rms / posterior.hypothesis.noise.natural(np.zeros((1, 1)), 1.0)[0, 0])
    for some in (off[: starts.BROAD], off[-starts.CLOSE :]):  # seven of ten have it, give or take a half
        assert np.mean(np.abs(some[np.isfinite(some)]) < 1.5) > 0.6


def test_a_thousand_walkers_find_a_place_each() -> None:
    """They were more than the points that were tried, and were told that no film reaches the data."""
    curve = read_measurement(shipped("elastosil_50um_op1.csv"), shipped("elastosil_50um_op1.toml"))
    x = starting_points(Posterior(hypothesis("gent"), curve), np.random.default_rng(1), 2, 1024, Outcomes())
    assert len(np.unique(x.reshape(2048, -1), axis=0)) == 2048


def around(level: float, each: float = 1.0) -> Array:
    """(k,) how far draws around the valleys of a strip lie apart, read with noise of this part of its force."""
    d, rng = np.linspace(1e-3, 0.03, 30), np.random.default_rng(4)
    blank = Measurement(d, np.ones(30), Uniaxial(0.05, 0.01), Specimen("strip", 5e-4))
    claim = hypothesis("yeoh")
    force = Forward(claim, blank, d)(np.array([[5.0, -0.08, 0.006]]), reached=False).force[0]
    read = replace(blank, force=force + level * np.max(force) * rng.standard_normal(30))
    objective = Objective(claim, read, "euclidean", api.solve)
    pool, size = objective.pool(rng)
    draws = starts._around_valleys(objective, pool, size[0] / np.sqrt(30), each, rng)
    return np.subtract(*np.quantile(draws, [0.75, 0.25], axis=0))


def test_a_curve_that_is_read_more_finely_begins_as_much_closer() -> None:
    """Nearly noiseless curves were begun a thousand times too far, and walked for minutes (the fuzz, seed 22020)."""
    closer = around(1e-9) / around(1e-4)
    assert np.all(closer < 1e-4)
    assert np.all(closer > 1e-6)


def test_readings_that_stand_for_many_begin_closer_by_the_root_of_their_number() -> None:
    np.testing.assert_allclose(around(1e-4, 100.0) / around(1e-4), 0.1, rtol=0.05)


def test_the_spread_of_slopes_is_the_root_of_their_inverse() -> None:
    slopes = np.random.default_rng(0).standard_normal((3, 12, 5)) * np.logspace(0, 3, 5)
    usual = np.linalg.cholesky(np.linalg.inv(np.einsum("mnk,mnl->mkl", slopes, slopes)))
    np.testing.assert_allclose(starts.spread_of(slopes), usual, rtol=1e-8, atol=1e-12)
