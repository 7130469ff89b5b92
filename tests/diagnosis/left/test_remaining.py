"""What a model leaves: noise, what a small error of the forms carries, or something else."""

from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.left.remaining import Remaining, remaining
from bayesmembrane.diagnosis.thresholds import VERDICT
from bayesmembrane.physics.hypothesis import hypothesis
from tests.diagnosis.curves import SD, measured, triangle, white_noise

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


def test_what_explains_clearly_more_than_is_left_is_firm() -> None:
    left = Remaining(0.3, A_LOT, 0.1, 0.0, 0.0, {}, MANY, 100.0, {"friction": 1000.0, "rate": 110.0})
    assert left.firm(["friction", "rate", "mullins"]) == ["friction"]
    assert replace(left, excess=0.0).firm(["friction", "rate", "mullins"]) == ["friction", "rate"]


@pytest.mark.parametrize(("off", "share"), [(0.0, 0.0), (0.2, 1.0)])
def test_a_model_that_leaves_noise_alone_leaves_no_share_of_it(off: float, share: float) -> None:
    d = triangle(200)
    noise = SD * np.random.default_rng(8).standard_normal(d.size)
    m = measured(8 * d + off * np.sin(300 * d) + noise, d)
    search, h = Search(m, white_noise(m, SD)), hypothesis("neo_hookean")
    fit = search.fit(h, search.material_starts(h)[:1])
    assert fit is not None
    # Round numbers of a film that is nearly as straight; what it leaves is noise, or the wave.
    straight = replace(fit, residual=m.force - 8 * d, slopes=d[:, None])
    found = remaining(search, straight, straight)
    assert found.share == share
    assert found.noise is (share == 0)
