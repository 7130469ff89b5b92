"""A modulus that no elastomer has is told, in the fit and in the posterior alike."""

from __future__ import annotations

from dataclasses import replace

import pytest

from bayesmembrane.calibration.fit import fit
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.data.shipped import shipped
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.words.elastomer import stiffness_sentence


@pytest.mark.parametrize("modulus", [3e3, 1e5, 5e6, 5e7])
def test_gels_and_rubbers_are_elastomers(modulus: float) -> None:
    assert stiffness_sentence(modulus) == ""


def test_forces_in_a_wrong_unit_are_told() -> None:
    m = read_measurement(shipped("elastosil_50um_op1.csv"), shipped("elastosil_50um_op1.toml"))
    good = fit(m, hypothesis("neo_hookean"))
    assert good.shear_modulus == pytest.approx(2 * good.parameters["neo_hookean.c1"].value / 50e-6)
    assert good.summary()["shear_modulus_Pa"] == good.shear_modulus
    assert stiffness_sentence(good.shear_modulus) == ""
    wrong = fit(
        replace(m, force=1e3 * m.force, covariance=1e6 * m.covariance, force_sd=1e3 * m.force_sd),
        hypothesis("neo_hookean"),
    )
    assert wrong.shear_modulus == pytest.approx(1e3 * good.shear_modulus, rel=1e-6)
    assert "305 MPa, which no elastomer has" in stiffness_sentence(wrong.shear_modulus)
