"""Units: factors against their definitions, headers, and what an unknown unit is told."""

import math

import numpy as np
import pytest

from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.units import FORCE, LENGTH, RATIO, SPEED, STRESS, TIME, UNITS, factor, split_header, to_si

INCH, POUND, G = 0.0254, 0.45359237, 9.80665


@pytest.mark.parametrize(
    ("unit", "quantity", "value"),
    [
        ("min", TIME, 60),
        ("ms", TIME, 1e-3),
        ("µm", LENGTH, 1e-6),
        ("in", LENGTH, INCH),
        ("kgf", FORCE, G),
        ("gf", FORCE, G / 1000),
        ("lbf", FORCE, POUND * G),
        ("N_per_mm2", STRESS, 1e6),
        ("N/mm²", STRESS, 1e6),
        ("kgf_per_cm2", STRESS, 98066.5),
        ("psi", STRESS, 6894.757293168361),
        ("mm_per_min", SPEED, 1 / 60000),
        ("percent", RATIO, 0.01),
        ("%", RATIO, 0.01),
        ("", RATIO, 1),
    ],
)
def test_factor_is_the_definition_of_the_unit(unit: str, quantity: str, value: float) -> None:
    assert math.isclose(factor(unit, quantity), value, rel_tol=1e-15)


@pytest.mark.parametrize(
    ("header", "parts"),
    [
        ("force_mN", ("force", "mN")),
        ("force_sd_N", ("force_sd", "N")),
        ("nominal_stress_kgf_per_cm2", ("nominal_stress", "kgf_per_cm2")),
        ("nominal_stress_1_MPa", ("nominal_stress_1", "MPa")),
        ("speed_mm_per_min", ("speed", "mm_per_min")),
        ("stretch", ("stretch", "")),
        ("stretch_1", ("stretch_1", "")),
        ("thickness_µm", ("thickness", "um")),
        ("_N", ("_N", "")),
        ("", ("", "")),
    ],
)
def test_header_ends_in_its_unit(header: str, parts: tuple[str, str]) -> None:
    assert split_header(header) == parts


def test_every_unit_in_a_header_is_found_again() -> None:
    for name, unit in UNITS.items():
        if name:
            assert split_header(f"quantity_{name}") == ("quantity", name)
            assert factor(name, unit.quantity) == unit.factor


@pytest.mark.parametrize(
    ("unit", "quantity", "said"),
    [
        ("mpa", STRESS, 'did you mean "MPa"?'),
        ("kN", STRESS, '"kN" is a unit of force, not of stress'),
        ("mn", FORCE, 'did you mean "mN"?'),
        ("furlong", LENGTH, 'there is no unit "furlong" of length; known: m, cm, mm'),
    ],
)
def test_unknown_unit_names_the_nearest(unit: str, quantity: str, said: str) -> None:
    with pytest.raises(DataError) as caught:
        factor(unit, quantity, "curve.csv, line 1")
    assert said in str(caught.value)
    assert str(caught.value).startswith("curve.csv, line 1: ")


@pytest.mark.parametrize(("value", "unit", "expected"), [(50.0, "um", 5e-05), (35.1, "mm", 0.0351), (0.3, "mN", 3e-4)])
def test_decimal_numbers_stay_decimal(value: float, unit: str, expected: float) -> None:
    assert to_si(value, UNITS[unit].factor) == expected
    assert np.array_equal(to_si(np.array([value]), UNITS[unit].factor), [expected])
