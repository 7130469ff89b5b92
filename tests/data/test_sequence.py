"""Tests made one after another: what was one test, cut where the disc is down, is that test again."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import bayesmembrane as bm
from bayesmembrane.app.options import CurveOptions
from bayesmembrane.calibration.prior import JointPrior
from bayesmembrane.data.measurement import Measurement, Provenance, Specimen
from bayesmembrane.data.sequence import one_after_another
from bayesmembrane.ground.errors import DataError
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.physics.rigs.uniaxial import Uniaxial

RIG = Annulus(0.010, 0.035)
FILM = Specimen("film", 50e-6)
UP = np.linspace(0.0, 0.02, 11)


def measured(deflection: np.ndarray, time: np.ndarray | None, **more: object) -> Measurement:
    return Measurement(deflection, 1.0 + deflection, RIG, FILM, time=time, **more)  # type: ignore[arg-type]


def cyclic() -> Measurement:
    deflection = np.concatenate([UP, UP[-2::-1], UP[1:], UP[-2::-1]])
    return measured(deflection, np.arange(deflection.size, dtype=float), full_range=0.03)


def test_a_test_that_was_cut_where_the_disc_is_down_is_whole_again() -> None:
    whole = cyclic()
    first, second = (measured(whole.deflection[p], whole.time[p], full_range=0.03) for p in _halves(whole))  # type: ignore[index]
    joined = one_after_another([first, second])
    assert np.array_equal(joined.deflection, whole.deflection)
    assert np.array_equal(joined.time, whole.time)  # type: ignore[arg-type]
    assert np.array_equal(joined.cycle, whole.cycle)
    assert np.array_equal(joined.leg, whole.leg)
    assert joined.full_range == whole.full_range


def test_forces_of_a_film_that_remembers_are_those_of_the_whole_test() -> None:
    whole = cyclic()
    first, second = (measured(whole.deflection[p], whole.time[p], full_range=0.03) for p in _halves(whole))  # type: ignore[index]
    claim = hypothesis("neo_hookean", ["mullins", "viscoelastic", "permanent_set"])
    x = JointPrior(claim).draw(np.random.default_rng(2), 4)[:, : claim.curve_size]
    forces = [Forward(claim, m, m.deflection)(x).force for m in (whole, one_after_another([first, second]))]
    np.testing.assert_allclose(forces[1], forces[0], rtol=1e-12)


def test_the_way_back_and_the_rest_are_on_the_way() -> None:
    first = measured(UP[1:], np.arange(1.0, 11.0))  # 2 mm/s
    joined = one_after_another([first, first], rest=60.0)
    assert joined.path.deflection.size == 2 * len(first) + 1
    assert joined.path.deflection[len(first)] == 0.0
    assert joined.path.time is not None
    assert joined.path.time[len(first)] == pytest.approx(10.0 + 10.0 + 60.0)
    assert joined.time[len(first)] == pytest.approx(81.0)  # type: ignore[index]
    assert not np.any(joined.is_first_loading[len(first) : -1])
    assert joined.cycle.tolist() == 10 * [1] + 10 * [2]


def test_a_clock_that_goes_on_is_kept() -> None:
    first, later = measured(UP, np.arange(11.0)), measured(UP, 500.0 + np.arange(11.0))
    assert one_after_another([first, later], rest=60.0).time[11] == 500.0  # type: ignore[index]


def test_noise_and_origin_of_all_tests_are_kept() -> None:
    first = measured(UP, None, force_sd=np.full(11, 0.1), provenance=Provenance("a.csv", notes=("one",)))
    second = measured(UP, None, covariance=0.04 * np.eye(11), provenance=Provenance("b.csv"))
    joined = one_after_another([first, second])
    assert joined.force_sd is not None
    assert joined.covariance is not None
    assert joined.force_sd.tolist() == pytest.approx(11 * [0.1] + 11 * [0.2])
    np.testing.assert_allclose(joined.covariance, np.diag(joined.force_sd**2))
    assert joined.provenance.curve == "a.csv and b.csv"
    assert joined.provenance.notes == ("one", "2 tests of one film, made one after another, of 11, 11 readings")


def test_said_cycles_are_counted_on() -> None:
    one = measured(UP, None)
    said = replace(one, motion=replace(one.path, said_cycle=np.ones(11), said_leg=np.ones(11)))
    assert one_after_another([said, one]).cycle.tolist() == 11 * [1] + 11 * [2]


def test_one_test_is_itself() -> None:
    one = cyclic()
    assert one_after_another([one]) is one


@pytest.mark.parametrize(
    ("other", "said"),
    [
        (Measurement(UP, UP, Uniaxial(), FILM), "same rig"),
        (Measurement(UP, UP, RIG, Specimen("film", 60e-6)), "60 um thick here and 50 um"),
        (measured(UP, np.arange(11.0)), "need times"),
        (measured(UP, None, force_sd=np.full(11, 0.1)), "a stated noise"),
    ],
)
def test_tests_that_are_not_of_one_film_are_refused(other: Measurement, said: str) -> None:
    with pytest.raises(DataError, match=said):
        one_after_another([measured(UP, None), other])


def test_files_are_read_one_after_another_at_the_command_line(tmp_path: Path) -> None:
    (tmp_path / "film.toml").write_text(
        '[specimen]\nname = "film"\nthickness_um = 50\n[rig]\nkind = "annulus"\ninner_radius_mm = 10\n'
        "outer_radius_mm = 35\n",
        encoding="utf-8",
    )
    rows = "".join(f"{t},{2 * t},{0.1 * t**2}\n" for t in range(9))
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text(f"time_s,deflection_mm,force_N\n{rows}", encoding="utf-8")
    asked = CurveOptions(tmp_path / "a.csv", tmp_path / "film.toml", [tmp_path / "b.csv"], 60.0)
    read = bm.read(tmp_path / "a.csv", tmp_path / "film.toml", then=[tmp_path / "b.csv"], rest_s=60.0)
    assert asked.read().data_hash == read.data_hash
    assert len(read) == 18
    assert read.time is not None
    assert read.time[9] - read.time[8] == pytest.approx(8.0 + 60.0)  # 16 mm at 2 mm/s, and the rest
    with pytest.raises(DataError, match="named twice, and its readings would count twice"):
        bm.read(tmp_path / "a.csv", tmp_path / "film.toml", then=[tmp_path / "." / "a.csv"])


def test_tests_of_one_rig_share_its_blank_run() -> None:
    frame = np.array([[0.0, 0.0], [1e-6, 0.5], [2e-6, 1.0], [3e-6, 1.5]])
    first, second = (measured(UP, None, blank_run=frame) for _ in range(2))
    joined = one_after_another([first, second])
    assert joined.blank_run is not None
    assert np.array_equal(joined.blank_run, frame)
    assert np.array_equal(joined.select(np.arange(5)).blank_run, frame)  # type: ignore[arg-type]


def _halves(whole: Measurement) -> tuple[slice, slice]:
    return slice(0, 21), slice(21, len(whole))
