import numpy as np
import pytest

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.candidates.sudden import sudden_change
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.materials.neo_hookean import NeoHookean
from bayesmembrane.words.diagnosis import sudden_sentence
from tests.diagnosis.curves import RIG, SD, measured, triangle, white_noise

N = 400
D = triangle(N)
FORCE = 10.0 * D**1.3
TIME = np.arange(1.0, N + 1)


def found(residual):
    """The step beside a model whose one slope is its force."""
    m = measured(FORCE + residual)
    null = Candidate(Hypothesis(NeoHookean), np.zeros(1), residual, FORCE[:, None], 0.0, ())
    return sudden_change(Search(m, white_noise(m)), null)


@pytest.mark.parametrize("relative", [False, True])
@pytest.mark.parametrize("size", [-1.0, 1.0])
def test_a_step_is_found_where_it_is_with_its_size(relative, size) -> None:
    noise = SD * np.random.default_rng(31).standard_normal(N)
    at = 250
    step = size * (0.08 * FORCE if relative else np.full(N, 2 * SD)) * (np.arange(N) >= at)
    step_found = found(noise + step)
    assert step_found.relative == relative
    assert abs(step_found.place - at) < 12
    assert step_found.size == pytest.approx(size * (0.08 if relative else 2 * SD), rel=0.15)
    assert step_found.gain > 20
    assert step_found.moment == TIME[step_found.place]
    words = sudden_sentence(step_found, RIG.shown(50e-6))
    assert ("rise" if size > 0 else "drop") in words
    assert ("%" if relative else "mN") in words.split(" at ")[0]


def test_noise_and_gradual_changes_are_no_steps() -> None:
    rng = np.random.default_rng(32)
    gains = [found(SD * rng.standard_normal(N)).gain for _ in range(50)]
    assert max(gains) < 2
    drift = 4 * SD * TIME / N
    step = 4 * SD * (TIME > N / 2)
    assert found(drift).share < 0.9 < found(step).share


def test_a_short_curve_is_not_asked() -> None:
    m = measured(np.ones(60))
    null = Candidate(Hypothesis(NeoHookean), np.zeros(1), np.ones(60), np.ones((60, 1)), 0.0, ())
    assert sudden_change(Search(m, white_noise(m)), null) is None
