"""Evidence by importance sampling where the posterior is anything but normal, against quadrature."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.integrate import dblquad

from bayesmembrane.diagnosis.candidates import sampled as module
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.sampled import checked, sampled
from bayesmembrane.diagnosis.candidates.weighing import Weighing
from bayesmembrane.diagnosis.thresholds import SAMPLED
from bayesmembrane.physics.hypothesis import hypothesis

LINEAR = -3.0


def bent(u: np.ndarray) -> np.ndarray:
    """ln of a density along a bent valley, cut off at u1 = -1."""
    a, b = u[..., 0], u[..., 1]
    return np.where(a > -1.0, -0.5 * a**2 - 0.5 * ((b - 0.6 * (a**2 - 1)) / 0.4) ** 2, -np.inf)


def nothing(u: np.ndarray) -> np.ndarray:
    return np.full(u.shape[:-1], -np.inf)


@pytest.fixture
def target(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A posterior whose linear model is a unit normal, and as whose evidence ln Z = -3 was told."""
    made = SimpleNamespace(log_density=bent, mean=np.zeros(2), fit=np.zeros(2), covariance=np.eye(2), linear=LINEAR)
    monkeypatch.setattr(module, "_TruePosterior", lambda *_: made)
    return made


@pytest.mark.parametrize("seed", range(3))
def test_a_bent_valley_has_the_integral_that_quadrature_finds(target, seed: int) -> None:
    found = sampled(cast(Weighing, None), cast(Any, SimpleNamespace(x=np.zeros(2))), np.random.default_rng(seed))
    assert found.good
    assert LINEAR + found.difference == pytest.approx(exact(), abs=5 * found.sd)
    assert found.sd < 0.2


def test_a_target_that_no_draw_finds_leaves_the_linear_evidence(target) -> None:
    target.log_density = nothing
    two = np.zeros(2)
    for by_draws in (0.0, 1.5):  # and of what was drawn before
        known = Candidate(hypothesis("neo_hookean"), two, two, two, -4.0 + by_draws, (), two, two, two, by_draws)
        after = checked(cast(Weighing, SimpleNamespace(seed=0)), known)
        assert (after.log_evidence, after.by_draws) == (-4.0, 0.0)


VALLEYS = 5
"""Bent ones side by side: each has draws that count behind its bends, and of few draws none is behind all."""


def valleys(u: np.ndarray) -> np.ndarray:
    """ln of the product of `VALLEYS` bent valleys."""
    return np.sum([bent(u[..., 2 * i : 2 * i + 2]) for i in range(VALLEYS)], axis=0)


def exact() -> float:
    """ln of the integral of one bent valley."""
    return float(np.log(dblquad(lambda b, a: float(np.exp(bent(np.array([a, b])))), -1.0, 7.0, -3.0, 30.0)[0]))


def mean_error(monkeypatch: pytest.MonkeyPatch, unseen: float) -> float:
    monkeypatch.setattr(module, "SAMPLED", replace(SAMPLED, unseen=unseen))
    asked = cast(Any, SimpleNamespace(x=np.zeros(2 * VALLEYS)))
    found = [sampled(cast(Weighing, None), asked, np.random.default_rng(s), SAMPLED.last) for s in range(40)]
    return LINEAR + float(np.mean([f.difference for f in found])) - VALLEYS * exact()


def test_tails_that_no_draw_finds_are_made_up_for(target, monkeypatch: pytest.MonkeyPatch) -> None:
    k = 2 * VALLEYS
    target.log_density, target.mean, target.fit, target.covariance = valleys, np.zeros(k), np.zeros(k), np.eye(k)
    found_only, told = mean_error(monkeypatch, 0.0), mean_error(monkeypatch, SAMPLED.unseen)
    assert found_only < -0.5
    assert abs(told) < 0.5 * abs(found_only)


def test_draws_go_on_until_enough_count(target) -> None:
    k = 2 * VALLEYS
    target.log_density, target.mean, target.fit, target.covariance = valleys, np.zeros(k), np.zeros(k), np.eye(k)
    asked = cast(Any, SimpleNamespace(x=np.zeros(k)))
    found = [sampled(cast(Weighing, None), asked, np.random.default_rng(s), SAMPLED.last) for s in range(3)]
    assert all(f.counting >= SAMPLED.last.enough for f in found)
    assert all(f.drawn > 2 * SAMPLED.draws for f in found)


def test_draws_go_on_where_none_counts(target, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = cast(Any, SimpleNamespace(x=np.zeros(2)))
    drawn: list[int] = []
    monkeypatch.setattr(target, "log_density", lambda u: drawn.append(len(u)) or nothing(u))
    assert not sampled(cast(Weighing, None), asked, np.random.default_rng(0)).good
    assert drawn == [SAMPLED.draws] * SAMPLED.first.most_rounds
