"""What is left is kept as it is: quick or slow, and nothing of noise."""

import numpy as np
import pytest

from bayesmembrane.diagnosis.discrepancy import discrepancy
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
    assert np.sqrt(np.mean((found.mean - wave) ** 2)) < 0.7 * np.sqrt(np.mean(wave**2))


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
