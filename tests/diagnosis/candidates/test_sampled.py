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
    assert LINEAR + found.difference == pytest.approx(exact, abs=5 * found.sd)
    assert found.sd < 0.2


def test_a_target_that_no_draw_finds_leaves_the_linear_evidence(target) -> None:
    target.log_density = nothing
    candidate = SimpleNamespace(x=np.zeros(2))
    assert checked(cast(Weighing, None), cast(Any, candidate), np.random.default_rng(0)) is candidate
