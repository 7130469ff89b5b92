"""What is told of sets is told in part of those next to them, and adds up to the same."""

import itertools

import pytest

from bayesmembrane.diagnosis.explanation.neighbours import Set, spread

EFFECTS = ("a", "b", "c", "d")


def sets(text: str) -> Set:
    return frozenset(text)


def test_the_sum_is_kept_and_no_set_is_larger_than_the_largest() -> None:
    p = {sets(""): 0.1, sets("ab"): 0.5, sets("c"): 0.2, sets("bcd"): 0.1}
    found = spread(p, EFFECTS, 3, 0.2, 0.3)
    assert sum(found.values()) == pytest.approx(0.9, rel=1e-12)
    assert max(map(len, found)) == 3


def test_one_step_adds_leaves_out_or_exchanges_one() -> None:
    found = spread({sets("ab"): 1.0}, EFFECTS, 3, 0.4, 0.0)
    near = {sets(t) for t in ("abc", "abd", "a", "b", "cb", "db", "ac", "ad")}
    assert set(found) == near | {sets("ab")}
    assert found[sets("ab")] == pytest.approx(0.6)
    assert {round(found[n], 12) for n in near} == {0.05}


def test_two_steps_are_one_after_the_other() -> None:
    p = {sets("ab"): 1.0}
    once = spread(p, EFFECTS, 3, 1.0, 0.0)
    twice = spread(once, EFFECTS, 3, 1.0, 0.0)
    both = spread(p, EFFECTS, 3, 1.0, 1.0)
    assert both.keys() == twice.keys()
    assert all(both[n] == pytest.approx(q) for n, q in twice.items())


def test_every_set_is_two_steps_from_one_or_nearer() -> None:
    found = spread({sets("ab"): 1.0}, EFFECTS, 2, 0.5, 0.5)
    every = {frozenset(c) for size in range(3) for c in itertools.combinations(EFFECTS, size)}
    assert set(found) == every


def test_no_effect_keeps_what_it_has() -> None:
    assert spread({sets(""): 1.0}, EFFECTS, 3, 0.5, 0.3) == {sets(""): pytest.approx(1.0)}


def test_nothing_is_told_of_others_without_a_share() -> None:
    p = {sets("a"): 0.7, sets("b"): 0.3}
    assert spread(p, EFFECTS, 3, 0.0, 0.3) == pytest.approx(p)
