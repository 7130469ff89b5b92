"""Prior probabilities add up, and factors count less the more an explanation gains."""

from itertools import combinations
from math import exp

import numpy as np
import pytest

from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS


@pytest.mark.parametrize("visible", [3, 7, 12])
def test_sets_share_what_their_size_has(visible: int) -> None:
    odds = [1.0, 0.25, 1.0, *[0.5] * (visible - 3)]
    for size in range(BELIEFS.most + 1):
        total = sum(exp(BELIEFS.log_set(own, odds)) for own in combinations(odds, size))
        assert total == pytest.approx(BELIEFS.effects[size])


def test_sets_of_one_size_are_as_probable_as_the_odds_of_their_effects() -> None:
    odds = [1.0, 1.0, 0.25, 1.0]
    rare, usual = (BELIEFS.log_set((1.0, o), odds) for o in (0.25, 1.0))
    assert exp(rare - usual) == pytest.approx(0.25)


@pytest.mark.parametrize("declared", [None, "gent"])
def test_energies_share_one(declared: str | None) -> None:
    names = ["gent", "yeoh", "ogden"]
    assert sum(exp(BELIEFS.log_energy(n, declared, len(names))) for n in names) == pytest.approx(1.0)


def test_factors_count_whole_where_little_is_gained_and_less_the_more_there_is() -> None:
    gains = np.array([-5.0, 0.0, 1.0, 10.0, 100.0, 200.0])
    counts = np.array([BELIEFS.counts(g) for g in gains])
    assert counts[0] == counts[1] == 1.0
    assert np.all(np.diff(counts[1:]) < 0)
    # What is gained still counts for more, the more it is.
    assert np.all(np.diff(counts[1:] * gains[1:]) > 0)
    assert BELIEFS.counts(1e5) == BELIEFS.least_counts < counts[-1]


@pytest.mark.parametrize("first", [0.96, 0.99])
def test_what_stands_out_is_left_as_it_is(first: float) -> None:
    said = {"a": first, "b": 0.7 - 0.7 * first, "c": 0.3 - 0.3 * first}
    assert BELIEFS.flattened(said) == pytest.approx(said)
    by_none = BELIEFS.flattened(said, by_known_laws=False)
    assert by_none["a"] / by_none["b"] == pytest.approx((said["a"] / said["b"]) ** BELIEFS.flatter)


def test_where_nothing_stands_out_odds_are_raised_to_a_power() -> None:
    flat = BELIEFS.flattened({"a": 0.3, "b": 0.15, "c": 0.05})  # as part of a sum
    assert sum(flat.values()) == pytest.approx(0.5)
    assert list(flat) == ["a", "b", "c"]
    assert flat["a"] / flat["b"] == pytest.approx(2**BELIEFS.flatter)
    assert flat["b"] / flat["c"] == pytest.approx(3**BELIEFS.flatter)
    assert BELIEFS.flattened({}) == {}


def test_an_energy_that_stands_out_is_told_flatter_too() -> None:
    flat = BELIEFS.energies_flattened({"a": 0.98, "b": 0.02})
    assert sum(flat.values()) == pytest.approx(1.0)
    assert flat["a"] / flat["b"] == pytest.approx(49**BELIEFS.energies_flatter)


@pytest.mark.parametrize("rivals", [1, 3, 30])
def test_the_larger_a_probability_the_larger_it_is_flattened(rivals: int) -> None:
    firsts = np.linspace(0.5, 1.0, 101)
    flat = [BELIEFS.flattened({"a": p, **{f"b{i}": (1 - p) / rivals for i in range(rivals)}})["a"] for p in firsts]
    assert np.all(np.diff(flat) > 0)
    assert np.all(np.array(flat) <= firsts + 1e-12)
