"""Predictions: bands, what happens beyond the fitted range, and films of another thickness."""

from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.errors import DataError
from bayesmembrane.hypothesis import hypothesis
from bayesmembrane.inference.predictive import bands, break_points
from bayesmembrane.inference.run import Run, sample
from bayesmembrane.measurement import Measurement, Specimen
from bayesmembrane.mechanics import solve
from bayesmembrane.registry import material
from bayesmembrane.rigs.annulus import Annulus

FILM, END = [5.3, 14.0], 0.0915
D = np.linspace(5e-3, END, 14)


def truth(deflection: np.ndarray) -> np.ndarray:
    return solve(material("gent"), FILM, deflection, inner_radius=0.01, outer_radius=0.035).force[0]


@pytest.fixture(scope="module")
def run() -> Run:
    force = truth(D) + 0.02 * np.random.default_rng(8).standard_normal(D.size)
    curve = Measurement(D, force, Annulus(0.01, 0.035), Specimen("film", 5e-5))
    return sample(curve.up_to(0.06), hypothesis("gent"), seed=5)


def test_bands_hold_the_truth_and_widen_beyond_the_fit(run: Run) -> None:
    b = bands(run)
    end = np.max(run.measurement.deflection)
    assert b.deflection[0] == 0.0
    assert b.deflection[-1] == pytest.approx(END)
    assert end in b.deflection
    assert np.array_equal(b.extrapolated, b.deflection > end)
    inner = (b.deflection > 0) & ~b.extrapolated
    true = truth(b.deflection[inner])
    assert np.mean((b.low[inner] <= true) & (true <= b.high[inner])) > 0.6
    assert np.all(b.new_low[inner] <= b.low[inner])
    assert np.all(b.high[inner] <= b.new_high[inner])
    width = (b.high - b.low)[1:] / b.mean[1:]
    assert width[-1] > 3 * np.max(width[inner[1:]][-5:])
    assert b.mean[0] == b.low[0] == 0.0


def test_films_that_lock_beyond_the_fit_are_counted(run: Run) -> None:
    at = np.array([0.05, 0.09, 0.13])
    b = bands(run, at)
    assert b.lost[0] == 0.0
    assert b.lost[2] > 0.5
    assert set(b.reasons) == {"locked"}
    assert sum(b.reasons.values()) == round(float(np.sum(b.lost)) * b.draws)
    assert "have no force any more" in b.sentences[0]
    assert not bands(run, at[:1]).sentences


def test_where_nothing_is_left_the_band_is_nan(run: Run) -> None:
    b = bands(run, np.array([0.05, 0.5]))
    assert np.isnan(b.mean[1])
    assert np.isnan(b.low[1])
    assert b.lost[1] == 1.0


def test_force_scales_with_thickness(run: Run, tmp_path: Path) -> None:
    table = tmp_path / "break.csv"
    table.write_text("specimen,thickness_um,deflection_mm,force_N\na,50,60,4.0\nb,100,60,8.0\nc,50,400,30\n")
    thin, thick, gone = break_points(run, table)
    assert thin.mean is not None
    assert thick.mean == pytest.approx(2 * thin.mean)
    assert thick.sd == pytest.approx(2 * thin.sd)  # type: ignore[operator]
    assert thin.mean == pytest.approx(truth(np.array([0.06]))[0], rel=0.02)
    assert thin.ratio == pytest.approx(4.0 / thin.mean)
    assert (gone.mean, gone.low, gone.ratio, gone.inside, gone.lost) == (None, None, None, False, 1.0)
    assert gone.extrapolated
    inside = tmp_path / "inside.csv"
    inside.write_text(f"specimen,thickness_um,deflection_mm,force_N\na,100,50,{2 * truth(np.array([0.05]))[0]}\n")
    assert break_points(run, inside)[0].inside


def test_the_published_break_points_are_read(run: Run) -> None:
    found = break_points(run, draws=40)
    assert [p.specimen for p in found] == ["1", "2", "3", "4", "5", "6"]
    assert [round(1e6 * p.thickness) for p in found] == [50, 50, 100, 100, 200, 200]


def test_a_bad_table_is_refused(run: Run, tmp_path: Path) -> None:
    table = tmp_path / "break.csv"
    table.write_text("name,thickness_um,deflection_mm,force_N\na,50,60,4.0\n")
    with pytest.raises(DataError, match="column specimen is missing"):
        break_points(run, table)
