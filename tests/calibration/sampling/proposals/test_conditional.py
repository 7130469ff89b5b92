"""Modulus and noise given a curve: against quadrature of the exact density, and draws against their own density."""

import numpy as np
import pytest
from scipy.integrate import simpson
from scipy.stats import kstest, norm

from bayesmembrane.calibration.sampling.proposals.conditional import PiecewiseLinear, Residuals
from bayesmembrane.calibration.sampling.weights import worth
from bayesmembrane.ground.parameters import Normal

MODULUS, NOISE = Normal(float(np.log(15.0)), 2.0), Normal(float(np.log(3e-3)), 2.0)
CURVE = np.linspace(0.1, 1.0, 9) ** 1.5
# Of the misfit: next to none, some percent, and as much as leaves the modulus uncertain by a third.
SIZES = (1e-5, 0.03, 0.5)


def residuals(size: float, stated: float, count: int = 1) -> Residuals:
    """Of ``count`` times the same curve for Gd = 1; of every second reading the noise is ``stated``."""
    y = 7.5 * (CURVE + size * np.cos(2.0 * np.arange(CURVE.size)))
    variance = np.array([0.0, (stated * 7.5) ** 2]) if stated else np.zeros(1)
    one = (np.arange(CURVE.size)[:, None] % len(variance) == np.arange(len(variance))).astype(float)
    ya, aa = (np.tile(v @ one, (count, 1)) for v in (CURVE * y, CURVE * CURVE))
    return Residuals(variance, one.sum(axis=0), (y * y) @ one, ya, aa, float(np.max(y)), MODULUS, NOISE)


def log_joint(r: Residuals, ln_gd: np.ndarray, ln_sd: np.ndarray) -> np.ndarray:
    """ln p(y, ln_gd, ln_sd | f), written out."""
    g, v = np.exp(ln_gd)[..., None], r.variance + (r.scale * np.exp(ln_sd))[..., None] ** 2
    square = r.yy - 2 * g * r.ya[0] + g * g * r.aa[0]
    fit = -0.5 * np.sum(square / v + r.count * np.log(2 * np.pi * v), axis=-1)
    return np.asarray(fit + norm.logpdf(ln_gd, MODULUS.mean, MODULUS.sd) + norm.logpdf(ln_sd, NOISE.mean, NOISE.sd))


def quadrature(r: Residuals) -> float:
    """ln of the integral of `log_joint`: over the modulus on a grid as wide as the noise makes it."""
    u = np.linspace(NOISE.mean - 12, NOISE.mean + 12, 801)
    sd = 1 / np.sqrt(np.sum(r.aa[0] / (r.variance + (r.scale * np.exp(u))[:, None] ** 2), axis=1)) / 7.5
    z = np.linspace(-15, 15, 1501)
    t = np.log(7.5) + np.minimum(sd, 1.0)[:, None] * z
    value = log_joint(r, t, np.broadcast_to(u[:, None], t.shape))
    inner = simpson(np.exp(value - np.max(value)), x=z, axis=1) * np.minimum(sd, 1.0)
    return float(np.max(value) + np.log(simpson(inner, x=u)))


@pytest.mark.parametrize("stated", [0.0, 0.02])
@pytest.mark.parametrize("size", SIZES)
def test_integral_equals_quadrature(size: float, stated: float) -> None:
    r = residuals(size, stated)
    assert r.log_likelihood()[0] == pytest.approx(quadrature(r), abs=0.01 if size < 0.1 else 0.1)


@pytest.mark.parametrize("stated", [0.0, 0.02])
@pytest.mark.parametrize("size", SIZES)
def test_draws_have_the_density_that_is_told(size: float, stated: float) -> None:
    """The mean of p / q over draws of q is the integral of p, which quadrature knows."""
    n = 20_000
    r = residuals(size, stated, n)
    given = r.given()
    t, u = given.drawn(np.random.default_rng(41).random((n, 2)))
    judged = worth(log_joint(r, t, u) - given.log_density(t, u))
    assert judged.good
    assert judged.efficiency > 0.85
    assert judged.log_mean == pytest.approx(quadrature(r), abs=6 * judged.log_mean_sd + 2e-4)


def test_curves_that_are_none_have_weights_too() -> None:
    """Forces of 1e4 to 1e17 N for Gd = 1, as films with senseless exponents have: nothing is left without a number."""
    force = np.array([1e4, 1e8, 1e17])[:, None] * CURVE
    y = 7.5 * CURVE
    one = np.ones((CURVE.size, 1))
    r = Residuals(np.zeros(1), one.sum(axis=0), (y * y) @ one, (force * y) @ one, (force**2) @ one, 7.5, MODULUS, NOISE)
    assert np.all(np.isfinite(r.log_likelihood()))
    for u in (1e-12, 0.01, 0.3, 0.999):
        t, ln_sd = r.given().drawn(np.full((3, 2), u))
        assert np.all(np.isfinite([t, ln_sd, r.given().log_density(t, ln_sd)]))


def test_quantiles_invert_the_density() -> None:
    """Uniform numbers become draws of the piecewise linear density, whose distribution function is known."""
    rng, n = np.random.default_rng(42), 20_000
    nodes = np.array([0.0, 3.0, 1.0, 0.0, 2.0, 0.0])
    h = 0.5
    density = nodes / (h * np.sum(0.5 * (nodes[1:] + nodes[:-1])))
    many = PiecewiseLinear(np.full(n, -1.0), np.full(n, h), np.tile(density, (n, 1)))
    x = many.quantile(rng.random(n))
    fine = np.linspace(-1.0, 1.5, 5001)
    mass = np.concatenate([[0.0], np.cumsum(np.diff(fine) * np.interp(0.5 * (fine[1:] + fine[:-1]), _at(h), density))])
    assert kstest(x, lambda v: np.interp(v, fine, mass)).pvalue > 1e-5
    assert many.at(x) == pytest.approx(np.interp(x, _at(h), density), rel=1e-9, abs=1e-12)
    assert not np.any(many.at(np.full(n, -1.01)))
    assert not np.any(many.at(np.full(n, 1.51)))


def _at(step: float) -> np.ndarray:
    return -1.0 + step * np.arange(6)
