"""Numbers and names in words."""

import math

import pytest

from bayesmembrane.words.language import interval, listed, newtons, percent, sentence, spoken_parameter, three_digits


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0 mN"),
        (4e-3, "4.00 mN"),
        (0.0994, "99.4 mN"),
        (0.2, "0.200 N"),
        (18.04, "18.0 N"),
        (math.inf, "no force"),
    ],
)
def test_forces_in_words(value: float, text: str) -> None:
    assert newtons(value) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0000938123, "0.0000938"), (0.000178, "0.000178"), (22.51, "22.5"), (12345.0, "12,300"), (2e-12, "2e-12")],
)
def test_three_digits_have_no_exponent_where_that_is_short(value: float, text: str) -> None:
    assert three_digits(value) == text


@pytest.mark.parametrize(
    ("share", "text"),
    [(0.0, "0 %"), (1.0, "100 %"), (0.0002, "less than 0.1 %"), (0.9999, "more than 99.9 %"), (0.123, "12 %")],
)
def test_shares_are_never_rounded_to_none_or_all(share: float, text: str) -> None:
    assert percent(share) == text


def test_an_interval_has_the_digits_that_its_width_deserves() -> None:
    assert interval(17.21, 17.68, 18.1, "N/m") == "17.7 N/m (90 %: 17.2 to 18.1)"
    assert interval(3.9, 17.68, 17.9, "N/m") == "17.7 N/m (90 %: 3.9 to 17.9)"
    assert interval(1.0, 1.0, 1.0, "") == "1"
    assert interval(math.nan, 1.0, 1.0, "") == "unknown"


def test_lists_end_with_and() -> None:
    assert [listed("abc"[:n]) for n in range(4)] == ["", "a", "a and b", "a, b and c"]
    assert sentence("a clause") == sentence("a clause.") == "A clause."


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("yeoh.c1", "c1"),
        ("yeoh.c2_c1", "c2/c1"),
        ("gent.ln_jm", "ln Jm"),
        ("ogden.ln_gd", "ln Gd"),
        ("noise.sd", "extra noise"),
        ("zero_offset.shift", "shift"),
    ],
)
def test_parameters_have_names_for_text(name: str, words: str) -> None:
    assert spoken_parameter(name) == words
