"""ln Z from ideal runs, whose volumes are exactly what nested sampling takes them for: no bias, and an honest error."""

import heapq
from collections.abc import Callable

import numpy as np
import pytest

from bayesmembrane.comparison.evidence.layers import log_integral

RUNS = 300


def ideal(log_likelihood: Callable[[float], float], live: int, steps: int, rng: np.random.Generator):
    """Likelihoods of dead and last points, and ln X of the dead, where L falls with the volume X alone."""
    heap = [-x for x in rng.random(live)]
    heapq.heapify(heap)
    dead = []
    for _ in range(steps):
        worst = -heap[0]
        dead.append(log_likelihood(worst))
        heapq.heapreplace(heap, -worst * rng.random())
    last = sorted(log_likelihood(-x) for x in heap)
    return np.array(dead + last), -np.log((live + 1) / live) * np.arange(1, steps + 1)


@pytest.mark.parametrize(
    ("shape", "live", "steps"),
    [
        (lambda x: float(np.log(0.5 + 0.5 * np.exp(-x / 0.2))), 80, 150),
        (lambda x: -0.4 * float(np.log(x + 1e-3)), 80, 400),
        (lambda x: -0.5 * x / np.pi / 0.05**2, 60, 800),
    ],
    ids=["near its prior", "with a peak", "far from its prior"],
)
def test_ideal_runs_have_no_bias_and_the_error_stated(shape, live, steps):
    rng, ln_x = np.random.default_rng(311), np.linspace(-30, 0, 100_001)
    weights = np.array([shape(x) for x in np.exp(ln_x)])
    exact = float(np.log(np.trapezoid(np.exp(weights + ln_x), ln_x)))
    found = np.array([log_integral(*ideal(shape, live, steps, rng), live) for _ in range(RUNS)])
    error, sd = found[:, 0] - exact, np.sqrt(np.mean(found[:, 1] ** 2))
    assert abs(np.mean(error)) < 5 * sd / np.sqrt(RUNS)
    assert np.std(error) == pytest.approx(sd, rel=0.25)


def test_a_constant_likelihood_is_its_own_integral():
    value, sd = log_integral(np.full(150, -3.0), -np.arange(1, 51) / 100, 100)
    assert value == pytest.approx(-3.0)
    assert sd == 0.0
