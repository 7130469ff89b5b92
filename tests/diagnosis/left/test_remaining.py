"""What a model leaves: noise, what a small error of the forms carries, or something else."""

import numpy as np
import pytest

from bayesmembrane.diagnosis.left.remaining import Remaining
from bayesmembrane.diagnosis.thresholds import VERDICT

SMALL, LARGE = 0.5 * VERDICT.law_small, 2 * VERDICT.law_small
A_LOT, MANY = 2 * VERDICT.noise_chi2, 400


@pytest.mark.parametrize(
    ("reduced_chi2", "carried", "law", "strange"),
    [
        (A_LOT, 0.1, SMALL, True),
        (A_LOT, 0.9, LARGE, True),
        (A_LOT, 0.9, SMALL, False),
        (1.0, 0.1, LARGE, False),
    ],
)
def test_what_is_left_is_strange_if_it_is_no_noise_and_no_small_error_carries_it(
    reduced_chi2: float, carried: float, law: float, strange: bool
) -> None:
    for share in (0.01, 0.5):  # a little of a large misfit is no less strange
        assert Remaining(share, reduced_chi2, carried, 0.0, 0.0, {"friction": law}, MANY).strange is strange


def test_few_readings_scatter_by_chance() -> None:
    few = 20
    within = 1.0 + 0.9 * VERDICT.chance * np.sqrt(2 / few)
    assert within > VERDICT.noise_chi2
    assert not Remaining(0.3, within, 0.0, 0.0, 0.0, {}, few).strange
    assert Remaining(0.3, within, 0.0, 0.0, 0.0, {}, MANY).strange
