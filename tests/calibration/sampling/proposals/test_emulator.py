"""The emulator: exact where curves are polynomial, and a walk on it that keeps its own density."""

from dataclasses import fields, replace
from itertools import combinations_with_replacement
from typing import cast

import numpy as np
import pytest

from bayesmembrane.calibration.posterior import Evaluation, Outcome, Posterior
from bayesmembrane.calibration.sampling.proposals.emulator import DOUBT, Emulator, Lookup, emulate, monomials
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.uniaxial import Uniaxial


class Cubic:
    """Curves F = (x1, x1 x2 + x2^3 / 10), measured as zero with unit noise, under a wide normal prior."""

    readings = 2

    def evaluate(self, x: np.ndarray) -> Evaluation:
        force = np.stack([x[:, 0], x[:, 0] * x[:, 1] + x[:, 1] ** 3 / 10], axis=1)
        return Evaluation(np.zeros(len(x)), self.given(force, x), np.full(len(x), Outcome.OK, np.int8), force)

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


def test_what_is_refused_anyway_is_not_looked_up() -> None:
    """A cut prior is asked for fewer proposals than are made, and the walk is the same as if it were for all."""
    rng = np.random.default_rng(2)
    found = emulate(Cubic(), draws(0, 400), rng)
    assert found is not None
    asked: list[int] = []

    def lookup(z: np.ndarray) -> np.ndarray:
        asked.append(len(z))
        return np.asarray(z[:, 0] < 0.5)

    cut = replace(found, lookup=cast(Lookup, lookup))
    start, steps = draws(3, 200), 50
    end, factor = cut.walk(start, np.random.default_rng(4), steps)
    few, asked[:] = sum(asked), []

    class Whole(Emulator):
        def log_density(self, x: np.ndarray, least: np.ndarray | float = -np.inf) -> np.ndarray:
            return super().log_density(x)

    whole = Whole(**{f.name: getattr(cut, f.name) for f in fields(cut)})
    same_end, same_factor = whole.walk(start, np.random.default_rng(4), steps)
    assert np.array_equal(end, same_end)
    assert np.array_equal(factor, same_factor)
    assert few < 0.8 * sum(asked)


def test_too_few_possible_draws_teach_nothing() -> None:
    assert emulate(Cubic(), draws(0, 20), np.random.default_rng(0)) is None


def test_monomials_are_products() -> None:
    z = np.array([[2.0, 3.0]])
    terms = np.array([[0, 0], [0, 1], [1, 2], [2, 2]])
    assert monomials(z, terms).tolist() == [[4.0, 6.0, 3.0, 1.0]]


@pytest.mark.parametrize(("count", "degree"), [(1, 1), (5, 2), (16, 3), (333, 4)])
def test_monomials_are_products_to_the_last_bit(count: int, degree: int) -> None:
    """From left to right as numpy multiplies, and laid out alike, so that sums of them are the same, too."""
    z = np.random.default_rng(degree).standard_normal((count, 3))
    z[0, 0] = np.nan
    terms = np.array(list(combinations_with_replacement(range(4), degree)))
    wide = np.concatenate([z, np.ones((count, 1))], axis=1)
    expected = wide[:, terms[:, 0]]
    for column in terms.T[1:]:
        expected = expected * wide[:, column]
    found = monomials(z, terms)
    assert np.array_equal(found, expected, equal_nan=True)
    assert found.flags.f_contiguous
    assert found.shape == (count, len(terms))


def test_along_the_axes_of_its_curves_a_posterior_is_the_same() -> None:
    """A long curve with noise of one size is told by few coordinates, without asking for all readings."""
    d = np.linspace(5e-4, 0.03, 140)
    # Whatever the readings: the identity holds for all.
    force = 40 * d + 0.004 * np.random.default_rng(1).standard_normal(d.size)
    posterior = Posterior(hypothesis("yeoh"), Measurement(d, force, Uniaxial(0.05, 0.01), Specimen("strip", 5e-4)))
    z = np.random.default_rng(2).standard_normal((200, 4))
    x = np.array([5.0, -0.08, 0.006, -4.0]) + z * [0.01, 0.005, 0.001, 0.1]
    found = emulate(posterior, x, np.random.default_rng(3))
    assert found is not None
    assert found.coefficients.shape[1] < d.size / 2
    full = posterior.evaluate(x)
    axes = np.linalg.svd(np.vstack([full.force, force]), full_matrices=False)[2]
    along = posterior.along(axes)
    assert along is not None
    np.testing.assert_allclose(along.given(full.force @ axes.T, x), full.log_posterior, rtol=1e-9)


def test_readings_that_weigh_differently_have_no_such_axes() -> None:
    d = np.linspace(5e-4, 0.03, 40)
    m = Measurement(d, 40 * d, Uniaxial(0.05, 0.01), Specimen("strip", 5e-4), force_sd=1e-3 * (1 + d / d[-1]))
    assert Posterior(hypothesis("yeoh"), m).along(np.eye(3, d.size)) is None


def test_curves_with_the_traces_of_effects_are_emulated_whole() -> None:
    """Noise that asks what each effect changes is told longer curves than those that were measured."""
    d = np.concatenate([np.linspace(1e-3, 0.03, 20), np.linspace(0.029, 2e-3, 20)])
    m = Measurement(d, 40 * d, Uniaxial(0.05, 0.01), Specimen("strip", 5e-4))
    posterior = Posterior(hypothesis("neo_hookean", ["force_gain", "mullins"], "form"), m)
    middle = np.array([float(p.prior.quantile(0.5)) for p in posterior.hypothesis.parameters])
    x = middle + 0.02 * np.random.default_rng(4).standard_normal((200, len(middle)))
    found = emulate(posterior, x, np.random.default_rng(5))
    assert found is not None
    assert found.coefficients.shape[1] == 3 * len(m)
    near = middle + 0.01 * np.random.default_rng(6).standard_normal((20, len(middle)))
    curves = monomials((near - found.centre) @ found.inverse.T, found.terms) @ found.coefficients
    truth = posterior.evaluate(near)
    np.testing.assert_allclose(curves[:, : len(m)], truth.force, atol=1e-3 * np.max(truth.force))
    assert np.all(np.isfinite(found.log_density(near)))
