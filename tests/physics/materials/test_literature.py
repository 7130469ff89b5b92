"""Energies against the literature: closed forms beside a symbolic derivation from the published formula."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import sympy

from bayesmembrane.ground.registry import material as named
from tests.physics.materials.films import exact, films

L1, L2 = sympy.symbols("l1 l2", positive=True)
J = L1 * L2
I1 = L1**2 + L2**2 + J**-2
I2 = J**2 + L1**-2 + L2**-2
C = sympy.symbols("c1:4")
A = sympy.symbols("a1:4")
LANGEVIN = [sympy.Rational(*k) for k in ((1, 2), (1, 20), (11, 1050), (19, 7000), (519, 673750))]

ENERGIES = {
    "neo_hookean": ((C[0],), C[0] * (I1 - 3)),
    "mooney_rivlin": ((C[0], C[1]), C[0] * (I1 - 3) + C[1] * (I2 - 3)),
    "gent": ((C[0], C[1]), -C[0] * C[1] * sympy.log(1 - (I1 - 3) / C[1])),
    "yeoh": (C, sum(c * (I1 - 3) ** (i + 1) for i, c in enumerate(C))),
    "ogden": (C + A, sum(c / a * (L1**a + L2**a + J**-a - 3) for c, a in zip(C, A, strict=True))),
    "arruda_boyce": (
        (C[0], A[0]),
        C[0] * sum(k / A[0] ** i * (I1 ** (i + 1) - 3 ** (i + 1)) for i, k in enumerate(LANGEVIN)),
    ),
    "gent_thomas": ((C[0], C[1]), C[0] * (I1 - 3) + C[1] * sympy.log(I2 / 3)),
    "exp_ln": (
        (C[0], A[0], A[1]),
        C[0] * (sympy.exp(A[0] * (I1 - 3)) / A[0] + A[1] * (I1 - 2) * (1 - sympy.log(I1 - 2)) - 1 / A[0] - A[1]),
    ),
    "lopez_pamies": (
        C[:2] + A[:2],
        sum(c * 3 ** (1 - a) / (2 * a) * (I1**a - 3**a) for c, a in zip(C[:2], A[:2], strict=True)),
    ),
}

pytestmark = pytest.mark.parametrize("material", [named(name) for name in ENERGIES], ids=list(ENERGIES))


@cache
def symbolic(name):
    """Functions of (p..., l1, l2) in arbitrary precision: the six derivatives, and three sensitivities per field."""
    fields, w = ENERGIES[name]
    first = [w, w.diff(L1), w.diff(L2)]
    six = [*first, first[1].diff(L1), first[1].diff(L2), first[2].diff(L2)]
    sens = [[f.diff(p) for f in first] for p in fields]
    arguments = (*fields, L1, L2)
    return sympy.lambdify(arguments, six, "mpmath", cse=True), sympy.lambdify(arguments, sens, "mpmath", cse=True)


def test_derivatives_are_those_of_the_energy(material):
    for p, l1, l2 in zip(*films(material, 40), strict=True):
        expected = exact(symbolic(material.name)[0], p, l1, l2)
        scale = np.abs(expected) + 1e-3 * np.abs(material.shear_modulus(p))
        np.testing.assert_array_less(np.abs(material.derivatives(p, l1, l2) - expected) / scale, 1e-11)


def test_sensitivities_are_those_of_the_energy(material):
    for p, l1, l2 in zip(*films(material, 40), strict=True):
        expected = exact(symbolic(material.name)[1], p, l1, l2)
        error = np.abs(np.array(material.sensitivities(p, l1, l2)) - expected)
        np.testing.assert_allclose(error / (np.abs(expected) + 1e-4 * np.abs(expected).max(0)), 0, atol=1e-10)


def test_tensions_keep_their_digits_at_small_strain(material):
    for p, e1, e2 in zip(*films(material, 20, spread=(1.0, 1.001)), strict=True):
        l1, l2 = 1 + 1e-3 * (e1 - 1) + 1e-6, 1 + 1e-3 * (e2 - 1) + 1e-6
        expected = exact(symbolic(material.name)[0], p, l1, l2)
        got = material.derivatives(p, l1, l2)
        np.testing.assert_allclose(got[1:], expected[1:], rtol=1e-9)
        np.testing.assert_allclose(got[0], expected[0], rtol=1e-9)
