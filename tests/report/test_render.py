"""How plain text is set on a page."""

import pytest

from bayesmembrane.report.render import set_in_type


@pytest.mark.parametrize(
    ("plain", "typed"),
    [
        ("3.2 +- 0.1 mN", "3.2 \u00b1 0.1 mN"),
        ("+-", "\u00b1"),
        ("shift -2.19 mm", "shift \u22122.19 mm"),
        ("a 50 um film", "a 50 \u00b5m film"),
        ("60.9 % of it", "60.9 % of it"),
        ("VHB-4910, 2-3 mm", "VHB-4910, 2-3 mm"),
        ("set in 3 maps", "set in 3 maps"),
        ("9.1e-06 N", "9.1e-06 N"),
    ],
)
def test_signs_and_units(plain: str, typed: str) -> None:
    assert set_in_type(plain) == typed
