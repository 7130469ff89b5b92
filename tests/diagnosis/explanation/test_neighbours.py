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


def test_every_set_of_some_effects_is_two_steps_from_one_or_nearer() -> None:
    """No effect is none of them: how far that is behind does not hang on the laws of effects."""
    found = spread({sets("ab"): 1.0}, EFFECTS, 2, 0.5, 0.5)
    assert set(found) == {frozenset(c) for size in (1, 2) for c in itertools.combinations(EFFECTS, size)}


def test_one_effect_that_can_be_seen_has_nothing_next_to_it() -> None:
    p = {sets("a"): 0.8, sets(""): 0.2}
    assert spread(p, "a", 3, 0.5, 0.3) == pytest.approx(p)


@pytest.mark.parametrize("whole", [0.0, 5e-324, 1e-180])
def test_what_is_next_to_impossible_stays_so(whole: float) -> None:
    """Beside something foreign that is thousands of nats ahead."""
    found = spread({sets("a"): whole, sets("b"): 0.0}, EFFECTS, 3, 0.2, 0.3)
    assert sum(found.values()) == pytest.approx(whole, rel=1e-9, abs=0.0)
    assert found


def test_the_order_of_sets_is_that_in_which_they_are_met() -> None:
    p = {sets("ab"): 0.6, sets("c"): 0.4}
    found = list(spread(p, EFFECTS, 3, 0.2, 0.3))
    assert found[:2] == list(p)
    assert found[2:4] == [sets("abc"), sets("abd")]


def test_no_effect_keeps_what_it_has() -> None:
    assert spread({sets(""): 1.0}, EFFECTS, 3, 0.5, 0.3) == {sets(""): pytest.approx(1.0)}


def test_nothing_is_told_of_others_without_a_share() -> None:
    p = {sets("a"): 0.7, sets("b"): 0.3}
    assert spread(p, EFFECTS, 3, 0.0, 0.3) == pytest.approx(p)
