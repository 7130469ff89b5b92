"""Whether the stated error of a reweighted evidence is right, where the truth is a closed form."""

import numpy as np
import pytest
from scipy.signal import lfilter

from bayesmembrane.comparison.prior_widths import _reweighted

SEEDS, ENSEMBLES, STEPS, WALKERS = 60, 4, 160, 8


def walked(rng: np.random.Generator, rho: float) -> np.ndarray:
    """Standard normal draws of AR(1) walkers, in the order in which a run keeps them."""
    e = rng.standard_normal((ENSEMBLES, STEPS, WALKERS)) * np.sqrt(1 - rho**2)
    e[:, 0] /= np.sqrt(1 - rho**2)
    return lfilter([1], [1, -rho], e, axis=1).ravel()


def judged(centre: float, sd: float, factor: float, rho: float) -> tuple[np.ndarray, int]:
    """Errors over stated errors where a change is stated, and how often it is refused.

    The prior is N(0, 1) and the posterior N(centre, sd^2): Z'/Z = E exp(a x^2) / factor with a = (1 - factor^-2) / 2.
    """
    a = 0.5 * (1 - factor**-2.0)
    b = 1 - 2 * a * sd**2
    truth = -np.log(factor) - 0.5 * np.log(b) + a * centre**2 / b
    z, refused = [], 0
    for seed in range(SEEDS):
        x = centre + sd * walked(np.random.default_rng([seed, 5]), rho)
        found = _reweighted("x", factor, a * x**2 - np.log(factor), (1 - rho) / (1 + rho), (0.0, 0.0))
        refused += found.unknown is not None
        if found.unknown is None:
            z.append((found.change - truth) / found.sd)
    return np.array(z), refused


# Tail indices of the weights are (1 - factor^-2) sd^2. Over 300 seeds the root mean squares of z are 0.3 to 1.1.
@pytest.mark.parametrize("rho", [0.0, 0.5])
@pytest.mark.parametrize(
    ("centre", "sd", "factor"), [(0.0, 0.3, 2.0), (0.0, 0.8, 2.0), (1.5, 0.5, 2.0), (1.0, 0.8, 0.5), (1.5, 0.5, 0.5)]
)
def test_stated_errors_are_those_made(centre: float, sd: float, factor: float, rho: float) -> None:
    z, refused = judged(centre, sd, factor, rho)
    assert refused < SEEDS / 2
    assert 0.15 < np.sqrt(np.mean(z**2)) < 1.7
    assert np.max(np.abs(z)) < 7


def test_weights_that_remember_longer_than_coordinates_have_a_larger_error() -> None:
    """The stated worth is that of independent draws, and the weights are not: batches tell."""
    rng, errors, stated = np.random.default_rng(8), [], []
    for _ in range(SEEDS):
        x = 0.5 * walked(rng, 0.9)
        found = _reweighted("x", 2.0, 0.375 * x**2 - np.log(2.0), 1.0, (0.0, 0.0))
        errors.append(found.change - (-np.log(2.0) - 0.5 * np.log(1 - 0.75 * 0.25)))
        stated.append(found.sd)
    assert np.sqrt(np.mean((np.array(errors) / stated) ** 2)) < 1.7


def test_a_posterior_that_is_its_prior_is_mostly_refused_a_wider_one() -> None:
    """The variance of the weights is infinite; what is answered all the same is not far off its error."""
    z, refused = judged(0.0, 1.0, 2.0, 0.0)
    assert refused > SEEDS / 10
    assert np.sqrt(np.mean(z**2)) < 4


def test_equal_weights_have_no_error_and_bounded_ones_no_tail() -> None:
    same = _reweighted("x", 1.0, np.zeros(1000), 1.0, (0.0, 0.0))
    assert (same.change, same.sd, same.unknown) == (0.0, 0.0, None)
    inside = np.where(np.arange(4000) % 4 > 0, np.log(2.0), -np.inf)
    half = _reweighted("x", 0.5, inside, 1.0, (0.0, 0.0))
    assert half.unknown is None
    assert half.change == pytest.approx(np.log(1.5))
    assert half.sd == pytest.approx(np.sqrt(1 / 3 / 4000), rel=0.1)
