"""Bisection finds where something stops to hold."""

import pytest

from bayesmembrane.ground.numbers import bisected


@pytest.mark.parametrize("edge", [0.125, 0.3, 0.999])
def test_the_edge_lies_between_what_holds_and_what_does_not(edge: float) -> None:
    low, high = bisected(lambda t: t < edge, 0.0, 1.0, 20)
    assert low < edge <= high
    assert high - low == pytest.approx(2.0**-20)
