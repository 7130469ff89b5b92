import numpy as np
import pytest

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.detection import periodicity as waves_of
from bayesmembrane.diagnosis.detection.detect import Detection
from bayesmembrane.diagnosis.detection.lack_of_fit import LackOfFit
from bayesmembrane.diagnosis.detection.periodicity import Periodicity
from bayesmembrane.diagnosis.detection.scores import ScoreTest
from bayesmembrane.diagnosis.reference.noise import whitened
from bayesmembrane.diagnosis.reference.smooth import smooth_reference
from tests.diagnosis.curves import SD, measured, triangle, white_noise

N = 400
D = triangle(N)
CURVE = measured(np.zeros(N))
BASIS = smooth_reference(CURVE)


def periodicity(measurement, residual, basis, noise) -> Periodicity | None:
    return waves_of.periodicity(measurement, whitened(residual, np.empty((residual.size, 0)), basis, noise))


@pytest.mark.parametrize(
    ("against", "period"), [("deflection", 2.9e-3), ("deflection", 1.7e-3), ("deflection", 0.9e-3), ("time", 7.3)]
)
def test_a_wave_is_found_with_its_period(against, period) -> None:
    place = {"deflection": D, "time": CURVE.time}[against]
    noise = SD * np.random.default_rng(13).standard_normal(N)
    found = periodicity(CURVE, noise + SD * np.sin(2 * np.pi * place / period + 1), BASIS, white_noise(CURVE))
    assert found.against == against
    # As exactly as one wave more or less over the range.
    assert abs(np.ptp(place) / found.period - np.ptp(place) / period) < 1
    assert found.p_value < 1e-6


def stepwise(n: int = 8, rise: float = 2.5e-3, held: int = 15) -> Measurement:
    """(N,) five ramps of ``n`` readings with holds behind them: few readings move."""
    d, t = [0.0], [0.0]
    for step in range(5):
        d += [step * rise + rise * (i + 1) / n for i in range(n)] + held * [(step + 1) * rise]
        t += [t[-1] + 0.2 * (i + 1) for i in range(n)]
        t += [t[-1] + 0.5 * (i + 1) for i in range(held)]
    return measured(np.zeros(len(d)), np.array(d[1:] + d[-1:]), np.array([*t[1:], t[-1] + 1.0]))


@pytest.mark.parametrize(("n", "period"), [(8, 1.1e-3), (6, 1.42e-3)])
def test_a_wave_is_found_where_few_readings_move(n: int, period: float) -> None:
    """It stands still in the holds, and has four readings a period between them; nine waves are more than fifteen
    splines follow.
    """
    m = stepwise(n)
    rng, basis, place = np.random.default_rng(16), smooth_reference(m), m.deflection
    assert 24 <= np.count_nonzero(m.moving) < 60
    found, alarms = [], 0
    for _ in range(40):
        noise = SD * rng.standard_normal(len(m))
        alarms += periodicity(m, noise, basis, white_noise(m)).p_value < 0.05
        wave = 3 * SD * np.sin(2 * np.pi * place / period + rng.uniform(0, 6))
        found.append(periodicity(m, noise + wave, basis, white_noise(m)))
    assert np.mean([f.p_value < 0.01 and f.against == "deflection" for f in found]) > 0.8
    assert np.median([f.period for f in found]) == pytest.approx(period, rel=0.05)
    assert alarms <= 40 * 0.05 + 3 * np.sqrt(40 * 0.05)


def test_white_noise_raises_no_more_alarms_than_it_may() -> None:
    rng = np.random.default_rng(14)
    p = [periodicity(CURVE, SD * rng.standard_normal(N), BASIS, white_noise(CURVE)).p_value for _ in range(200)]
    for level in (0.01, 0.05, 0.2):
        count = np.count_nonzero(np.array(p) <= level)
        assert count <= 200 * level + 3 * np.sqrt(200 * level * (1 - level))
    assert np.median(p) < 1


def test_a_slow_wave_is_left_to_the_smooth_reference() -> None:
    noise = SD * np.random.default_rng(15).standard_normal(N)
    slow = 3 * SD * np.sin(2 * np.pi * D / 0.04)
    assert periodicity(CURVE, noise + slow, BASIS, white_noise(CURVE)).p_value > 0.01


def test_short_curves_are_not_asked_for_waves() -> None:
    m = measured(np.zeros(40))
    assert periodicity(m, np.ones(40), smooth_reference(m), white_noise(m)) is None


def test_the_smallest_probability_counts_and_pays_for_the_number_of_tests() -> None:
    fit, score = LackOfFit(1.0, 0.4, 100.0, 100), ScoreTest("rate", 3.0, 0.004, 3.5)
    waves = Periodicity("time", 1.0, 0.1, 0.9)
    assert Detection(fit, score, waves).p_value == pytest.approx(0.012)
    assert Detection(fit, score, waves).adequate
    assert Detection(fit, score, None).p_value == pytest.approx(0.008)
    assert not Detection(fit, score, None).adequate
    assert Detection(fit, ScoreTest("", 0.0, 1.0, np.inf), None).p_value == pytest.approx(0.8)
