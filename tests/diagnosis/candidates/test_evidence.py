"""ln Z of a linear model against dense matrices and against integration."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import approx_fprime, minimize
from scipy.stats import multivariate_normal, norm

from bayesmembrane.diagnosis.candidates.evidence import Block, Linear, log_inside, tempered, weighed


def model(seed: int, n: int = 60, size: float = 1.0) -> Linear:
    rng = np.random.default_rng(seed)
    own, state, law = (rng.standard_normal((n, k)) for k in (3, 4, 5))
    data = own @ rng.standard_normal(3) + size * state @ rng.standard_normal(4) + rng.standard_normal(n)
    return Linear(data, (Block(3 * own), Block(state, (-1.0, 1.0)), Block(law, (-2.0, 1.0))), 0.25)


def dense(linear: Linear, theta: np.ndarray) -> float:
    n = linear.data.size
    covariance = np.exp(2 * theta[0]) * np.eye(n)
    etas = iter(theta[1:])
    for b in linear.blocks:
        covariance += (1.0 if b.ln_eta is None else np.exp(2 * next(etas))) * b.columns @ b.columns.T
    prior = norm.logpdf(theta, linear.priors[:, 0], linear.priors[:, 1]).sum()
    return float(multivariate_normal.logpdf(linear.data, np.zeros(n), covariance) + prior)


@pytest.mark.parametrize("theta", [(0.0, -1.0, -2.0), (0.3, 0.5, -4.0), (-0.4, -6.0, 0.1)])
def test_the_density_equals_that_of_the_dense_covariance(theta) -> None:
    linear = model(1)
    assert linear.log_density(np.array(theta)).value == pytest.approx(dense(linear, np.array(theta)), abs=1e-8)


@pytest.mark.parametrize("counts", [1.0, 0.4])
def test_slopes_are_those_of_the_density(counts: float) -> None:
    linear, theta = tempered(model(2), counts), np.array([0.1, -0.7, -1.5])
    numeric = approx_fprime(theta, lambda t: linear.log_density(t).value, 1e-6)
    assert linear.log_density(theta).slope == pytest.approx(numeric, rel=1e-4, abs=1e-4)


@pytest.mark.parametrize("counts", [1.0, 0.4])
def test_second_derivatives_are_those_of_the_slopes(counts: float) -> None:
    linear, theta = tempered(model(2), counts), np.array([0.1, -0.7, -1.5])
    numeric = approx_fprime(theta, lambda t: linear.log_density(t).slope, 1e-6)
    assert linear.log_density(theta).bend == pytest.approx(numeric, rel=1e-4, abs=1e-4)


@pytest.mark.parametrize("counts", [1.0, 0.7, 0.2])
def test_a_tempered_density_has_its_prior_whole(counts: float) -> None:
    """int p(c) L(c)^a dc of one coefficient, by quadrature."""
    rng, s, eta = np.random.default_rng(3), 1.3, 0.6
    column = rng.standard_normal(12)
    data = 0.8 * column + rng.standard_normal(12)
    linear = tempered(Linear(data, (Block(column[:, None], (-1.0, 1.0)),), 0.25), counts)
    theta = np.log([s, eta])

    def density(c: float) -> float:
        return float(norm.pdf(c, 0, eta) * np.exp(counts * norm.logpdf(data, c * column, s).sum()))

    expected = np.log(quad(density, -6, 6, epsabs=0)[0]) + norm.logpdf(theta, [0.0, -1.0], [0.25, 1.0]).sum()
    assert linear.log_density(theta).value == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("seed", range(8))
def test_the_most_probable_sizes_are_those_of_another_search(seed) -> None:
    linear = model(seed, size=(0.0, 0.3, 3.0)[seed % 3])
    low, high = linear.ends
    other = max(
        -minimize(lambda t: -linear.log_density(t).value, begin, bounds=list(zip(low, high, strict=True))).fun
        for begin in (linear.priors[:, 0], 0.5 * (low + linear.priors[:, 0]), np.zeros(3))
    )
    assert linear.log_density(weighed(linear).theta).value == pytest.approx(other, abs=1e-4)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("left", [3.0, 10.0, 30.0])
@pytest.mark.parametrize("scale", [100.0, 700.0, 3000.0])
def test_an_energy_that_is_far_off_is_found(seed, left, scale) -> None:
    """ln p has several tops: where the energy has no error noise takes what is left, and the slope says nothing."""
    rng, along = np.random.default_rng(seed), np.polynomial.legendre.legvander(np.linspace(-1, 1, 70), 6)
    own, state = 1e3 * along[:, :3], scale * along * np.exp(-0.7 * np.arange(7))
    data = own @ rng.standard_normal(3) + left * (along[:, 3] + 0.5 * rng.standard_normal() * along[:, 5])
    law = Block(scale / 10 * along[:, 1:3], (-5.8, 2.0), np.log(0.4))
    linear = Linear(data + rng.standard_normal(70), (Block(own), Block(state, (-8.1, 2.5), 0.0), law), 0.25)
    sizes = [np.array([s, a, e]) for s in (0.0, 0.5) for a in (-8.0, -5.0, -3.0, -1.0) for e in (-6.0, -3.0)]
    found = [
        minimize(
            lambda t: -linear.log_density(t).value, t, method="L-BFGS-B", bounds=list(zip(*linear.ends, strict=True))
        )
        for t in sizes
    ]
    assert linear.log_density(weighed(linear).theta).value > -min(f.fun for f in found) - 0.05


def test_coefficients_are_those_of_a_ridge_regression() -> None:
    linear, theta = model(3), np.array([0.2, -0.5, -1.0])
    columns = np.column_stack([b.columns for b in linear.blocks])
    precision = columns.T @ columns / np.exp(0.4) + np.diag(1 / linear.variances(theta))
    mean, covariance = linear.coefficients(theta)
    assert covariance == pytest.approx(np.linalg.inv(precision), abs=1e-9)
    assert mean == pytest.approx(np.linalg.solve(precision, columns.T @ linear.data / np.exp(0.4)), abs=1e-9)


def test_freed_values_are_those_of_the_inverse() -> None:
    linear, theta = model(4), np.array([0.2, -0.5, -1.0])
    columns = np.column_stack([b.columns for b in linear.blocks])
    whole = np.exp(0.4) * np.eye(60) + columns * linear.variances(theta) @ columns.T
    values = np.random.default_rng(0).standard_normal((60, 2))
    assert linear.freed(theta, values) == pytest.approx(np.linalg.solve(whole, values), abs=1e-9)


@pytest.mark.parametrize("size", [0.0, 0.3, 3.0])
def test_the_evidence_integrates_the_size_of_a_form_error(size) -> None:
    """Noise nearly fixed and one block: the integral over ln eta is one of a single variable."""
    whole = model(5, size=size)
    linear = Linear(whole.data, whole.blocks[:2], 1e-4)
    top = weighed(linear)

    def density(t: float) -> float:
        return float(np.exp(linear.log_density(np.array([0.0, t])).value - top.log_evidence))

    # ln s is normal with so small a deviation that it integrates to one.
    ratio = quad(density, -7, 5, limit=200)[0] * 1e-4 * np.sqrt(2 * np.pi)
    assert np.log(ratio) == pytest.approx(0.0, abs=0.15)


def test_bounds_take_what_lies_beyond_them() -> None:
    covariance = np.array([[1.0, 0.6], [0.6, 2.0]])
    mean, low = np.array([0.3, -0.4]), np.array([0.0, -1.0])
    high = np.full(2, np.inf)
    rng = np.random.default_rng(1)
    draws = rng.multivariate_normal(mean, covariance, 400_000)
    inside = np.mean(np.all(draws > low, axis=1))
    assert log_inside(mean, covariance, low, high) == pytest.approx(np.log(inside), abs=0.02)
    assert log_inside(mean, covariance, low - 100, high) == 0.0


def test_a_tail_far_beyond_a_bound_is_a_tail() -> None:
    found = log_inside(np.array([-12.0]), np.eye(1), np.zeros(1), np.full(1, np.inf))
    assert found == pytest.approx(norm.logsf(12.0), rel=1e-9)


def test_columns_that_are_turned_say_the_same() -> None:
    """Single readings beside noise that remembers, and the same ones turned until they are orthogonal."""
    plain = model(7)
    rng = np.random.default_rng(3)
    alike = np.eye(60)[:, 20:45] + 0.4 * np.eye(60, k=-1)[:, 20:45]
    turn = np.linalg.eigh(alike.T @ alike)[1]
    prior = (-1.0, 1.5)
    models = [
        replace(plain, blocks=(*plain.blocks[:1], block, *plain.blocks[1:]))
        for block in (Block(alike, prior), Block(alike @ turn, prior, turn=turn))
    ]
    theta = np.linspace(-1.0, 0.2, len(models[0].priors))
    one, other = (m.log_density(theta) for m in models)
    assert other.value == pytest.approx(one.value, rel=1e-12)
    assert other.slope == pytest.approx(one.slope, rel=1e-9, abs=1e-9)
    assert other.bend == pytest.approx(one.bend, rel=1e-9, abs=1e-9)
    for a, b in zip(models[0].coefficients(theta), models[1].coefficients(theta), strict=True):
        assert b == pytest.approx(a, rel=1e-8, abs=1e-10)
    assert models[1].mean(theta) == pytest.approx(models[0].mean(theta), rel=1e-8, abs=1e-10)
    values = rng.standard_normal((60, 2))
    assert models[1].freed(theta, values) == pytest.approx(models[0].freed(theta, values), rel=1e-9, abs=1e-11)
