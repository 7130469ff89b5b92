"""How far apart a further test puts rivals, all pairs of them taken together."""

import numpy as np
import pytest

from bayesmembrane.diagnosis.separation import Experiment, apart, in_order
from bayesmembrane.next_test.further import FurtherTest, Kind


def test_two_rivals_lie_as_far_apart_as_their_own_confusion_says() -> None:
    assert apart(np.array([0.3]), np.exp(np.array([-(4.0**2) / 8]))) == pytest.approx(4.0)


def test_a_test_that_parts_an_improbable_rival_alone_is_worth_little() -> None:
    """A blank run where one rival of three lets the frame yield: the two that do not stay confused."""
    p = np.array([0.6, 0.35, 0.02])
    weight = np.sqrt([p[0] * p[1], p[0] * p[2], p[1] * p[2]])
    blank, cycles = apart(weight, np.array([1.0, 0.0, 0.0])), apart(weight, np.exp(np.full(3, -2.0)))
    assert blank < cycles == pytest.approx(4.0)


def test_nothing_is_left_where_every_pair_is_parted() -> None:
    assert apart(np.array([0.5]), np.zeros(1)) == np.inf


def test_rivals_that_say_the_same_are_not_apart() -> None:
    weight = np.random.default_rng(1).uniform(size=15)
    assert apart(weight, np.ones(15)) == 0.0


@pytest.mark.parametrize(("blank", "first"), [(2.1, Kind.BLANK), (1.9, Kind.CYCLES), (float("inf"), Kind.BLANK)])
def test_a_blank_run_that_helps_comes_first_for_it_costs_no_film(blank: float, first: Kind) -> None:
    found = [
        Experiment(FurtherTest(Kind.HOLD), 3.0),
        Experiment(FurtherTest(Kind.BLANK), blank),
        Experiment(FurtherTest(Kind.CYCLES), 4.0),
    ]
    ordered = in_order(found)
    assert ordered[0].test.kind is first
    assert [e.separation for e in ordered if e.test.kind is not Kind.BLANK] == [4.0, 3.0]
