"""Many draws of mixtures find an integral that is known, and the table tells errors from it."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.stats import cauchy

from bayesmembrane.diagnosis.candidates.sampled import ByDraws
from bayesmembrane.diagnosis.thresholds import SAMPLED
from tests.studies.few_draws import Compared, by_many, found_of, table, told_of


def test_many_draws_find_the_integral_of_heavy_tails() -> None:
    heavy = SimpleNamespace(mean=np.zeros(3), covariance=np.eye(3), linear=1.0)
    heavy.log_density = lambda u: np.sum(cauchy.logpdf(u), axis=-1)
    found, counting = by_many(cast(Any, heavy), np.random.default_rng(0))
    assert counting > 1000
    assert found == pytest.approx(-1.0, abs=5 / np.sqrt(counting) + 0.05)


def test_errors_are_what_is_said_less_what_many_draws_find() -> None:
    first = [ByDraws(-4.0, 0.3, SAMPLED.all_seen * 100 / np.e, 100), ByDraws(-3.0, 0.3, SAMPLED.all_seen * 100, 100)]
    row = Compared("gent", -2.0, first, [ByDraws(-2.5, 0.1, 9.0, 10)])
    rows = table([row], 0, "command").splitlines()
    missed = SAMPLED.unseen
    assert "| linear | 2.00 | 0.00 | 2.00 | 2.0 | - |" in rows
    assert "| what the first draws found | -1.50 | 0.50 | 1.50 | 2.0 | 1.00 |" in rows
    mean, apart = -1.5 + missed / 2, 1.0 - missed
    told = f"| that, and what they miss | {mean:.2f} | {apart / 2:.2f} | {-mean:.2f} | {2 - missed:.1f} | {apart:.2f} |"
    assert told in rows
    assert "| what all draws found | -0.50 | 0.00 | 0.50 | 0.5 | - |" in rows


def test_where_too_few_count_the_linear_evidence_stands() -> None:
    assert found_of(ByDraws(-4.0, 2.0, 1.2, 1000)) == told_of(ByDraws(-4.0, 2.0, 1.2, 1000)) == 0.0
