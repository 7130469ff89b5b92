"""One door to the solvers, through which many films go some at a time."""

from dataclasses import fields

import numpy as np
import pytest

from bayesmembrane.ground.registry import materials
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.mechanics.solution import Curves


@pytest.mark.parametrize("solver", ["ritz", "ritz_alone"])
@pytest.mark.parametrize("sensitivities", [True, False])
def test_some_at_a_time_are_the_same_to_the_last_bit(
    monkeypatch: pytest.MonkeyPatch, solver: str, sensitivities: bool
) -> None:
    kind, rng = materials()["gent"], np.random.default_rng(11)
    x = np.stack([p.prior.draw(rng, 70) for p in kind.coordinates])
    deflection = np.linspace(1e-3, 0.06, 12)
    asked = api.request(
        kind, kind.from_coordinates(x).T, deflection, 0.010, 0.035, solver=solver, sensitivities=sensitivities
    )
    whole = api.SOLVERS[solver](asked)
    monkeypatch.setattr(api, "TOGETHER", 12 * 16)
    assert_same(api.solve(asked), whole)
    monkeypatch.setattr(api, "TOGETHER", 1)  # no fewer than fill the lanes
    assert_same(api.solve(asked), whole)


def assert_same(some: Curves, whole: Curves) -> None:
    for f in fields(Curves):
        a, b = getattr(some, f.name), getattr(whole, f.name)
        assert (a is None) == (b is None)
        assert a is None or np.array_equal(a, b, equal_nan=True), f.name
