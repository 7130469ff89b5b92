"""Many draws of mixtures find an integral that is known, and the table tells errors from it."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.stats import cauchy

from tests.studies.few_draws import Compared, by_many, table


def test_many_draws_find_the_integral_of_heavy_tails() -> None:
    heavy = SimpleNamespace(mean=np.zeros(3), covariance=np.eye(3), linear=1.0)
    heavy.log_density = lambda u: np.sum(cauchy.logpdf(u), axis=-1)
    found, counting = by_many(cast(Any, heavy), np.random.default_rng(0))
    assert counting > 1000
    assert found == pytest.approx(-1.0, abs=5 / np.sqrt(counting) + 0.05)


def test_errors_are_what_is_said_less_what_many_draws_find() -> None:
    rows = table([Compared("gent", -2.0, [-1.5, -2.5], [-4.0, -4.0])], 0, "command").splitlines()
    assert "| linear | 2.00 | 0.00 | 2.00 | 2.0 |" in rows
    assert "| what few draws found | -2.00 | 0.00 | 2.00 | 2.0 |" in rows
    assert "| that, and what they miss | 0.00 | 0.50 | 0.50 | 0.5 |" in rows
