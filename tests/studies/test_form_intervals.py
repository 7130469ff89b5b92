"""The study of intervals: priors as squares, and the grid of the noise."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.special import logsumexp

from bayesmembrane.ground.parameters import HalfNormal, Lomax, Normal, Parameter, Uniform
from bayesmembrane.physics.hypothesis import hypothesis
from tests.studies.form_intervals import COARSE, RATIOS, _nodes, pulls

PRIORS = [
    (Normal(0.9, 0.15), (0.4, 1.4), 0.9),
    (HalfNormal(0.1), (0.0, 3.0), 0.0),
    (Lomax(5e-4), (0.0, 1e-2), 0.0),
    (Uniform(0.0, 1.0), (0.0, 1.0), None),
]


@pytest.mark.parametrize(("prior", "bounds", "mode"), PRIORS, ids=lambda p: type(p).__name__)
def test_half_the_square_of_a_pull_is_what_the_prior_lies_below_its_mode(prior, bounds, mode) -> None:  # type: ignore[no-untyped-def]
    objective = SimpleNamespace(
        parameters=[Parameter("p", "-", "one of them", prior, bounds)], spread=prior.mean_sd[1:]
    )
    x = prior.quantile(np.array([0.1, 0.3, 0.7, 0.999]))[:, None]
    r, by_x = pulls(cast(Any, objective), x)
    if mode is None:
        assert not np.any(r)
        assert np.all((by_x > 0) & (by_x < 1))
        return
    below = prior.log_density(mode) - prior.log_density(x[:, 0])
    assert 0.5 * r[:, 0] ** 2 == pytest.approx(below, rel=1e-3, abs=1e-3)
    h = 1e-4 * prior.mean_sd[1]
    high, low = (pulls(cast(Any, objective), x + s)[0] for s in (h, -h))
    assert by_x == pytest.approx((high - low) / (2 * h), rel=1e-3)


@pytest.mark.parametrize("noise", ["form", "form_ar1"])
def test_the_error_where_nothing_is_steady_has_its_whole_prior_at_each_size_of_the_noise(noise: str) -> None:
    h = hypothesis("neo_hookean", (), noise)
    nodes, log_prior, louder = _nodes(h, 3e-3 * np.random.default_rng(1).standard_normal(50), 1.0, COARSE)
    assert nodes.shape == (len(louder), len(h.noise.coordinates))
    assert np.unique(louder) == pytest.approx(np.exp(RATIOS))
    rest = [i for i in range(nodes.shape[1]) if i != 2]
    _, place = np.unique(nodes[:, rest].round(9), axis=0, return_inverse=True)
    for one in range(0, int(place.max()), 37):
        some = np.flatnonzero(place.ravel() == one)
        others = sum(h.noise.coordinates[i].prior.log_density(nodes[some[:1], i])[0] for i in rest)
        assert logsumexp(log_prior[some]) == pytest.approx(others, abs=1e-9)
