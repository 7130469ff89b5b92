from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.calibration.crosscheck import crosscheck
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.registry import material
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics import Request, solve
from bayesmembrane.physics.mechanics.solution import Curves
from bayesmembrane.physics.rigs.biaxial import Biaxial

FILMS = {
    "neo_hookean": (7.5,),
    "mooney_rivlin": (6.6, 0.5),
    "gent": (5.3, 30.0),
    "yeoh": (8.0, -0.2, 0.03),
    "ogden": (11.0, 0.2, -0.4, 1.5, 4.8, -1.2),
}


@pytest.mark.parametrize("name", FILMS)
def test_the_solvers_agree(film, name: str) -> None:  # type: ignore[no-untyped-def]
    curve = film(name, FILMS[name])
    x = material(name).to_coordinates(FILMS[name]) * (1 + 0.02 * np.random.default_rng(0).standard_normal((30, 1)))
    found = crosscheck(Forward(hypothesis(name), curve, curve.deflection), x)
    assert found.draws == 16
    assert found.compared == 16 * len(curve)
    assert found.missing == 0
    assert 0 < found.largest < 1e-6
    assert found.summary()["largest"] == found.largest


def test_a_disagreement_is_found(film) -> None:  # type: ignore[no-untyped-def]
    def wrong(asked: Request) -> Curves:
        curves = solve(asked)
        force = curves.force.copy()
        if asked.solver == "shooting":
            force[:, 3] *= 1.01
        return replace(curves, force=force)

    curve = film("gent", (5.3, 30.0))
    x = np.tile(material("gent").to_coordinates([5.3, 30.0]), (4, 1))
    found = crosscheck(Forward(hypothesis("gent"), curve, curve.deflection, wrong), x)
    assert found.largest == pytest.approx(0.01, rel=1e-4)
    assert found.at_mm == pytest.approx(1e3 * curve.deflection[3])
    assert found.draws == 4


def test_nothing_to_compare_is_no_agreement(film) -> None:  # type: ignore[no-untyped-def]
    curve = film("gent", (5.3, 30.0))
    x = np.tile(material("gent").to_coordinates([5.3, 1e-4]), (4, 1))
    found = crosscheck(Forward(hypothesis("gent"), curve, curve.deflection), x)
    assert found.compared == 0
    assert found.summary()["largest"] is None


@pytest.mark.parametrize("part", [slice(None), slice(1, None, 2)])
def test_a_biaxial_test_is_compared_reading_by_reading(part: slice) -> None:
    """Also a part of it, and though several readings have one stretch."""
    rig = Biaxial()
    l1, l2 = np.array([1.2, 1.2, 1.5, 1.5]), np.array([0.95, 1.2, 1.0, 1.3])
    found = rig.from_columns(dict(zip(rig.columns, (l1, l2, 1e5 * l1, 1e5 * l2), strict=True)), 1e-3)
    whole = Measurement(found["deflection"], found["force"], rig, Specimen("film", 1e-3), across=found["across"])
    curve = whole.select(np.arange(8)[part])
    x = np.tile(material("gent").to_coordinates([50.0, 30.0]), (4, 1))
    found_check = crosscheck(Forward(hypothesis("gent"), curve, curve.deflection), x)
    assert found_check.compared == 4 * len(curve)
    assert found_check.missing == 0
