"""Priors: normalised densities that agree with their distributions."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import ndtri

from bayesmembrane.ground.parameters import HalfNormal, LogNormal, Lomax, Normal, Prior, Uniform

PRIORS = [Normal(1.0, 2.0), Uniform(-1.0, 3.0), HalfNormal(0.3), HalfNormal(0.02, 1.0), LogNormal(2.0, 0.7), Lomax(0.4)]


@pytest.mark.parametrize("prior", PRIORS, ids=str)
def test_density_is_that_of_the_distribution(prior: Prior) -> None:
    d = prior.distribution()
    x = prior.draw(np.random.default_rng(1), 200)
    assert prior.log_density(x) == pytest.approx(d.logpdf(x), abs=1e-10)
    low, high = d.ppf([0.0, 1.0])
    below = low - 1.0 if np.isfinite(low) else -np.inf
    assert prior.log_density(below) == -np.inf
    near = prior.quantile([1e-6, 1 - 1e-6])
    mass, _ = quad(lambda v: float(np.exp(prior.log_density(v))), *near, limit=200)
    assert mass == pytest.approx(1.0, abs=1e-4)
    assert prior.quantile(0.5) == pytest.approx(d.median())
    above = high + 1.0 if np.isfinite(high) else np.inf
    assert prior.log_density(above) == -np.inf


@pytest.mark.parametrize("prior", PRIORS, ids=str)
def test_what_is_written_out_equals_scipy(prior: Prior) -> None:
    """Also the draws, to the last bits: stored seeds stay what they were."""
    d = prior.distribution()
    u = np.concatenate([[0.0, 1e-12, 1.0], np.random.default_rng(2).random(50)])
    assert prior.quantile(u) == pytest.approx(d.ppf(u), rel=1e-12)
    x = np.concatenate([d.ppf([0.0, 1e-9, 0.5, 1 - 1e-9, 1.0]), d.rvs(50, random_state=3), [d.mean() - 30 * d.std()]])
    assert prior.cdf(x) == pytest.approx(d.cdf(x), rel=1e-12, abs=1e-15)
    assert prior.mean_sd == pytest.approx((d.mean(), d.std()), rel=1e-12)
    assert prior.support == d.support()
    mine, others = prior.draw(np.random.default_rng(4), (3, 2)), d.rvs((3, 2), random_state=np.random.default_rng(4))
    assert mine == pytest.approx(others, rel=1e-15)


@pytest.mark.parametrize("prior", PRIORS, ids=str)
def test_a_multiple_has_the_multiple_of_every_quantile(prior: Prior) -> None:
    u = np.linspace(0.02, 0.98, 9)
    assert prior.times(30.0).quantile(u) == pytest.approx(30.0 * prior.quantile(u), rel=1e-12)
    x = prior.quantile(u)
    assert prior.times(30.0).log_density(30.0 * x) == pytest.approx(prior.log_density(x) - np.log(30.0), rel=1e-9)
    assert prior.times(1.0) == prior


@pytest.mark.parametrize("prior", PRIORS, ids=str)
def test_scores_are_normal(prior: Prior) -> None:
    """And are told back, also far out where probabilities have no digits on one side."""
    u = np.linspace(0.01, 0.99, 99)
    assert prior.scores(prior.quantile(u)) == pytest.approx(ndtri(u), abs=1e-9)
    low, high = prior.TOLD
    z = np.linspace(max(low, -7.0), min(high, 30.0), 80)
    if isinstance(prior, HalfNormal) and prior.origin:
        z = z[z > -5.0]  # a double does not tell sizes apart that are 1 and next to nothing
    assert prior.from_scores(0.0) == pytest.approx(prior.quantile(0.5))
    assert prior.scores(prior.from_scores(z)) == pytest.approx(
        z, rel=1e-6, abs=0.02 if prior.support[1] < np.inf else 1e-4
    )
    x = prior.from_scores(z)
    assert np.all(np.diff(x) >= 0)
