"""Stability limits stand beside every calibrated material, however it was calibrated."""

import json
from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.calibration.fit import fit
from bayesmembrane.calibration.joint.claim import joint
from bayesmembrane.calibration.joint.fit import fit_jointly
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.materials.mooney_rivlin import MooneyRivlin
from bayesmembrane.physics.rigs.base import Homogeneous
from bayesmembrane.physics.rigs.equibiaxial import Equibiaxial
from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from bayesmembrane.physics.stability import stability
from bayesmembrane.report.page import TWIN, write_report

C1, C2 = 200.0, -12.0  # N/m
STRETCH = np.linspace(1.05, 2.0, 15)
CLAIM = hypothesis("mooney_rivlin", convexity="none")


def pulled(rig: Homogeneous) -> Measurement:
    """A Mooney-Rivlin film whose second constant is negative, without noise."""
    biaxial = rig.name == "equibiaxial"
    power, bend = (-5, STRETCH**2) if biaxial else (-2, 1 / STRETCH)
    force = rig.width * 2 * (STRETCH - STRETCH**power) * (C1 + C2 * bend)
    return Measurement(rig.length * (STRETCH - 1), force, rig, Specimen(rig.name, 1e-3))


@pytest.mark.parametrize("tests", [("uniaxial",), ("uniaxial", "equibiaxial")])
def test_of_least_squares_in_one_test_and_in_several(tests: tuple[str, ...], tmp_path: Path) -> None:
    rigs = {"uniaxial": Uniaxial(), "equibiaxial": Equibiaxial()}
    measured = [pulled(rigs[name]) for name in tests]
    found = fit(measured[0], CLAIM) if len(measured) == 1 else fit_jointly(joint(measured, CLAIM))
    write_report([found], tmp_path)
    rows = json.loads((tmp_path / TWIN).read_text())["tables"]["stability limits"]
    limits = stability(MooneyRivlin, [[C1, C2]]).limits
    assert {(row["mode"], row["side"]) for row in rows} == {k for k, v in limits.items() if np.isfinite(v[0])}
    for row in rows:
        assert row["median"] == pytest.approx(limits[row["mode"], row["side"]][0], rel=1e-3)
        assert row["share"] is None
        assert row["run"] == "Mooney-Rivlin, least squares"
