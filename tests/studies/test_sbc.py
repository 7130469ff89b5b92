"""Ranks tell right posteriors from wrong ones, and a few replicates of the study run."""

import numpy as np
import pytest

from tests.studies import sbc, sbc_table
from tests.studies.sbc_table import RANKED, p_value, surely_off


def toy(width: float, shift: float, seed: int, count: int = 400) -> np.ndarray:
    """Ranks of the mean of a normal reading with a normal prior, by a posterior ``width`` times as wide and shifted."""
    rng = np.random.default_rng(seed)
    truth = rng.standard_normal(count)
    mean = (truth + rng.standard_normal(count)) / 2
    draws = mean[:, None] + np.sqrt(0.5) * (shift + width * rng.standard_normal((count, RANKED)))
    return np.sum(draws < truth[:, None], axis=1).astype(float)


def test_an_exact_posterior_has_uniform_ranks() -> None:
    assert p_value(toy(1.0, 0.0, 1)) > 1e-5
    assert not surely_off(toy(1.0, 0.0, 2), 0.9, 1e-5)


@pytest.mark.parametrize(("width", "shift"), [(0.5, 0.0), (2.5, 0.0), (1.0, 0.6)])
def test_a_posterior_that_is_off_has_not(width: float, shift: float) -> None:
    assert p_value(toy(width, shift, 3)) < 1e-5


def test_intervals_of_half_the_width_are_seen() -> None:
    assert surely_off(toy(0.5, 0.0, 4), 0.9)


def test_every_design_has_a_name_of_its_own() -> None:
    names = [d.name for d in sbc.designs()]
    assert len(set(names)) == len(names)


def test_a_replicate_ranks_every_coordinate_among_the_draws() -> None:
    design = next(sbc.designs())
    rows = [{"design": design.name, "replicate": i} | sbc.replicate(design, i) for i in range(3)]
    for row in rows:
        assert set(row["ranks"]) >= {*design.hypothesis.names, "log likelihood", "force at the end"}
        assert all(0 <= rank <= RANKED for rank in row["ranks"].values())
    assert design.name in sbc_table.report(rows, "here")
