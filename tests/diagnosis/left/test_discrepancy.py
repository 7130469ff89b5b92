"""What is left is kept as it is: quick or slow, and nothing of noise."""

import time
from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.diagnosis.left.discrepancy import discrepancy
from bayesmembrane.diagnosis.reference.noise import OwnNoise
from bayesmembrane.physics.noise.ar1 import gaps_of
from tests.diagnosis.curves import SD, measured, triangle, white_noise

N = 400
WAY = np.linspace(0, 0.12, N + 1)[1:]  # m, of the triangle to 20 and 40 mm


@pytest.mark.parametrize("wavelength", [0.003, 0.01, 0.1])
def test_waves_along_the_way_are_followed_whatever_their_length(wavelength: float) -> None:
    rng = np.random.default_rng(5)
    wave = SD * np.sin(2 * np.pi * WAY / wavelength)
    m = measured(triangle(N))
    found = discrepancy(m, wave + SD * rng.standard_normal(N), white_noise(m))
    error = np.sqrt(np.mean((found.mean - wave) ** 2))
    assert error < 0.7 * np.sqrt(np.mean(wave**2))
    assert found.length < 0.5 * wavelength
    # Its own standard deviations know how far off it is.
    assert 0.4 < np.sqrt(np.mean(((found.mean - wave) / found.sd) ** 2)) < 1.8


def test_a_ripple_weaker_than_the_noise_is_not_lost_over_many_cycles() -> None:
    peaks = (0.01, 0.02, 0.03, 0.04, 0.04)
    deflection = triangle(700, peaks)
    wave = 0.9 * SD * np.sin(2 * np.pi * deflection / 0.004)
    m = measured(wave, deflection)
    found = discrepancy(m, wave + SD * np.random.default_rng(8).standard_normal(700), white_noise(m))
    assert np.sqrt(np.mean((found.mean - wave) ** 2)) < 0.8 * np.sqrt(np.mean(wave**2))


def test_of_noise_next_to_nothing_is_kept() -> None:
    m = measured(triangle(N))
    found = discrepancy(m, SD * np.random.default_rng(6).standard_normal(N), white_noise(m))
    assert np.sqrt(np.mean(found.mean**2)) < 0.3 * SD


def test_twice_the_residual_and_noise_is_twice_the_process() -> None:
    rng = np.random.default_rng(7)
    m = measured(triangle(N))
    residual = 2 * SD * np.sin(2 * np.pi * WAY / 0.03) + SD * rng.standard_normal(N)
    one = discrepancy(m, residual, white_noise(m))
    two = discrepancy(m, 2 * residual, white_noise(m, 2 * SD))
    assert two.mean == pytest.approx(2 * one.mean, rel=1e-6, abs=1e-9)
    assert two.amplitude == pytest.approx(2 * one.amplitude)
    assert two.length == pytest.approx(one.length)


@pytest.mark.parametrize("rho", [0.0, 0.6])
@pytest.mark.parametrize("even", [True, False])
def test_linear_time_gives_what_the_whole_covariance_gives(rho: float, even: bool) -> None:
    """With a hold, uneven times and uneven deviations; a stated covariance is solved as a whole."""
    rng = np.random.default_rng(9)
    deflection = triangle(120)
    deflection[40:48] = deflection[40]
    m = measured(deflection, deflection, np.arange(1.0, 121.0) if even else np.cumsum(rng.uniform(0.1, 3.0, 120)))
    profile = np.ones(1) if even else np.linspace(0.5, 2, 120)
    noise = OwnNoise(SD, rho, 0.1, gaps_of(m), None, 100.0, profile=profile)
    since = np.concatenate([[0.0], np.cumsum(noise.gaps)])
    correlation = rho ** np.abs(since[:, None] - since) if rho else np.eye(120)
    stated = replace(noise, root=np.linalg.cholesky(np.outer(noise.each, noise.each) * correlation))
    residual = 2 * SD * np.sin(deflection / 0.004) + SD * rng.standard_normal(120)
    linear, whole = discrepancy(m, residual, noise), discrepancy(m, residual, stated)
    assert linear.amplitude == pytest.approx(whole.amplitude, rel=1e-6)
    assert linear.length == pytest.approx(whole.length, rel=1e-6)
    np.testing.assert_allclose(linear.mean, whole.mean, atol=1e-6 * SD)
    np.testing.assert_allclose(linear.sd, whole.sd, atol=1e-6 * SD)


@pytest.mark.parametrize("rho", [0.0, 0.5])
def test_twenty_thousand_points_take_seconds_and_no_square_of_memory(rho: float) -> None:
    n = 20_000
    deflection = triangle(n)
    m = measured(np.zeros(n), deflection)
    wave = SD * np.sin(2 * np.pi * np.linspace(0, 0.12, n + 1)[1:] / 0.01)
    residual = wave + SD * np.random.default_rng(10).standard_normal(n)
    began = time.process_time()
    found = discrepancy(m, residual, OwnNoise(SD, rho, 0.0, gaps_of(m), None, 1e9))
    assert time.process_time() - began < 60
    assert np.sqrt(np.mean((found.mean - wave) ** 2)) < 0.2 * SD
    assert 0 < found.sd.max() < 0.4 * SD
