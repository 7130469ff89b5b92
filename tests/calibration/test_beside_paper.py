"""Our optimum beside the paper's parameters."""

import numpy as np
import pytest

from bayesmembrane.calibration.beside_paper import compare_with_paper, paper_break_points, paper_rates
from bayesmembrane.calibration.fit import fit
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics.api import force_curve
from bayesmembrane.physics.rigs.annulus import Annulus

AT = np.linspace(0.004, 0.0351, 6)


@pytest.fixture(scope="module")
def measurement() -> Measurement:
    return Measurement(AT, force_curve("neo_hookean", (7.0,), AT)[0], Annulus(0.010, 0.035), Specimen("film", 50e-6))


def test_losses_stand_side_by_side(measurement: Measurement) -> None:
    (row,) = compare_with_paper(measurement, [fit(measurement, hypothesis("neo_hookean"))], "OP1")
    assert row.parameters["c1"] == pytest.approx(7.0)
    assert row.published == {"c1": 7.6191}
    assert row.printed == 0.23184398
    expected = np.linalg.norm(force_curve("neo_hookean", (7.6191,), AT)[0] - measurement.force)
    assert row.evaluated == pytest.approx(expected)
    assert row.least_evaluated is not None
    assert row.least_evaluated <= expected
    assert row.ours < 1e-6
    assert row.end == pytest.approx(0.0351)


def test_other_losses_and_ranges_are_refused(measurement: Measurement) -> None:
    found = fit(measurement, hypothesis("neo_hookean"))
    with pytest.raises(SettingsError, match='no range of the paper called "OP3"'):
        compare_with_paper(measurement, [found], "OP3")


def test_the_published_break_points() -> None:
    breaks = paper_break_points()
    assert [b.specimen for b in breaks] == ["1", "2", "3", "4", "5", "6"]
    assert breaks[2].thickness == pytest.approx(100e-6)
    assert breaks[2].deflection == pytest.approx(0.083)
    assert breaks[2].force == pytest.approx(18.8)


def test_the_published_forces_at_three_speeds() -> None:
    rates = paper_rates()
    assert [r.speed for r in rates] == pytest.approx([1e-4, 1e-3, 1e-2])
    assert [r.force for r in rates] == [16.8, 17.0, 19.5]
