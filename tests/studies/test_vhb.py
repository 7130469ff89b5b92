"""The study of VHB 4910: its reader, its predictions, and what it says of its numbers."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.ground.errors import DataError
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from tests.studies.vhb import Trial, Tried, predicted
from tests.studies.vhb_data import FOLDER, RIG, TAPE, Cycle, cycles, difference, even, fast_cycle, kPa, read_cycle
from tests.studies.vhb_page import winners

needs_data = pytest.mark.skipif(not FOLDER.is_dir(), reason="the measurements of VHB 4910 are not here")
STRETCH = np.concatenate([np.linspace(1.0, 1.5, 26), np.linspace(1.49, 1.1, 25)])


def cycle(stretch: np.ndarray, stress: np.ndarray, rate: float = 0.03) -> Cycle:
    time = np.cumsum(np.abs(np.diff(stretch, prepend=1.0))) / rate
    d = RIG.length * (stretch - 1)
    m = Measurement(d, stress * RIG.width * TAPE.thickness, RIG, TAPE, time=time + 1e-12 * np.arange(d.size))
    return Cycle(float(stretch.max()), rate, m)


def test_a_workbook_is_read_as_stress_and_stretch(tmp_path: Path) -> None:
    path = tmp_path / "loading_1d5_unloading_0d03.xlsx"
    stress = 40 * (STRETCH - 1)
    pd.DataFrame([np.arange(STRETCH.size), STRETCH, stress]).T.to_excel(path, header=False, index=False)
    found = read_cycle(path)
    assert (found.peak, found.rate) == (1.5, 0.03)
    assert 1 + found.measurement.deflection / RIG.length == pytest.approx(STRETCH)
    assert kPa(found.measurement.force) == pytest.approx(stress)


def test_other_names_and_columns_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="peak and rate"):
        read_cycle(tmp_path / "something.xlsx")
    path = tmp_path / "loading_1d5_unloading_0d03.xlsx"
    pd.DataFrame([STRETCH, STRETCH]).T.to_excel(path, header=False, index=False)
    with pytest.raises(DataError, match="three columns"):
        read_cycle(path)


@needs_data
def test_the_files_hold_what_their_names_say() -> None:
    found = cycles()
    assert [(c.peak, c.rate) for c in found] == [(p, r) for p in (1.5, 2.0, 2.5) for r in (0.01, 0.03, 0.05)]
    for c in found:
        m = c.measurement
        assert 1 + m.full_range / RIG.length == pytest.approx(c.peak, rel=0.01)
        assert even(c) < 1e-6
        assert np.count_nonzero(np.diff(m.leg)) == 1
        assert 20 < np.max(kPa(m.force)) < 60  # the unit of the files is the kPa
    fast = fast_cycle()
    assert 150 < np.max(kPa(fast.force)) < 300


def test_legs_that_differ_by_a_stress_differ_by_it() -> None:
    a, b = (cycle(STRETCH, 4e4 * (STRETCH - 1) + s) for s in (0.0, 500.0))
    assert difference(a.measurement, a.measurement) == pytest.approx(0, abs=1e-12)
    assert difference(a.measurement, b.measurement) == pytest.approx(0.5)


def test_times_that_were_measured_are_told_from_those_that_were_calculated() -> None:
    c = cycle(STRETCH, 4e4 * (STRETCH - 1))
    assert even(c) < 1e-6
    assert c.measurement.time is not None
    late = replace(c.measurement, time=c.measurement.time + np.where(np.arange(STRETCH.size) > 25, 0.1, 0.0))
    assert even(replace(c, measurement=late)) > 0.1


def test_a_set_that_a_cycle_leaves_is_the_same_in_a_prediction_of_a_shorter_one() -> None:
    """Histories keep the scale of the test they were fitted to: what comes first does not know where a test ends."""
    claim = hypothesis("neo_hookean", effects=["permanent_set"])
    whole = cycle(STRETCH, 4e4 * (STRETCH - 1) + 1.0).measurement
    part = whole.select(np.arange(15))
    x = np.array([np.log(60.0), 0.01, 2.0, 0.3, 0.2, 1.0, 0.5, -5.5, 0.5])
    force = Forward(claim, whole, whole.deflection)(x[None, :]).force[0]
    nothing = np.zeros((0, len(whole))), np.zeros(2), np.zeros(len(whole))
    fitted = Candidate(claim, x, whole.force - force, np.zeros((len(whole), x.size)), 0.0, (), *nothing)
    short = replace(part, full_range=float(part.deflection.max()), motion=None, places=None)
    assert predicted(fitted, short, whole.full_range) == pytest.approx(force[:15], rel=1e-9)
    assert predicted(fitted, short, short.full_range)[5:] != pytest.approx(force[5:15], rel=1e-3)


def tried(effect: str, inside: float, outside: float, explains: bool = True) -> Tried:
    return Tried("yeoh", (effect,) if effect else (), explains, False, "", inside, {0.01: outside}, {0.01: 0.0})


def test_the_best_fit_is_told_from_the_best_prediction() -> None:
    plain = tried("", 5.0, 6.0, False)
    right = Trial(
        "yeoh", 1.5, 0.03, "named", plain, (tried("viscoelastic", 0.1, 1.0), tried("permanent_set", 0.2, 2.0))
    )
    wrong = Trial(
        "yeoh", 2.0, 0.03, "named", plain, (tried("viscoelastic", 0.3, 1.0), tried("permanent_set", 0.2, 5.9))
    )
    assert "in 1 of 1 cycles" in winners([right])
    told = winners([right, wrong])
    assert "in 1 of 2 cycles" in told
    assert "permanent set fits best (0.2 kPa) and predicts to 5.9 kPa" in told
    assert "Of the 4 models that pass as an explanation of their own cycle, 1 predict" in told
