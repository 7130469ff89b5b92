"""Components where weights are largest: the tails of what a mixture misses, and sums that stay right."""

import numpy as np
import pytest
from scipy.stats import norm

from bayesmembrane.calibration.sampling.proposals.filling import EACH, FIRST, NEW, TURNS, filled, joined
from bayesmembrane.calibration.sampling.proposals.mixture import Mixture
from bayesmembrane.calibration.sampling.weights import worth


def narrow(spread: float = 0.6) -> Mixture:
    return Mixture(np.zeros(1), np.zeros((1, 2)), spread * np.eye(2)[None], 10.0)


def bent(x: np.ndarray) -> np.ndarray:
    """N(0, 1) times N(x1^2, 0.3^2), cut where x1 > 2."""
    value = norm.logpdf(x[:, 0]) + norm.logpdf(x[:, 1], x[:, 0] ** 2, 0.3)
    return np.asarray(np.where(x[:, 0] > 2.0, -np.inf, value))


def test_what_a_mixture_misses_is_filled() -> None:
    """Of a bent ridge beyond its tails; weights of fresh draws have a short tail and the integral that is known."""
    rng = np.random.default_rng(3)
    x = narrow().draw(rng, 4000)
    before = worth(bent(x) - narrow().log_density(x))
    found = filled(narrow(), bent, rng)
    y = found.mixture.draw(rng, 20_000)
    after = worth(bent(y) - found.mixture.log_density(y))
    assert after.k_hat < min(0.5, before.k_hat)
    assert after.efficiency > 1.5 * before.efficiency
    assert after.log_mean == pytest.approx(norm.logcdf(2.0), abs=5 * after.log_mean_sd)


def test_weights_are_those_of_the_whole_mixture() -> None:
    found = filled(narrow(), bent, np.random.default_rng(4))
    assert FIRST < len(found.x) <= FIRST + EACH * TURNS
    assert len(found.mixture.means) <= 1 + NEW * TURNS
    assert np.array_equal(found.log_posterior, bent(found.x))
    expected = found.log_posterior - found.mixture.log_density(found.x)
    # The mixture takes the heaviest tails for all of its parts, and so is not to the last digit what was drawn from.
    ok = np.isfinite(expected)
    assert np.median(np.abs(found.log_weights[ok] - expected[ok])) < 0.1
    assert np.array_equal(ok, np.isfinite(found.log_weights))


def test_joined_is_the_weighted_sum() -> None:
    a, b = narrow(0.5), narrow(2.0)
    x = np.random.default_rng(5).standard_normal((50, 2))
    both = np.logaddexp(np.log(0.25) + a.log_density(x), np.log(0.75) + b.log_density(x))
    assert np.allclose(joined([(a, 1.0), (b, 3.0)]).log_density(x), both, rtol=1e-12)


def test_nothing_possible_leaves_the_mixture_as_it_was() -> None:
    found = filled(narrow(), lambda x: np.full(len(x), -np.inf), np.random.default_rng(6))
    assert len(found.mixture.means) == 1
    assert len(found.x) == FIRST
