"""The moves of an ensemble leave a distribution as it is, also one that ends at a sharp cut.

The errors are those of independent ensembles, so that they need no autocorrelation time: with 20 of them a t-value of 7
is met by chance in one of a million; it is 1.4 % of the second moment of x3, 0.7 % of its standard deviation.
"""

import emcee
import numpy as np

from bayesmembrane.calibration.sampling.proposals.ensemble import ensemble_moves
from bayesmembrane.calibration.sampling.proposals.snooker import Snooker

SIZE, ENSEMBLES, WALKERS, STEPS = 4, 20, 576, 400
LIMIT = 7.0
# Of x0 in the wedge |x1| < x0 with x ~ N(0, 1): the two rotated by 45 degrees are independent half-normals.
MEAN = np.sqrt(2) * np.sqrt(2 / np.pi)
SECOND = 1 + 2 / np.pi  # of x0: (u + v)^2 / 2 with E u^2 = 1 and E u v = 2 / pi


def log_wedge(x):
    return np.where(np.abs(x[:, 1]) < x[:, 0], -0.5 * np.sum(x * x, axis=1), -np.inf)


def start(rng):
    x = rng.standard_normal((WALKERS, SIZE))
    u, v = np.abs(x[:, 0]), np.abs(x[:, 1])
    x[:, 0], x[:, 1] = (u + v) / np.sqrt(2), (u - v) / np.sqrt(2)
    return x


def moments(moves, seed):
    """(ENSEMBLES, 3): mean of x0, of x0^2 and of x3^2, each from an ensemble that starts in equilibrium."""
    out = np.empty((ENSEMBLES, 3))
    for i in range(ENSEMBLES):
        rng = np.random.default_rng([seed, i])
        sampler = emcee.EnsembleSampler(WALKERS, SIZE, log_wedge, moves=moves, vectorize=True)
        begin = emcee.State(start(rng), random_state=np.random.RandomState(int(rng.integers(2**31))).get_state())
        sums = np.zeros(3)
        for state in sampler.sample(begin, iterations=STEPS, store=False):
            x = state.coords
            sums += np.mean([x[:, 0], x[:, 0] ** 2, x[:, 3] ** 2], axis=1)
        out[i] = sums / STEPS
    return out


def t_values(found):
    return (np.mean(found, axis=0) - [MEAN, SECOND, 1.0]) / (np.std(found, axis=0, ddof=1) / np.sqrt(len(found)))


def test_a_cut_wedge_is_left_as_it_is():
    found = moments(ensemble_moves(1.0), seed=2607)
    assert np.all(np.abs(t_values(found)) < LIMIT)


def test_a_walker_on_its_anchor_stays():
    x = np.ones((3, 2))
    y, factor = Snooker().get_proposal(x, [np.ones((4, 2))], np.random.RandomState(0))
    np.testing.assert_array_equal(y, x)
    assert np.all(factor == -np.inf)
