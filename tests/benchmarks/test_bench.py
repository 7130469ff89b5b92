"""The benchmark's rows can be made: nothing else calls them, so that a change of the solvers would go unseen."""

from __future__ import annotations

import numpy as np
import pytest

from bayesmembrane.ground.registry import materials
from tests.benchmarks import bench


@pytest.fixture(scope="module")
def films():
    return bench.admissible(materials()["gent"], bench.BATCH, np.random.default_rng(bench.SEED))


def test_a_remembered_curve_equals_the_solver_s(films):
    row = bench.cached(materials()["gent"], films)
    assert row.error == 0.0
    assert min(row.us_15, row.us_366) > 0


def test_every_solver_of_the_table_equals_the_exact_shooting(films):
    exact = bench.shooting.solve(bench.asked(materials()["gent"], films, 15), rtol=1e-12).force
    rows = bench.ours(materials()["gent"], films, exact)
    assert [row.error < bench.EXACT for row in rows] == [True] * 3
    assert len(bench.table(rows).splitlines()) == 1 + len(rows)
