"""Forces from another solver, which finite elements confirmed, to the last printed digit."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import pytest

from bayesmembrane.ground.registry import material
from bayesmembrane.physics.mechanics import SOLVERS, force_curve, request, solve

DEFLECTIONS = np.array([0.5, 2.0, 5.0, 10.0, 20.0, 35.1, 60.0, 91.5]) * 1e-3
# N, as printed (six digits, trailing zeros left out); parameters in N/m, exponents and Gent's limit dimensionless.
TABLE = [
    ("neo_hookean", (7.5,), 1.0, "3.11351e-05 0.00197445 0.0293379 0.19882 0.95419 2.3151 4.3786 6.83061"),
    (
        "mooney_rivlin",
        (6.21436, 1.4703426),
        1.0,
        "3.19017e-05 0.0020229 0.0300446 0.203356 0.973959 2.34886 4.31855 6.47332",
    ),
    ("gent", (5.312, 17.42), 1.0, "2.2052e-05 0.00139844 0.020781 0.141017 0.688575 1.82753 4.64874 18.7046"),
    (
        "yeoh",
        (8.840838, -0.6303258, 0.05632747),
        1.0,
        "3.67014e-05 0.00232743 0.0345747 0.233541 1.07159 2.25269 4.53009 18.6213",
    ),
    (
        "ogden",
        (11.060008, 0.1959017, -0.3679535, 1.5196142, 5.805068, -1.1529809),
        1.0,
        "1.90634e-05 0.00120888 0.0179599 0.121693 0.58786 1.56417 4.57207 18.0476",
    ),
    ("neo_hookean", (7.5,), 1.03, "0.00614218 0.0262679 0.0870964 0.292408 1.04611 2.36642 4.39977 6.83908"),
]
IDS = [f"{name}, pre-stretch {l0:g}" for name, _, l0, _ in TABLE]


def half_a_unit(printed: str) -> float:
    """Half a unit in the sixth significant digit; zeros at the end were not printed."""
    return 0.5 * 10.0 ** (Decimal(printed).adjusted() - 5)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize(("name", "parameters", "prestretch", "printed"), TABLE, ids=IDS)
def test_forces_round_to_the_printed_ones(name, parameters, prestretch, printed, solver):
    curves = solve(
        request(
            material(name),
            parameters,
            DEFLECTIONS,
            inner_radius=0.010,
            outer_radius=0.035,
            prestretch=prestretch,
            solver=solver,
        )
    )
    assert curves.ok.all()
    for force, text in zip(curves.force[0], printed.split(), strict=True):
        assert force == pytest.approx(float(text), rel=0, abs=1.001 * half_a_unit(text))


@pytest.mark.parametrize(("name", "parameters", "prestretch", "printed"), TABLE, ids=IDS)
def test_force_curve_by_name_says_ok(name, parameters, prestretch, printed):
    forces, words = force_curve(name, parameters, DEFLECTIONS, 0.010, 0.035, prestretch)
    assert words == ["ok"] * 8
    assert forces == pytest.approx([float(text) for text in printed.split()], rel=1e-5)
