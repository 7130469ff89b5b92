"""Tables print numbers that people can read, and keep those that programs need."""

import math

import pytest

from bayesmembrane.report.blocks import Column, Table, facts_table
from bayesmembrane.report.runs import Shown
from bayesmembrane.report.sections.calibrations import fits_table as fits


@pytest.mark.parametrize(
    ("form", "value", "text"),
    [
        (".4g", 1.23456, "1.235"),
        (".3g", 39841.0, "39,800"),
        (".2g", -0.5, "\u22120.5"),
        (".4g", math.nan, "-"),
        (".4g", None, "-"),
        (".2g", 2.5e-5, "2.5e-05"),
        ("%", 0.0002, "less than 0.1 %"),
        ("p", 1e-9, "< 0.0001"),
        ("p", 0.25, "0.25"),
        (",d", 12345, "12,345"),
        (".4g", True, "yes"),
        (".4g", "<b>", "<b>"),
    ],
)
def test_cells(form: str, value: str | float | bool | None, text: str) -> None:
    assert Column("a", "a", form).text(value) == text


def test_records_have_no_nan() -> None:
    table = Table("t", "c", (Column("a", "A"), Column("b", "B")), ((1.0, math.inf), (None, "x")))
    assert table.records() == [{"a": 1.0, "b": None}, {"a": None, "b": "x"}]
    assert table.numeric() == [True, False]


def test_facts_are_flattened() -> None:
    table = facts_table("f", "c", {"a_b": {"c": [1, 2.5], "d": None}, "e": True})
    assert table.rows == (("a b: c", "1, 2.5"), ("a b: d", "-"), ("e", "yes"))


def test_the_verdict_uses_the_stated_noise(yeoh: Shown, neo_hookean: Shown) -> None:
    good, bad = fits([yeoh, neo_hookean]).records()
    assert good["own_noise_mN"] == pytest.approx(4.0)
    assert good["verdict"] == "describes the curve"
    assert bad["verdict"] == "misses something"
