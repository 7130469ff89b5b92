"""Energies that a set was not fitted with stand to its best one as they do in what it grew from."""

import pytest

from bayesmembrane.diagnosis.explanation.unfitted import Key, unfitted

NONE, ONE, OTHER, TWO = frozenset[str](), frozenset({"a"}), frozenset({"b"}), frozenset({"a", "b"})
PLAIN: dict[Key, float] = {("gent", NONE): -50.0, ("yeoh", NONE): -60.0}


def test_what_every_energy_was_fitted_with_is_not_foretold() -> None:
    assert unfitted(PLAIN) == {}


def test_an_energy_is_as_far_behind_as_without_the_effect() -> None:
    assert unfitted({**PLAIN, ("gent", ONE): -20.0}) == {("yeoh", ONE): pytest.approx(-30.0)}


def test_the_larger_part_counts_and_of_those_the_more_probable() -> None:
    singles: dict[Key, float] = {
        ("gent", ONE): -20.0,
        ("yeoh", ONE): -21.0,
        ("gent", OTHER): -30.0,
        ("yeoh", OTHER): -37.0,
    }
    found = unfitted({**PLAIN, **singles, ("gent", TWO): -10.0})
    assert found == {("yeoh", TWO): pytest.approx(-11.0)}


def test_an_energy_that_was_not_fitted_is_no_better_than_those_that_were() -> None:
    assert unfitted({**PLAIN, ("yeoh", ONE): -20.0}) == {("gent", ONE): pytest.approx(-20.0)}


def test_without_a_common_part_nothing_is_foretold() -> None:
    found: dict[Key, float] = {("gent", NONE): -50.0, ("yeoh", ONE): -20.0}
    assert unfitted(found) == {}
