"""Tests that no fit saw are predicted with bands that hold, as far as specimens are alike."""

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

import bayesmembrane as bm
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.diagnosis import other_tests
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.diagnose import diagnose
from bayesmembrane.diagnosis.left.continued import Continued
from bayesmembrane.diagnosis.other_tests import predicted
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.base import Rig
from bayesmembrane.physics.rigs.compression import Compression
from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from tests.diagnosis.curves import measured, triangle

SD = 0.01
STIFFNESS = 8.0  # N/m


def film(deflection: np.ndarray, seed: int, times: float = 1.0) -> Measurement:
    """A neo-Hookean film by the other solver, with forces ``times`` as large, and independent noise."""
    blank = measured(np.ones(deflection.size), deflection)
    forward = Forward(hypothesis("neo_hookean"), blank, deflection)
    force = forward(np.array([[np.log(STIFFNESS)]]), reached=False, solver="shooting").force[0]
    return measured(times * force + SD * np.random.default_rng(seed).standard_normal(force.size), deflection)


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    answer = diagnose(film(triangle(80, (0.02, 0.03)), 3), hypothesis("neo_hookean"))
    assert answer.verdict == "adequate"
    return answer


LONGER = triangle(400, (0.04,))


def test_the_band_holds_a_longer_test_of_the_same_film(found: Diagnosis) -> None:
    """Nine of ten readings, but for what the stiffness, the same in all of them, is off."""
    other = predicted(found, film(LONGER, 4))
    assert 0.75 < other.covered < 0.99
    assert other.rmse_after == pytest.approx(SD, rel=0.4)
    assert np.all(other.low <= other.after)
    assert np.all(other.after <= other.high)


def test_another_specimen_is_held_where_specimens_are_said_to_differ(found: Diagnosis) -> None:
    stiffer = film(LONGER, 5, times=1.08)
    alike, apart = predicted(found, stiffer), predicted(found, stiffer, scatter=0.08)
    assert alike.covered < 0.5 < apart.covered
    assert np.mean(apart.high - apart.low) > 1.5 * np.mean(alike.high - alike.low)


def test_what_the_model_as_given_says_is_what_its_fit_says(found: Diagnosis) -> None:
    """Where nothing was added, before and after are one, but for draws."""
    other = predicted(found, film(LONGER, 6))
    assert other.after == pytest.approx(other.before, abs=4 * SD)


def test_the_same_seed_predicts_the_same(found: Diagnosis) -> None:
    m = film(LONGER, 7)
    assert np.array_equal(predicted(found, m, 0.05, 2).high, predicted(found, m, 0.05, 2).high)
    assert not np.array_equal(predicted(found, m, 0.05, 2).high, predicted(found, m, 0.05, 3).high)


def test_the_door_predicts_one_test_or_several(found: Diagnosis) -> None:
    m = film(LONGER, 9)
    (one,), several = bm.predict(found, m, scatter=0.05, seed=4), bm.predict(found, [m, m], scatter=0.05, seed=4)
    assert np.array_equal(one.high, predicted(found, m, 0.05, 4).high)
    assert [np.array_equal(o.high, one.high) for o in several] == [True, True]


@pytest.mark.parametrize(("rig", "least"), [(Uniaxial(), 0.0), (Compression(), -np.inf)])
def test_no_error_makes_a_film_push(monkeypatch: pytest.MonkeyPatch, rig: Rig, least: float) -> None:
    force, sd = np.array([0.5, 0.1, 0.0, -0.2]), 0.05
    offset = np.full((4, 1), sd)  # an uncertain parameter, before four errors of the form
    there = Continued(force, np.zeros(4), np.column_stack([offset, 3 * np.eye(4)]), np.eye(5), True)
    monkeypatch.setattr(other_tests, "_at", lambda *_: there)
    side = -1 if rig.presses else 1
    other = Measurement(side * np.array([4e-3, 3e-3, 2e-3, 1e-3]), side * np.ones(4), rig, Specimen("strip", 1e-3))
    c = cast(Candidate, SimpleNamespace(x=np.zeros(1)))
    draws = other_tests._draws(cast(Search, None), c, other, 2000, np.random.default_rng(1))
    assert draws is not None
    lowest = np.min(draws, axis=0)
    if least == 0.0:  # as far below as the offset may be
        assert np.all(lowest >= np.minimum(force, 0.0) - 4 * sd)
        assert lowest[3] < force[3] - 2 * sd
    else:
        assert np.all(lowest < -1)
    assert np.all(np.max(draws, axis=0) > 1)


def test_what_cannot_be_predicted_is_said(found: Diagnosis) -> None:
    with pytest.raises(SettingsError, match=r"scatter of -0\.1"):
        predicted(found, film(LONGER, 8), scatter=-0.1)
    strip = Measurement(np.linspace(1e-3, 0.02, 9), np.ones(9), Uniaxial(0.05, 0.01), Specimen("strip", 1e-3))
    with pytest.raises(SettingsError, match="another kind of rig"):
        predicted(found, strip)
