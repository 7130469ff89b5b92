"""What a model leaves: noise, what a small error of the forms carries, or something else."""

import pytest

from bayesmembrane.diagnosis.left.remaining import Remaining
from bayesmembrane.diagnosis.thresholds import VERDICT

A_LOT, FEW = 2 * VERDICT.noise_chi2, 0.5 * VERDICT.noise_chi2


@pytest.mark.parametrize(
    ("share", "reduced_chi2", "carried", "noise", "strange"),
    [
        (0.45, A_LOT, 0.1, False, True),
        (0.45, A_LOT, 0.9, False, False),
        (0.45, FEW, 0.1, False, False),
        (0.01, A_LOT, 0.1, False, False),
        (0.01, FEW, 0.0, True, False),
    ],
)
def test_what_is_left_is_strange_if_it_is_much_and_nothing_carries_it(
    share: float, reduced_chi2: float, carried: float, noise: bool, strange: bool
) -> None:
    left = Remaining(share, reduced_chi2, carried, 0.0, 0.0, {})
    assert (left.noise, left.strange) == (noise, strange)
