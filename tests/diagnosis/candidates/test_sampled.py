"""Evidence by importance sampling where the posterior is anything but normal, against quadrature."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.stats import cauchy

from bayesmembrane.diagnosis.candidates import sampled as module
from bayesmembrane.diagnosis.candidates.sampled import checked, sampled
from bayesmembrane.diagnosis.candidates.weighing import Weighing
from bayesmembrane.diagnosis.thresholds import SAMPLED

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
    exact = np.log(dblquad(lambda b, a: float(np.exp(bent(np.array([a, b])))), -1.0, 7.0, -3.0, 30.0)[0])
    assert found.good
    assert LINEAR + found.difference == pytest.approx(exact, abs=5 * found.sd)
    assert found.sd < 0.2


def test_a_target_that_no_draw_finds_leaves_the_linear_evidence(target) -> None:
    target.log_density = nothing
    candidate = SimpleNamespace(x=np.zeros(2), label="nothing")
    assert checked(cast(Weighing, SimpleNamespace(seed=0)), cast(Any, candidate)) is candidate


def heavy(u: np.ndarray) -> np.ndarray:
    """ln of a product of ten Cauchy densities, ln Z = 0: draws of no t-distribution of six degrees find its corners."""
    return np.sum(cauchy.logpdf(u), axis=-1)


def mean_error(monkeypatch: pytest.MonkeyPatch, unseen: float) -> float:
    monkeypatch.setattr(module, "SAMPLED", replace(SAMPLED, unseen=unseen))
    asked = cast(Any, SimpleNamespace(x=np.zeros(10)))
    found = [sampled(cast(Weighing, None), asked, np.random.default_rng(seed)) for seed in range(40)]
    return LINEAR + float(np.mean([f.difference for f in found]))


def test_tails_that_no_draw_finds_are_made_up_for(target, monkeypatch: pytest.MonkeyPatch) -> None:
    target.log_density, target.mean, target.fit, target.covariance = heavy, np.zeros(10), np.zeros(10), np.eye(10)
    found_only, told = mean_error(monkeypatch, 0.0), mean_error(monkeypatch, SAMPLED.unseen)
    assert found_only < -1.0
    assert found_only < told
    assert abs(told) < 0.7 * abs(found_only)


def test_draws_go_on_where_few_count(target, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = cast(Any, SimpleNamespace(x=np.zeros(2)))
    drawn: list[int] = []
    monkeypatch.setattr(target, "log_density", lambda u: drawn.append(len(u)) or nothing(u))
    assert not sampled(cast(Weighing, None), asked, np.random.default_rng(0)).good
    assert drawn == [SAMPLED.draws] * SAMPLED.most_rounds
