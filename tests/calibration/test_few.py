"""The posterior of a long curve at few deflections is that of all its readings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.calibration.few import FewPosterior, weighing
from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.thinning import MOST
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from tests.physics.test_nodes import FILMS, long_curve

SD = 2e-3


def noisy(material: str) -> Measurement:
    m = long_curve(2 * MOST)
    curve = Forward(hypothesis(material), m, m.deflection)(np.array(FILMS[material][:1])).force[0]
    return replace(m, force=curve + SD * np.random.default_rng(8).standard_normal(len(m)))


@pytest.mark.parametrize("material", FILMS)
@pytest.mark.parametrize("stated", [False, True])
def test_chi_square_at_nodes_equals_that_of_all_readings(material: str, stated: bool) -> None:
    m = noisy(material)
    if stated:
        m = replace(m, force_sd=np.full(len(m), SD))
    posterior = Posterior(hypothesis(material), m)
    few = weighing(posterior)
    assert isinstance(few, FewPosterior)
    centre = np.concatenate([FILMS[material][0], [-6.0]])
    x = centre + 0.02 * np.random.default_rng(9).standard_normal((12, centre.size))
    x[0] = centre
    forces = Forward(posterior.hypothesis, m, m.deflection)(x[:, :-1]).force
    expected = posterior.noise.log_likelihood(m.force - forces, x[:, -1:])
    found = few.evaluate(x)
    ok = np.isfinite(found.log_likelihood)
    assert ok[0]
    np.testing.assert_allclose(found.log_likelihood[ok], expected[ok], rtol=1e-8, atol=1e-5)
    np.testing.assert_array_equal(found.log_prior, posterior.evaluate(x).log_prior)
    given = few.given(found.force[ok], x[ok])
    np.testing.assert_allclose(given, found.log_likelihood[ok] + few.prior.log_density(x[ok]), rtol=1e-12)


def test_a_walk_asks_for_no_more_numbers_than_there_are_nodes() -> None:
    posterior = Posterior(hypothesis("gent"), noisy("gent"))
    x = np.array([[2.0, 4.0, -6.0]])
    assert posterior.evaluate(x).force.shape == (1, len(posterior.measurement))
    assert weighing(posterior).evaluate(x).force.shape[1] < MOST // 10


def test_noise_that_tells_readings_apart_weighs_them_all() -> None:
    m = noisy("gent")
    remembers = Posterior(hypothesis("gent", noise="ar1"), m)
    assert weighing(remembers) is remembers
    uneven = Posterior(hypothesis("gent"), replace(m, force_sd=SD * (1.0 + m.deflection / 0.035)))
    assert weighing(uneven) is uneven
    short = Posterior(hypothesis("gent"), m.select(np.arange(0, len(m), 10)))
    assert weighing(short) is short
