"""Neighbouring residuals: alike where a misfit is smooth, and not where there is noise alone."""

import numpy as np

from bayesmembrane.calibration.checks import alike, directions, lag_1
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.thinning import MOST
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.noise.ar1 import AR1
from bayesmembrane.physics.noise.white import White
from bayesmembrane.physics.rigs.annulus import Annulus

N, DRAWS, SD = 40, 200, 0.01
D = np.linspace(1e-3, 0.04, N)
M = Measurement(D, 50 * D, Annulus(0.010, 0.035), Specimen("film", 50e-6))
SHAPES = np.stack([D, D**2]) / np.max(D)
X = np.full((DRAWS, 1), np.log(SD / np.max(M.force)))


def fitted(noise: Array, rng: np.random.Generator) -> Array:
    """(B, N) residuals of draws of a curve with two parameters, fitted to ``noise`` (N,)."""
    q = np.linalg.qr(SHAPES.T)[0]
    return noise - q @ (q.T @ noise) - SD * rng.standard_normal((DRAWS, 2)) @ q.T


def p_value(noise: Array, rng: np.random.Generator) -> float:
    return alike(White(), White().bind(M), fitted(noise, rng), X, 2, rng).p_value


def test_correlation_of_neighbours_is_what_it_says() -> None:
    z = np.array([[1.0, -1.0, 1.0, -1.0], [1.0, 1.0, 1.0, 1.0], [0.0, 0.0, 0.0, 0.0]])
    assert lag_1(z).tolist() == [-0.75, 0.75, 0.0]


def test_noise_alone_gives_uniform_p_values() -> None:
    """The mean of 300 uniform numbers has the standard deviation 0.017; a tenth is six of them."""
    rng = np.random.default_rng(5)
    found = np.array([p_value(SD * rng.standard_normal(N), rng) for _ in range(300)])
    assert abs(np.mean(found) - 0.5) < 0.1
    assert np.mean(found < 0.01) < 0.07


def test_a_smooth_misfit_is_seen_and_the_same_in_another_order_is_not() -> None:
    rng = np.random.default_rng(6)
    wave = SD * np.sqrt(2) * np.sin(np.linspace(0, 6 * np.pi, N))
    assert p_value(wave, rng) < 0.006
    assert p_value(wave[17 * np.arange(N) % N], rng) > 0.5


def test_noise_that_remembers_explains_neighbours_that_are_alike() -> None:
    """The mean of 40 uniform numbers has the standard deviation 0.046."""
    rng = np.random.default_rng(7)
    x = np.column_stack([X, np.full(DRAWS, 1.0)])
    bound = AR1().bind(M)
    paths = bound.draw(x[:40], rng)
    remembers = [alike(AR1(), bound, np.tile(path, (DRAWS, 1)), x, 0, rng) for path in paths]
    forgets = [alike(White(), White().bind(M), np.tile(path, (DRAWS, 1)), X, 0, rng) for path in paths]
    assert remembers[0].noise == "ar1"
    assert remembers[0].expected > 0.4 > 0.1 > forgets[0].expected
    assert abs(np.mean([f.p_value for f in remembers]) - 0.5) < 0.28
    assert np.mean([f.p_value for f in forgets]) < 0.05


def test_principal_directions_of_long_rows_are_those_of_the_decomposition() -> None:
    rng = np.random.default_rng(6)
    rows = (rng.standard_normal((30, 4)) * [9.0, 4.0, 2.0, 1.0]) @ rng.standard_normal((4, MOST + 700))
    rows += 1e-3 * rng.standard_normal(rows.shape)
    found, expected = directions(rows, 4), np.linalg.svd(rows, full_matrices=False)[2][:4]
    np.testing.assert_allclose(found @ found.T, np.eye(4), atol=1e-12)
    np.testing.assert_allclose(np.abs(np.sum(found * expected, axis=1)), 1.0, atol=1e-9)
