"""The measured cycles that ship: what they are, from whom, and that they are cycles."""

import numpy as np
import pytest

from bayesmembrane.data.reading import read_measurement
from bayesmembrane.data.shipped import shipped
from tests.studies.vhb_data import FOLDER, cycles

RATES = {"0d01": 0.01, "0d03": 0.03, "0d05": 0.05}
each = pytest.mark.parametrize("name", RATES)


@each
def test_a_cycle_that_ships_is_one_loading_and_unloading_at_its_rate(name: str) -> None:
    m = read_measurement(shipped(f"vhb4910_{name}.csv"), shipped(f"vhb4910_{name}.toml"))
    assert m.rig.name == "uniaxial"
    assert m.time is not None
    assert np.max(m.cycle) == 1
    assert np.count_nonzero(np.diff(m.leg)) == 1
    length = m.deflection / (m.full_range / 1.5)
    assert np.max(length) == pytest.approx(1.5, rel=0.01)
    assert np.abs(np.diff(length) / np.diff(m.time)) == pytest.approx(RATES[name], rel=0.02)
    loading, back = m.leg > 0, m.leg < 0
    half = 0.5 * m.full_range
    above = np.interp(half, m.deflection[loading], m.force[loading])
    assert above > 1.2 * np.interp(half, m.deflection[back][::-1], m.force[back][::-1])


@each
def test_source_and_licence_stand_beside_it(name: str) -> None:
    origin = read_measurement(shipped(f"vhb4910_{name}.csv"), shipped(f"vhb4910_{name}.toml")).provenance.origin
    assert "MEASURED" in origin
    assert "github.com/Chongran-Zhao/Viscoelastic-fitting" in origin
    licence = shipped("vhb4910_licence.txt").read_text(encoding="utf-8")
    assert f"vhb4910_{name}.csv" in licence
    assert "Permission is hereby granted" in licence


@pytest.mark.skipif(not FOLDER.is_dir(), reason="the measurements of VHB 4910 are not here")
@each
def test_its_numbers_are_those_of_the_source(name: str) -> None:
    m = read_measurement(shipped(f"vhb4910_{name}.csv"), shipped(f"vhb4910_{name}.toml"))
    (same,) = [c.measurement for c in cycles() if (c.peak, c.rate) == (2.5, RATES[name])]
    assert m.force == pytest.approx(same.force, rel=1e-8)
    # Stretches are written with nine digits, and a stretch of one is no deflection.
    assert m.deflection == pytest.approx(same.deflection, abs=5e-9 * m.rig.length)
    assert m.time == pytest.approx(same.time, rel=1e-8)
