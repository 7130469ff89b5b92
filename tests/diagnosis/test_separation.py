"""How far apart a further test puts rivals, all pairs of them taken together."""

import numpy as np
import pytest

from bayesmembrane.diagnosis.separation import apart


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
