"""The emulator: exact where curves are polynomial, and a walk on it that keeps its own density."""

import numpy as np
import pytest

from bayesmembrane.calibration.posterior import Evaluation, Outcome
from bayesmembrane.calibration.sampling.proposals.emulator import DOUBT, emulate, monomials


class Cubic:
    """Curves F = (x1, x1 x2 + x2^3 / 10), measured as zero with unit noise, under a wide normal prior."""

    def evaluate(self, x: np.ndarray) -> Evaluation:
        force = np.stack([x[:, 0], x[:, 0] * x[:, 1] + x[:, 1] ** 3 / 10], axis=1)
        return Evaluation(np.zeros(len(x)), self.given(force, x), force, np.full(len(x), Outcome.OK, np.int8))

    def given(self, force: np.ndarray, x: np.ndarray) -> np.ndarray:
        return -0.5 * np.sum(force**2, axis=1) - 0.125 * np.sum(x**2, axis=1)


def draws(seed: int, size: int = 1500) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((size, 2)) * [1.0, 1.5]


def test_polynomial_curves_are_emulated_exactly() -> None:
    found = emulate(Cubic(), draws(0), np.random.default_rng(1))
    assert found is not None
    x = draws(2, 200)
    error = found.log_density(x) - Cubic().evaluate(x).log_posterior
    assert np.all(error > -1e-4)
    assert np.median(error) < 3 * DOUBT


def test_a_walk_keeps_the_emulated_density() -> None:
    """Walkers that are drawn from q stay so: importance weights of q / p make moments before and after equal."""
    found = emulate(Cubic(), draws(0), np.random.default_rng(1))
    assert found is not None
    grid = np.linspace(-8, 8, 161)
    x = np.stack(np.meshgrid(grid, grid, indexing="ij"), axis=-1).reshape(-1, 2)
    p = np.exp(found.log_density(x) - found.log_density(x).max())
    rng = np.random.default_rng(5)
    start = x[rng.choice(len(x), size=4000, p=p / p.sum())] + 0.1 * (rng.random((4000, 2)) - 0.5)
    end, factor = found.walk(start, rng, steps=25)
    assert np.mean(np.any(end != start, axis=1)) > 0.9
    for power in (1, 2):
        before, after = start**power, end**power
        assert np.all(np.abs(after.mean(0) - before.mean(0)) < 5 * before.std(0) * np.sqrt(2 / 4000))
    assert factor == pytest.approx(found.log_density(start) - found.log_density(end))


def test_too_few_possible_draws_teach_nothing() -> None:
    assert emulate(Cubic(), draws(0, 20), np.random.default_rng(0)) is None


def test_monomials_are_products() -> None:
    z = np.array([[2.0, 3.0]])
    terms = np.array([[0, 0], [0, 1], [1, 2], [2, 2]])
    assert monomials(z, terms).tolist() == [[4.0, 6.0, 3.0, 1.0]]
