"""What is said of printed rows that contradict the others."""

from dataclasses import replace

from bayesmembrane.reconstruction.rows import PredictedLoss, Suspect
from bayesmembrane.words.reconstruction import contradiction

LOSSES = (PredictedLoss("OP1", "0.1", 0.21, 0.012), PredictedLoss("OP2", "3.0", 2.5, 0.1))
FOUND = Suspect("yeoh", "INI", LOSSES, 0.99, (), ())


def test_every_loss_is_told_beside_what_the_others_predict() -> None:
    assert contradiction(FOUND) == (
        "the other rows contradict its losses: over OP1 printed 0.1 N, predicted 0.21 +- 0.01 N, over OP2 printed "
        "3.0 N, predicted 2.5 +- 0.1 N"
    )


def test_a_row_that_cannot_be_simulated_says_so() -> None:
    lost = replace(FOUND, losses=tuple(replace(p, predicted=float("nan")) for p in LOSSES))
    assert contradiction(lost).startswith("the forward model has no force")
