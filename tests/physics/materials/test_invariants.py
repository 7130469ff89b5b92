"""Kinematics of the invariants: digits at small strain, symmetry, and what compiled kernels know of their texts."""

from dataclasses import dataclass
from typing import Any, ClassVar

import mpmath
import numpy as np
import pytest

from bayesmembrane.physics.materials import invariants
from bayesmembrane.physics.materials.invariants import both_invariants, first_invariant, of_both, of_first
from bayesmembrane.physics.materials.neo_hookean import NeoHookean
from bayesmembrane.physics.materials.ogden import Ogden
from bayesmembrane.physics.materials.yeoh import Yeoh

ORDERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))


def k1(a: Any, b: Any) -> Any:
    return a**2 + b**2 + (a * b) ** -2 - 3


def k2(a: Any, b: Any) -> Any:
    return (a * b) ** 2 + a**-2 + b**-2 - 3


@pytest.mark.parametrize("strain", [1e-8, 1e-5, 1e-2, 0.5])
def test_no_digits_are_lost(strain: float) -> None:
    """Against the definitions in 60 digits, down to strains whose squares a double beside 1 cannot hold."""
    l1, l2 = 1.0 + strain, 1.0 + 0.3 * strain
    for found, definition in zip(both_invariants(l1, l2), (k1, k2), strict=True):
        with mpmath.workdps(60):
            at = mpmath.mpf(l1), mpmath.mpf(l2)
            expected = [definition(*at), *(mpmath.diff(definition, at, n) for n in ORDERS[1:])]
        assert np.array(found) == pytest.approx(np.array([float(v) for v in expected]), rel=2e-13)
    assert both_invariants(l1, l2)[0] == pytest.approx(first_invariant(l1, l2), rel=1e-15)


def test_of_first_is_of_both_where_the_second_plays_no_part() -> None:
    l1, l2 = np.random.default_rng(1).uniform(0.8, 2.0, (2, 20))
    i = both_invariants(l1, l2)
    psi, d, dd = i[0][0] ** 3, 3 * i[0][0] ** 2, 6 * i[0][0]
    one, both = of_first(i[0], psi, d, dd), of_both(i, psi, (d, 0.0), (dd, 0.0, 0.0))
    for a, b in zip(one, both, strict=True):
        assert a == pytest.approx(b, rel=1e-13)


def test_compiled_kernels_know_the_texts_that_closed_forms_call(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels are kept on disk under a hash of `source_text`: it must change with what stands in another file."""

    @dataclass(frozen=True)
    class Softer(NeoHookean):
        name: ClassVar[str] = "softer"

    assert "def first_invariant" in Yeoh.source_text()
    assert "def both_invariants" not in Yeoh.source_text()
    assert "def first_invariant" not in Ogden.source_text()
    assert "p[0] * i[1]" in Softer.source_text(), "the closed forms that it inherits are its own, too"
    before = Yeoh.source_text()
    monkeypatch.setitem(Yeoh.derivatives.__globals__, "first_invariant", both_invariants)
    assert Yeoh.source_text() != before
    assert invariants.first_invariant is not Yeoh.derivatives.__globals__["first_invariant"]
