"""Readings that a machine rounds lie on a grid, and no others do."""

import numpy as np
import pytest

from bayesmembrane.diagnosis.left.shape import resolution_of


@pytest.mark.parametrize("step", [0.001, 0.25, 3.0])
def test_rounded_readings_have_a_step_whatever_the_unit(step: float) -> None:
    y = np.random.default_rng(4).normal(10 * step, 8 * step, 150)
    for scale in (1.0, 4.448, 1e-6):
        assert resolution_of(scale * step * np.round(y / step)) == pytest.approx(scale * step)


def test_readings_with_all_their_digits_have_none() -> None:
    assert resolution_of(np.random.default_rng(5).standard_normal(150)) == 0.0
    assert resolution_of(np.zeros(9)) == 0.0
    assert resolution_of(np.array([0.0, 1.0])) == 0.0
