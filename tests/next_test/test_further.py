"""Further tests: which there are, and that what is simulated is what the forward model says."""

from __future__ import annotations

import numpy as np
import pytest

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.registry import components
from bayesmembrane.next_test.further import Kind, other_motions, other_ranges, other_specimens, same_again
from bayesmembrane.next_test.gain import confused, information, longest_axis
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.physics.rigs.uniaxial import Uniaxial

MOONEY = hypothesis("mooney_rivlin", convexity="none")
X = MOONEY.material.to_coordinates(np.array([[6.0], [1.5]])).T


def film(timed: bool = False, full_range: float = float("nan"), rig: Annulus | None = None) -> Measurement:
    at = np.linspace(0.004, 0.03, 8)
    time = np.arange(1.0, 9.0) if timed else None
    return Measurement(
        at, np.ones(8), rig or Annulus(0.010, 0.035), Specimen("film", 5e-5), time=time, full_range=full_range
    )


def test_the_range_that_was_tested_is_no_risk_and_what_lies_beyond_is() -> None:
    found = {round(1e3 * t.test.end, 3): t.test for t in other_ranges(film(full_range=0.04))}
    assert list(found) == [37.5, 40.0, 45.0, 9.0]
    assert [t.beyond for t in found.values()] == [False, False, True, False]
    assert [t.kind for t in found.values()] == [Kind.FURTHER] * 3 + [Kind.SMALL]
    assert {t.start for t in found.values()} == {0.03, 0.0}


def test_every_rig_that_proposes_a_test_offers_one() -> None:
    offered = [t.test.rig for t in other_specimens(film(), 2.0)]
    assert offered == [r.name for r in components("rigs").values() if r.proposal]
    assert offered


def test_a_faster_test_needs_a_clock_and_a_wider_disc_needs_room() -> None:
    assert Kind.FASTER not in {t.test.kind for t in other_motions(film())}
    timed = {t.test.kind: t for t in other_motions(film(timed=True))}
    faster, usual = (np.ptp(timed[k].measurement.time) for k in (Kind.FASTER, Kind.OTHER_SIZE))
    assert faster == pytest.approx(0.1 * usual)
    assert timed[Kind.UNLOADING].deflection[-1] < timed[Kind.UNLOADING].deflection[239]
    tight = film(rig=Annulus(0.025, 0.035))
    assert Kind.OTHER_SIZE not in {t.test.kind for t in other_motions(tight)}


def test_a_film_that_is_moved_again_remembers_and_one_on_another_rig_is_new() -> None:
    for trial in other_motions(film(timed=True)):
        if trial.test.kind is Kind.OTHER_SIZE:
            assert trial.measurement.path.deflection.size == len(trial.measurement)
        else:
            assert np.array_equal(trial.measurement.path.deflection[:8], film().deflection)
            assert not np.any(trial.measurement.is_first_loading[trial.deflection < 0.025])


def test_a_test_of_the_film_shows_what_the_forward_model_says() -> None:
    for trial in [same_again(film()), *other_ranges(film())]:
        signals = trial.signals(MOONEY, X, api.solve)
        curve = Forward(MOONEY, film(), trial.deflection)(X, reached=False)
        np.testing.assert_allclose(signals.force, curve.force, rtol=1e-9)


def test_another_specimen_shows_its_tensions_and_their_slopes() -> None:
    """Uniaxial, incompressible Mooney-Rivlin: P = 2 (l - l^-2) (c1 + c2 / l)."""
    (trial,) = [t for t in other_specimens(film(), 2.0) if t.test.rig == Uniaxial.name]
    l1 = trial.stretch
    signals = trial.signals(MOONEY, X, api.solve)
    np.testing.assert_allclose(signals.force[0], 2 * (l1 - l1**-2) * (6.0 + 1.5 / l1), rtol=1e-9)
    step = 1e-5
    for j in range(2):
        h = step * np.eye(2)[j]
        high, low = (trial.signals(MOONEY, X + s * h, api.solve).force[0] for s in (1, -1))
        np.testing.assert_allclose(signals.slopes[0, :, j], (high - low) / (2 * step), rtol=1e-6)


def test_each_load_cell_has_its_own_noise() -> None:
    (trial,) = [t for t in other_specimens(film(), 2.0) if t.test.rig == "biaxial"]
    signals = trial.signals(MOONEY, X, api.solve)
    assert signals.sensors == 2
    shown = signals.slopes / signals.over_noise(0.01)
    largest = np.max(np.abs(signals.force.reshape(2, -1)), axis=1)
    np.testing.assert_allclose(np.unique(np.round(shown[np.isfinite(shown)], 9)), np.sort(np.round(0.01 * largest, 9)))


def test_the_longest_axis_shrinks_as_information_grows() -> None:
    precision = np.array([[[4.0, 0.0], [0.0, 1.0]]])
    scale = np.array([[1.0, 2.0]])
    assert longest_axis(precision, scale) == pytest.approx(2.0)
    known = information(np.array([[[0.0, np.sqrt(3.0)]]]))
    assert longest_axis(precision + known, scale) == pytest.approx(1.0)


def test_confused_is_the_integral_over_both_densities() -> None:
    """BC = int sqrt(N(m_a, S_a) N(m_b, S_b)), here in two dimensions, by a grid."""
    rng = np.random.default_rng(5)
    told = [(rng.normal(0, 1.5, 2), rng.normal(0, 0.8, (2, 3))) for _ in range(3)]
    at = np.linspace(-25, 25, 2001)
    points = np.stack(np.meshgrid(at, at), axis=-1)

    def density(told: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        covariance = np.eye(2) + told[1] @ told[1].T
        d = points - told[0]
        square = np.einsum("xyi,ij,xyj->xy", d, np.linalg.inv(covariance), d)
        return np.exp(-0.5 * square) / (2 * np.pi * np.sqrt(np.linalg.det(covariance)))

    cell = (at[1] - at[0]) ** 2
    pairs = [(told[a], told[b]) for a, b in ((0, 1), (0, 2), (1, 2))]
    expected = [np.log(np.sum(np.sqrt(density(a) * density(b))) * cell) for a, b in pairs]
    np.testing.assert_allclose(confused(told), expected, rtol=1e-6)


def test_what_a_rival_leaves_open_does_not_separate() -> None:
    """Sharp predictions d apart: ln BC = -d^2 / 8; along a direction that is wide open next to nothing is told."""
    apart, sharp, wide = np.array([6.0, 0.0]), np.zeros((2, 1)), np.array([[1e3], [0.0]])
    assert confused([(apart, sharp), (0 * apart, sharp)]) == pytest.approx([-36 / 8])
    assert confused([(apart, wide), (0 * apart, wide)]) == pytest.approx([0.0], abs=1e-5)


def test_a_hold_is_waited_for_at_the_top_and_at_rest() -> None:
    timed = {t.test.kind: t for t in other_motions(film(timed=True))}
    assert Kind.HOLD not in {t.test.kind for t in other_motions(film())}
    trial = timed[Kind.HOLD]
    time, at = trial.measurement.time, trial.deflection
    assert time is not None
    assert np.all(np.diff(time) > 0)
    held = trial.measurement.holds
    assert [float(at[h[5]]) for h in held] == [0.03, 0.0]
    for readings in held:
        assert np.ptp(time[readings]) == pytest.approx(trial.test.hold, rel=0.05)
