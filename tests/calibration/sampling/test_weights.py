"""Importance weights: what they are worth, against what is known."""

import numpy as np
import pytest
from scipy.stats import norm, t

from bayesmembrane.calibration.sampling.weights import NOTHING, worth


def test_acceptance_equals_the_mean_over_all_pairs() -> None:
    w = np.random.default_rng(1).gamma(0.7, size=300)
    pairs = np.minimum(1.0, w[None, :] / w[:, None])  # from a state i, drawn with weight w_i, to a proposal j
    assert worth(np.log(w)).acceptance == pytest.approx(np.sum(w[:, None] * pairs) / (len(w) * np.sum(w)), rel=1e-12)


def test_weights_that_are_all_alike_are_perfect() -> None:
    found = worth(np.full(200, -3.0))
    assert found.efficiency == pytest.approx(1.0)
    assert found.acceptance == pytest.approx(1.0)
    assert found.tau == pytest.approx(1.0)
    assert found.log_mean == pytest.approx(-3.0)


def test_a_wider_proposal_is_good_and_a_narrower_one_is_not() -> None:
    """The weights of a normal of twice the spread are bounded; those of one of a third have the shape 1 - 1/9."""
    rng = np.random.default_rng(2)
    wide, narrow = 2.0 * rng.standard_normal(40_000), rng.standard_normal(40_000) / 3
    good = worth(norm.logpdf(wide) - norm.logpdf(wide, scale=2.0))
    bad = worth(norm.logpdf(narrow) - norm.logpdf(narrow, scale=1 / 3))
    assert good.good
    assert good.k_hat < 0.3
    assert not bad.good


def test_the_mean_weight_is_the_integral_within_its_error() -> None:
    x = t.rvs(5, size=20_000, random_state=np.random.default_rng(3))
    found = worth(norm.logpdf(x) + 1.7 - t.logpdf(x, 5))
    assert found.log_mean == pytest.approx(1.7, abs=5 * found.log_mean_sd)
    assert found.log_mean_sd < 0.01


def test_impossible_draws_count_and_missing_ones_do_not() -> None:
    lw = np.concatenate([np.zeros(150), np.full(50, -np.inf), np.full(30, np.nan)])
    found = worth(lw)
    assert found.efficiency == pytest.approx(0.75)
    assert found.log_mean == pytest.approx(np.log(0.75))


def test_a_handful_says_nothing() -> None:
    assert worth(np.zeros(20)) is NOTHING
    assert not NOTHING.good
