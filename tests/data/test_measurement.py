"""A measurement as values: phases, truncation, and arrays that contradict each other."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.errors import DataError, SettingsError
from bayesmembrane.physics.rigs.annulus import Annulus
from tests.data.curves import annulus_curve


def test_phases_of_a_staircase_of_cycles() -> None:
    m = annulus_curve([0, 5, 10, 5, 0, 5, 10, 20, 20, 10], time=np.arange(10.0))
    assert m.leg.tolist() == [1, 1, 1, -1, -1, 1, 1, 1, 1, -1]
    assert m.cycle.tolist() == [1, 1, 1, 1, 1, 2, 2, 2, 2, 2]
    assert m.is_first_loading.tolist() == [True] * 3 + [False] * 3 + [True] * 3 + [False]


def test_jitter_is_no_leg_and_a_start_at_the_top_is_unloading() -> None:
    x = np.array([0, 1, 0.999, 2, 3, 2.995, 4, 5])
    assert np.all(annulus_curve(x, time=np.arange(8.0)).leg == 1)
    assert np.all(annulus_curve([5, 3, 1], time=np.arange(3.0)).leg == -1)
    assert annulus_curve([5]).leg.tolist() == [1]


@given(st.lists(st.floats(0, 100), min_size=1, max_size=40))
@settings(deadline=None, max_examples=60)
def test_legs_of_any_protocol(x: list[float]) -> None:
    m = annulus_curve(x, time=np.arange(float(len(x))))
    assert set(m.leg.tolist()) <= {-1, 1}
    assert np.all(np.diff(m.cycle) >= 0)
    assert np.all(m.leg[m.is_first_loading] == 1)


def test_truncation_keeps_the_noise_block_and_the_full_range() -> None:
    covariance = np.diag([1.0, 2, 3, 4]) + 0.1
    m = annulus_curve([10, 20, 35.1, 91.5], covariance=covariance)
    short = m.up_to(0.0351)
    assert len(short) == 3
    assert short.covariance is not None
    assert np.array_equal(short.covariance, covariance[:3, :3])
    assert short.full_range == m.full_range == 0.0915
    assert short.up_to(0.02).full_range == 0.0915
    assert m.up_to(0.0915) is m
    with pytest.raises(SettingsError, match=r"up to 11 mm leaves fewer .*; choose an end from 20 mm to 91\.5 mm"):
        m.up_to(0.011)


def test_ranges_that_hold_the_same_readings_are_refused() -> None:
    m = annulus_curve([10, 20, 35.1, 91.5])
    assert [len(part) for part in m.ranges_up_to([0.0351, 0.0915])] == [3, 4]
    for ends in ([0.0915, 0.2], [0.04, 0.05]):
        with pytest.raises(SettingsError, match=r"hold the same readings; .* the curve ends at 91"):
            m.ranges_up_to(ends)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"force_sd": np.ones(2)}, "force_sd has the shape"),
        ({"force_sd": np.zeros(3)}, "must be positive at every point"),
        ({"covariance": np.ones((3, 3))}, "not positive definite"),
        ({"covariance": np.array([[1, 0.5, 0], [0, 1, 0], [0, 0, 1]])}, "not symmetric"),
        ({"covariance": -np.eye(3)}, "entry 1 of the diagonal"),
        ({"time": np.array([0, 1, 1])}, "time must increase"),
        ({"time": np.array([0, 1, np.nan])}, "not finite"),
    ],
)
def test_arrays_that_contradict_each_other(more: dict[str, object], said: str) -> None:
    with pytest.raises(DataError, match=said):
        annulus_curve([1, 2, 3], **more)


def test_round_off_about_zero_is_zero() -> None:
    """A disc that comes back to 7e-18 m is down: no solver follows a film that is lifted so little."""
    d = np.array([0.0, 0.02, 0.04, 0.02, 6.9e-18, 1e-9, -2e-18])
    m = Measurement(d, np.ones(7), Annulus(0.010, 0.035), Specimen("film", 5e-5))
    assert m.deflection.tolist() == [0.0, 0.02, 0.04, 0.02, 0.0, 1e-9, 0.0]
    assert d[4] > 0.0
