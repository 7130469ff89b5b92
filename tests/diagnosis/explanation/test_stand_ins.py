"""An effect that is often mistaken gives a part away to those that are, and every sum is kept."""

from math import exp

import pytest

from bayesmembrane.diagnosis.explanation.stand_ins import smaller_favoured, stood_in
from bayesmembrane.diagnosis.explanation.twins import Set

OFTEN = {"a": 0.2, "b": 0.4, "c": 0.1, "sure": 0.0}


def sets(*names: str) -> Set:
    return frozenset(names)


def test_each_effect_gives_away_as_often_as_it_is_mistaken() -> None:
    found = stood_in({sets("a", "b"): 1.0}, OFTEN, 0.5, 0.6)
    given = 1 - 0.8 * 0.6
    assert found == pytest.approx(
        {
            sets("a", "b"): 1 - given,
            sets("b"): 0.6 * given / 3,
            sets("a"): 0.6 * given * 2 / 3,
            sets("b", "c"): 0.4 * given / 3,
            sets("a", "c"): 0.4 * given * 2 / 3,
        }
    )


def test_what_is_alone_gives_less_and_is_never_left_out() -> None:
    found = stood_in({sets("a"): 1.0}, OFTEN, 0.5, 0.6)
    assert found == pytest.approx({sets("a"): 0.9, sets("b"): 0.1 * 0.4 / 0.5, sets("c"): 0.1 * 0.1 / 0.5})


@pytest.mark.parametrize("names", [(), ("sure",), ("unknown",)])
def test_nothing_is_given_by_what_is_never_mistaken(names: tuple[str, ...]) -> None:
    assert stood_in({sets(*names): 0.7}, OFTEN, 0.5, 0.6) == {sets(*names): pytest.approx(0.7)}


def test_where_there_is_nothing_else_effects_are_left_out_and_one_alone_keeps_all() -> None:
    given = 1 - 0.8 * 0.6 * 0.9
    found = stood_in({sets("a", "b", "c"): 1.0}, OFTEN, 0.5, 0.6)
    assert found[sets("a", "b", "c")] == pytest.approx(1 - given)
    assert found[sets("a", "c")] == pytest.approx(given * 4 / 7)
    assert stood_in({sets("a"): 1.0}, {"a": 0.2}, 0.5, 0.6) == {sets("a"): 1.0}


def test_what_is_hardly_mistaken_is_hardly_what_another_stands_for() -> None:
    found = stood_in({sets("a", "b"): 1.0}, OFTEN | {"d": 0.01}, 0.5, 0.6)
    assert found[sets("b", "d")] / found[sets("b", "c")] == pytest.approx(0.1)
    assert sets("b", "sure") not in found


def test_the_sum_is_kept() -> None:
    p = {sets(): 0.1, sets("a"): 0.2, sets("b", "c"): 0.3, sets("a", "b", "sure"): 0.15, sets("a", "b", "c"): 5e-324}
    assert sum(stood_in(p, OFTEN, 0.15, 0.5).values()) == pytest.approx(0.75)
    assert sum(smaller_favoured(p, 0.5).values()) == pytest.approx(0.75)
    assert stood_in({}, OFTEN, 0.15, 0.5) == smaller_favoured({}, 0.5) == {}


def test_each_further_effect_counts_less_and_none_keeps_what_it_has() -> None:
    found = smaller_favoured({sets(): 0.3, sets("a"): 0.2, sets("a", "b"): 0.2, sets("a", "b", "c"): 0.2}, 0.5)
    assert found[sets()] == 0.3
    assert found[sets("a")] / found[sets("a", "b")] == pytest.approx(exp(0.5))
    assert found[sets("a", "b")] / found[sets("a", "b", "c")] == pytest.approx(exp(0.5))


def test_what_is_given_beside_every_set_leaves_none_alone() -> None:
    alone, beside = (stood_in({sets("a"): 1.0}, OFTEN, 0.15, 0.6, n)[sets("a")] for n in (0, 1))
    assert (alone, beside) == (pytest.approx(0.97), pytest.approx(0.8))


def test_what_has_next_to_nothing_gives_nothing() -> None:
    found = stood_in({sets("sure"): 1.0, sets("a", "b"): 1e-7}, OFTEN, 0.15, 0.5)
    assert found == {sets("sure"): 1.0, sets("a", "b"): 1e-7}


def test_an_effect_of_one_test_is_exchanged_for_those_of_that_test_and_of_the_material() -> None:
    often = {"slip@one": 0.2, "tear@one": 0.2, "tear@two": 0.2, "damage": 0.2}
    found = stood_in({sets("slip@one"): 1.0}, often, 0.5, 0.5)
    assert set(found) == {sets("slip@one"), sets("tear@one"), sets("damage")}
    assert set(stood_in({sets("damage"): 1.0}, often | {"flow": 0.1}, 0.5, 0.5)) == {sets("damage"), sets("flow")}
