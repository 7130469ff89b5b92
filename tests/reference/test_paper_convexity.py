"""Which convexity statements of the paper hold: the table that ships is what the program finds today."""

from __future__ import annotations

import csv
import tomllib

import numpy as np
import pytest

from tests.reference.paper_convexity import FILE, rows

NUMBERS = ("margin", "worst_l1", "worst_l2", "elliptic_margin")


@pytest.fixture(scope="module")
def shipped():
    with FILE.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_table_that_ships_is_what_is_found(shipped):
    found = rows()
    assert len(found) == len(shipped)
    for new, old in zip(found, shipped, strict=True):
        for key in new:
            if key not in NUMBERS:
                assert new[key] == old[key], (new["statement"], key)
            elif key.startswith("worst"):
                assert float(new[key]) == pytest.approx(float(old[key]), abs=0.02)
            elif new[key]:
                assert float(new[key]) == pytest.approx(float(old[key]), rel=1e-4)


def test_what_does_not_hold(shipped):
    wrong = [(r["statement"], r["material"]) for r in shipped if r["holds"] == "false"]
    assert wrong == [
        ("initial parameters, convex (figure)", "mooney_rivlin"),
        ("the other sign of C01, yet convex near l2 = 1", "mooney_rivlin"),
        ("Ogden set (6), as printed", "ogden"),
    ]
    assert sum(r["holds"] == "true" for r in shipped) == 12


def test_the_false_statements_by_hand(shipped):
    """The three in closed form, at one point each: no search is needed to refute them."""
    table = {(r["statement"], r["material"]): r for r in shipped}
    # Mooney-Rivlin at l1 = l2 = l: H11 - H12 = 2 c1 (1 + l^-6) + 2 c2 (3 l^-4 - l^2).
    initial = table["initial parameters, convex (figure)", "mooney_rivlin"]
    by_hand = (0.14 * (1 + 8.0**-6) + 0.01 * (3 * 8.0**-4 - 64)) / 0.15
    assert float(initial["margin"]) == pytest.approx(by_hand, rel=1e-5)
    # The other sign at (8, 1): H22 = 2 c1 (1 + 3 / 64) + 2 c2 (64 + 3) < 0, so the least eigenvalue is below it.
    edge = table["the other sign of C01, yet convex near l2 = 1", "mooney_rivlin"]
    by_hand = (0.16 * (1 + 3 / 64) - 0.01 * (64 + 3)) / 0.15
    assert float(edge["margin"]) < by_hand < 0
    # Ogden at l1 = l2 = l: H11 - H12 = sum mu l^-2 ((a - 1) l^a + (a + 1) l^-2a - a l^-2a).
    mu, a = np.array([0.355, 0.0005, -0.00413]), np.array([2.11, 2.58, -3.67])
    by_hand = np.sum(mu * ((a - 1) * 8.0**a + 8.0 ** (-2 * a))) / 64 / (0.5 * np.sum(mu * a))
    six = table["Ogden set (6), as printed", "ogden"]
    assert float(six["margin"]) == pytest.approx(by_hand, rel=1e-5)


def test_set_1_turns_convex_in_the_convention_of_its_source(shipped):
    table = {r["statement"]: r["convex"] for r in shipped}
    assert table["Ogden set (1), as printed"] == "false"
    assert table["Ogden set (1), if printed for 2 mu / a^2"] == "true"
    assert table["Ogden set (3), if printed for 2 mu / a^2"] == "false"


def test_columns_are_explained(shipped):
    notes = tomllib.loads(FILE.with_suffix(".toml").read_text(encoding="utf-8"))
    assert set(notes["columns"]) == set(shipped[0])
