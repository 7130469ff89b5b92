"""Evidence by importance sampling where the posterior is anything but normal, against quadrature."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.integrate import dblquad

from bayesmembrane.diagnosis.candidates import sampled as module
from bayesmembrane.diagnosis.candidates.sampled import checked, sampled
from bayesmembrane.diagnosis.candidates.weighing import Weighing

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
    # Of draws of which less than `all_seen` count, more is said than they found: at most what `unseen` says of 60.
    assert LINEAR + found.difference == pytest.approx(exact, abs=5 * found.sd + 0.35)
    assert found.sd < 0.2


def test_a_target_that_no_draw_finds_leaves_the_linear_evidence(target) -> None:
    target.log_density = nothing
    candidate = SimpleNamespace(x=np.zeros(2), label="nothing")
    assert checked(cast(Weighing, SimpleNamespace(seed=0)), cast(Any, candidate)) is candidate


@pytest.mark.parametrize("width", [0.05, 0.2])
def test_tails_that_no_draw_finds_are_made_up_for(target, width: float) -> None:
    """A narrow peak on a wide foot: draws about the peak miss most of the foot, and estimates without more are low."""

    def footed(u: np.ndarray) -> np.ndarray:
        squares = np.sum(u**2, axis=-1)
        return np.logaddexp(-0.5 * squares / width**2, np.log(0.5) - 0.5 * squares)

    target.log_density, target.mean, target.fit = footed, np.zeros(6), np.zeros(6)
    target.covariance = width**2 * np.eye(6)
    exact = float(np.log(width**6 + 0.5) + 3 * np.log(2 * np.pi))
    found = [sampled(cast(Weighing, None), cast(Any, SimpleNamespace(x=np.zeros(6))), rng) for rng in seeds()]
    assert np.mean([abs(LINEAR + f.difference - exact) for f in found]) < abs(exact - peak(width))


def seeds() -> list[np.random.Generator]:
    return [np.random.default_rng(seed) for seed in range(5)]


def peak(width: float) -> float:
    """ln of the integral of the peak alone: what the linear model says."""
    return float(6 * np.log(width) + 3 * np.log(2 * np.pi))
