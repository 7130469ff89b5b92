"""The annulus refuses radii that are no ring."""

import math

import pytest

from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.rigs.annulus import Annulus


def test_registry_finds_it() -> None:
    assert components("rigs")["annulus"] is Annulus


def test_lengths_and_ratio() -> None:
    rig = Annulus(0.01, 0.035)
    assert rig.radius_ratio == pytest.approx(3.5)
    assert rig.lengths == {"inner_radius": 0.01, "outer_radius": 0.035}


@pytest.mark.parametrize(
    ("inner", "outer"), [(0.035, 0.01), (0.01, 0.01), (0, 1), (-1, 1), (math.nan, 1), (0.1, math.inf)]
)
def test_radii_that_are_no_ring(inner: float, outer: float) -> None:
    with pytest.raises(DataError, match=r"annulus: .*radius"):
        Annulus(inner, outer)
