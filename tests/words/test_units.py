"""Sizes in words: in units of a rig, and a stretch by what it is more than one."""

import pytest

from bayesmembrane.words.sizes import parameter_in_words
from bayesmembrane.words.units import size_in_words


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("prestretch.stretch", 1.00987654, "stretch 1.0099"),
        ("prestretch.stretch", 1.25678, "stretch 1.26"),
        ("clamp_slip.exponent", 1.0987654, "exponent 1.1"),  # a number like any other
        ("machine_compliance@strip.compliance", 2.7e-3, "compliance 2.7 mm/N"),
    ],
)
def test_a_parameter_is_told_with_the_digits_that_say_something(name: str, value: float, told: str) -> None:
    assert parameter_in_words(name, value) == told


def test_what_a_search_left_at_a_bound_is_nothing() -> None:
    assert size_in_words(1e-40, "N") == "0 mN"
