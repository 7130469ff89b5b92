"""Phases of a test: robust to noise and inexact turning points, what columns say stands over what is read off."""

from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.calibration.layout import laid_out, measurement_of
from bayesmembrane.data.exports.hints import Hints
from bayesmembrane.data.importers.base import import_export
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.motion import cycles, holds, legs, reached
from bayesmembrane.data.phases import SHOWN, phases_of
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.data.thinning import thinned
from bayesmembrane.ground.errors import DataError, SettingsError
from bayesmembrane.physics.rigs.annulus import Annulus

CORNERS = ([0.0, 0.2, 0.3, 0.5, 0.75, 1.0], [0.0, 25.0, 25.0, 5.0, 30.0, 0.0])
SPECIMEN = "[specimen]\nthickness_um = 50\n[rig]\nkind = 'annulus'\ninner_radius_mm = 10\nouter_radius_mm = 35\n"


def travel(n: int, noise: float = 0.0) -> np.ndarray:
    """(N,) m: up to 25 mm, a rest, down to 5, up to 30, down."""
    x = np.interp(np.linspace(0, 1, n), *CORNERS)
    return 1e-3 * (x + noise * np.random.default_rng(5).standard_normal(n))


def lifted(x: np.ndarray) -> Measurement:
    rig = Annulus(0.01, 0.035)
    return Measurement(x, 10 * x, rig, Specimen("film", 5e-5), time=np.arange(x.size) * 1e-2)


@pytest.mark.parametrize("n", [400, 5000, 40_000])
@pytest.mark.parametrize("noise", [0.0, 0.01, 0.1])
def test_noise_makes_no_cycles(n: int, noise: float) -> None:
    """Noise of a third of a per cent of the range swings over three per cent of it in a long record."""
    leg = legs(travel(n, noise))
    assert np.count_nonzero(np.diff(leg)) == 3
    assert cycles(leg)[-1] == 2
    turns = np.flatnonzero(np.diff(leg)) / n
    assert turns[1:] == pytest.approx([0.5, 0.75], abs=0.02)
    assert 0.19 < turns[0] < 0.32


def test_one_reading_alone_is_no_maximum() -> None:
    x = travel(1000)
    x[300] = 0.2
    assert np.max(reached(x)) == pytest.approx(0.03, rel=1e-2)
    short = travel(100)
    assert np.array_equal(reached(short), np.maximum.accumulate(short))


def test_holds_of_a_long_record_are_those_of_a_short_one() -> None:
    ((a,), (b,)) = holds(travel(2000)), holds(travel(100_000))
    assert (b[0] / 50, b[-1] / 50) == pytest.approx((a[0], a[-1]), abs=30)


def test_what_columns_say_stands_over_what_is_read_off(tmp_path: Path) -> None:
    rows = "".join(
        f"{k},{x},{0.01 * k + 0.1},{1 + (k >= 3)},{1 if k < 4 else -1}\n" for k, x in enumerate([1, 2, 3, 4, 5, 6])
    )
    (tmp_path / "c.csv").write_text("time_s,deflection_mm,force_N,cycle,direction\n" + rows)
    (tmp_path / "c.toml").write_text(SPECIMEN)
    m = read_measurement(tmp_path / "c.csv", tmp_path / "c.toml")
    assert m.leg.tolist() == [1, 1, 1, 1, -1, -1]
    assert m.cycle.tolist() == [1, 1, 1, 2, 2, 2]
    assert not any("ignored" in note for note in m.provenance.notes)
    part = m.select(np.arange(2, 5))
    assert (part.leg.tolist(), part.cycle.tolist()) == ([1, 1, -1], [1, 2, 2])
    back = measurement_of(laid_out(part))
    assert (back.data_hash, back.leg.tolist()) == (part.data_hash, part.leg.tolist())
    read_off = read_measurement(tmp_path / "c.csv", tmp_path / "c.toml")
    assert read_off.data_hash == m.data_hash
    (tmp_path / "c.csv").write_text(
        "time_s,deflection_mm,force_N\n" + "\n".join(r.rsplit(",", 2)[0] for r in rows.split())
    )
    assert read_measurement(tmp_path / "c.csv", tmp_path / "c.toml").data_hash != m.data_hash


@pytest.mark.parametrize(("column", "bad"), [("cycle", "0"), ("cycle", "1.5"), ("direction", "0")])
def test_a_phase_that_cannot_be_is_refused(tmp_path: Path, column: str, bad: str) -> None:
    (tmp_path / "c.csv").write_text(f"deflection_mm,force_N,{column}\n1,0.1,1\n2,0.2,{bad}\n3,0.3,1\n")
    (tmp_path / "c.toml").write_text(SPECIMEN)
    with pytest.raises(DataError, match=f"line 3, column {column}: {bad} is no {column}"):
        read_measurement(tmp_path / "c.csv", tmp_path / "c.toml")


def test_phases_to_be_looked_at() -> None:
    assert phases_of(lifted(travel(1000)[:150])) is None
    found = phases_of(lifted(travel(20_000, 0.01)))
    assert found is not None
    assert (found.deflection.size <= SHOWN, found.readings, found.said) == (True, 20_000, ())
    assert [int(np.sign(found.leg[p[0]])) * (not found.still[p[0]]) for p in found.parts] == [1, 0, -1, 1, -1]


def test_thinning_keeps_turning_points() -> None:
    x = travel(30_000)
    few = thinned(lifted(x), 500)
    turns = np.flatnonzero(np.diff(legs(x)))
    assert set(turns) <= set(few.on_path)


def test_readings_that_are_asked_for(tmp_path: Path) -> None:
    x = 1e3 * travel(3000)
    rows = "".join(f"{k},{v:.6f},{10 * v:.6f}\n" for k, v in enumerate(x))
    (tmp_path / "e.csv").write_text("Time (s),Extension (mm),Load (N)\n" + rows)
    written = import_export(tmp_path / "e.csv", tmp_path / "c.csv", Hints(readings=100))
    kept = np.loadtxt(written.curve, delimiter=",", skiprows=1)
    assert len(kept) <= 100
    assert set(np.flatnonzero(np.diff(legs(x)))) <= set(kept[:, 0].astype(int))
    assert "of 3000" in next(g.value for g in written.guesses if g.what == "readings")
    assert "of 3000" in written.specimen.read_text()
    with pytest.raises(SettingsError, match="at least 20"):
        Hints(readings=5)


def test_cycles_of_the_machine_are_kept(tmp_path: Path) -> None:
    rows = [("1-Stretch", 0), ("1-Stretch", 2), ("1-Hold", 2.1), ("1-Recover", 1), ("1-Recover", 0.2), ("2-Stretch", 2)]
    text = "Cycle,Time_S,Displacement_mm,Force_N\n" + "".join(f"{w},{k},{x},{x / 3}\n" for k, (w, x) in enumerate(rows))
    (tmp_path / "e.csv").write_text(text)
    written = import_export(
        tmp_path / "e.csv",
        tmp_path / "c.csv",
        Hints(rig="annulus", thickness=5e-5, inner_radius=0.01, outer_radius=0.035),
    )
    m = read_measurement(written.curve, written.specimen)
    assert m.leg.tolist() == [1, 1, 1, -1, -1, 1]
    assert m.cycle.tolist() == [1, 1, 1, 1, 1, 2]
