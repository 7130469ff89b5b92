"""Coordinates in which priors are standard, for every material and effect of the library."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import cauchy, norm

from bayesmembrane.diagnosis.candidates.standard import standard
from bayesmembrane.ground.registry import components, materials
from bayesmembrane.physics.hypothesis import Hypothesis
from tests.diagnosis.curves import measured, triangle

CURVE = measured(np.linspace(0.01, 1.0, 60), triangle(60))
EFFECTS = sorted(components("effects"))


@pytest.mark.parametrize("name", EFFECTS)
def test_there_and_back_is_the_same(name) -> None:
    axes = standard(Hypothesis(materials()["yeoh"], (components("effects")[name](),)), CURVE)
    low, high = (np.clip(b, -2.5, 2.5) for b in axes.bounds)
    u = np.random.default_rng(0).uniform(low, high, (20, low.size))
    assert axes.to_u(axes.to_x(u)) == pytest.approx(u, abs=1e-6)
    step = 1e-5
    numeric = (axes.to_x(u + step) - axes.to_x(u - step)) / (2 * step)
    assert axes.slope(u) == pytest.approx(numeric, rel=1e-4, abs=1e-12)


@pytest.mark.parametrize("name", EFFECTS)
def test_absence_is_at_zero_and_its_side_is_kept(name) -> None:
    effect = components("effects")[name]()
    axes = standard(Hypothesis(materials()["gent"], (effect,)), CURVE)
    x = np.concatenate([np.zeros(2), effect.null])
    assert axes.to_u(x)[2] == pytest.approx(0.0, abs=1e-12)
    assert axes.one_sided[2] == effect.size.one_sided
    assert axes.heavy[2]


@pytest.mark.parametrize("name", ["force_drift", "force_offset", "zero_offset"])
def test_a_size_of_either_sign_may_be_as_large_on_both_sides(name: str) -> None:
    axes = standard(Hypothesis(materials()["gent"], (components("effects")[name](),)), CURVE)
    low, high = (b[2] for b in axes.bounds)
    assert low == pytest.approx(-high)
    assert high > 8.0


def test_pulls_are_roots_of_the_prior_and_local_normals_have_its_value_and_slope() -> None:
    axes = standard(Hypothesis(materials()["gent"], (components("effects")["machine_compliance"](),)), CURVE)
    u = np.array([0.4, -1.2, 3.0, 0.7, -0.3, 0.2, -0.6])
    pull, steep = axes.pull(u)
    log_prior = np.where(axes.heavy, cauchy.logpdf(u), norm.logpdf(u))
    at_zero = np.where(axes.heavy, cauchy.logpdf(0.0), norm.logpdf(0.0))
    assert 0.5 * pull**2 == pytest.approx(at_zero - log_prior)
    h = 1e-6
    assert steep == pytest.approx((axes.pull(u + h)[0] - axes.pull(u - h)[0]) / (2 * h), rel=1e-5)
    slope = np.where(axes.heavy, -2 * u / (1 + u * u), -u)
    assert -u / axes.local(u) ** 2 == pytest.approx(slope)


@pytest.mark.parametrize("sd", [0.01, 0.5, 30.0])
@pytest.mark.parametrize("at", [0.0, 0.6, 4.0])
def test_a_size_is_integrated_under_its_own_prior(at, sd) -> None:
    """Of a normal likelihood of one size, against the integral."""
    axes = standard(Hypothesis(materials()["neo_hookean"], (components("effects")["machine_compliance"](),)), CURVE)
    size = np.eye(axes.one_sided.size)[1]
    u = at * size
    s = axes.local(u)
    precision = 1 / s**2 + size / sd**2
    mean = u / sd**2 / precision
    inside = norm.logcdf(mean[1] * np.sqrt(precision[1]))

    def likelihood(v: float) -> float:
        return float(norm.pdf(v, at, sd))

    local = quad(lambda v: likelihood(v) * norm.pdf(v, 0, s[1]), -np.inf, np.inf, points=None)[0]
    near = (max(at - 9 * sd, 0.0), at + 9 * sd)
    near = (near[0], min(near[1], axes.bounds[1][1]))
    within = cauchy.cdf(axes.bounds[1][1]) - 0.5
    exact = quad(lambda v: likelihood(v) * cauchy.pdf(v), *near, limit=200)[0] / within
    if sd < 1:
        local = norm.pdf(at, 0, np.hypot(s[1], sd))
    found = np.log(local) + inside + axes.log_replaced(u, mean, 1 / precision)
    assert found == pytest.approx(np.log(exact), abs=0.01)
