"""The slow references agree with each other, so that the fast solvers may be measured by them."""

from __future__ import annotations

import numpy as np
import pytest

from bayesmembrane.physics.materials.gent import Gent
from bayesmembrane.physics.materials.neo_hookean import NeoHookean
from tests.physics.mechanics.films import FIFTEEN, INNER, MM, OUTER, every_material, silicone
from tests.reference.slow_solver import force_curve, force_curve_bvp


@every_material
def test_collocation_equals_shooting_with_scipy(material):
    film, few = material.from_vector(silicone(material)), FIFTEEN[[1, 5, 9]]
    one = force_curve(film, few, INNER, OUTER, rtol=1e-8)
    assert force_curve_bvp(film, few, INNER, OUTER, tol=1e-6) == pytest.approx(one, rel=1e-6)


def test_methods_of_integration_agree():
    film, few = NeoHookean(7.5), np.array([5.0, 35.1]) * MM
    one, other = (force_curve(film, few, INNER, OUTER, rtol=1e-9, method=m) for m in ("DOP853", "LSODA"))
    assert one == pytest.approx(other, rel=1e-7)
    assert one == pytest.approx([0.0293379, 2.3151], rel=1e-5)


def test_forces_are_nan_from_where_the_reference_fails():
    force = force_curve(Gent(5.0, 2.0), np.array([10.0, 30.0, 45.0]) * MM, INNER, OUTER, rtol=1e-6)
    assert np.isfinite(force).tolist() == [True, True, False]
