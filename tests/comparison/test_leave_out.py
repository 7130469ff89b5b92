"""Leave-one-out and leave-range-out against sums over a grid, for a material of one modulus and correlated noise."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.special import logsumexp

from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.calibration.run import RunSettings, sample
from bayesmembrane.comparison.leave_out import refit
from bayesmembrane.comparison.leave_out import score as pc
from bayesmembrane.comparison.leave_out.pool import ENOUGH, LED_BY, Pool
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.registry import material
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.rigs.annulus import Annulus

SEED = 301


@cache
def measured(noise: str = "correlated") -> Measurement:
    """A neo-Hookean film with a softening that its model does not know, and one outlier."""
    rng = np.random.default_rng(SEED)
    deflection = np.linspace(4e-3, 48e-3, 12)
    kind = material("yeoh")
    force = api.solve(api.request(kind, np.array([[8.0, -0.3, 0.02]]), deflection, 0.01, 0.035)).force[0]
    place = np.arange(12)
    covariance = 0.02**2 * (0.8 ** np.abs(place[:, None] - place) + 0.3 * np.eye(12))
    if noise == "none":
        covariance = None
        force = force + 0.02 * rng.standard_normal(12)
    else:
        force = force + np.linalg.cholesky(covariance) @ rng.standard_normal(12)
    force[4] += 0.3
    return Measurement(deflection, force, Annulus(0.01, 0.035), Specimen("film", 5e-5), covariance=covariance)


@cache
def posterior(noise: str = "correlated") -> Posterior:
    return Posterior(hypothesis("neo_hookean"), measured(noise))


@cache
def run(noise: str = "correlated"):
    return sample(measured(noise), hypothesis("neo_hookean"), RunSettings(seed=SEED, ess=1500))


@cache
def grid(noise: str = "correlated"):
    """Points (B, 2) and ln of their posterior weights (B,)."""
    draws = run(noise).draws()
    centre, sd = draws.mean(axis=0), draws.std(axis=0)
    # Without its outlier the film is found with much less noise than with it.
    film = np.linspace(centre[0] - 9 * sd[0], centre[0] + 9 * sd[0], 601)
    spread = np.linspace(-13.0, centre[1] + 9 * sd[1], 241)
    x = np.stack([a.ravel() for a in np.meshgrid(film, spread, indexing="ij")], axis=1)
    value = posterior(noise).evaluate(x)
    return x, value.log_posterior - logsumexp(value.log_posterior), value.force


@pytest.mark.parametrize("noise", ["correlated", "none"])
def test_every_point_left_out_agrees_with_the_grid(noise):
    x, weight, force = grid(noise)
    terms = posterior(noise).pointwise(x, force)
    exact = -logsumexp(weight[:, None] - terms, axis=0)
    found = pc.leave_one_out(posterior(noise), run(noise).groups, seed=1)
    # The outlier, fifteen orders of e away, is known within a tenth of its logarithm, all others within 0.1.
    assert np.all(np.abs(found.pointwise - exact) < 0.1 + 0.1 * np.maximum(-exact, 0.0))
    assert abs(found.elpd - np.sum(exact)) < 1.5
    assert found.se == pytest.approx(np.sqrt(12 * np.var(exact)), rel=0.1)
    assert found.pareto_k.shape == (12,)


def test_leaving_out_a_point_is_fitting_the_others():
    """The weights 1 / p(y_i | y_-i, x) leave the posterior of the other points under their own covariance."""
    x, _, force = grid()
    m, p, i = measured(), posterior(), 4
    others = np.arange(12) != i
    part = m.select(others)
    log_likelihood = np.empty(len(x))
    noise = p.hypothesis.noise.bind(m)
    for b in range(0, len(x), 997):
        covariance = noise.covariance(p.hypothesis.noise_coordinates(x[b : b + 1])[0])[np.ix_(others, others)]
        r = part.force - force[b, others]
        log_likelihood[b] = (
            -0.5 * r @ np.linalg.solve(covariance, r) - 0.5 * np.linalg.slogdet(2 * np.pi * covariance)[1]
        )
    rows = np.arange(0, len(x), 997)
    whole = p.log_likelihood(x[rows])
    assert log_likelihood[rows] == pytest.approx(whole - p.pointwise(x[rows], force[rows])[:, i], rel=1e-6)


def test_films_of_absurd_force_lead_nobody(monkeypatch):
    """Where all of ln p is what one point adds to it, and that is beyond all digits, the difference is chance."""
    evaluate, data, draws, i = Posterior.evaluate, run().groups, run().draws(), 4

    def absurd(p, x):
        found = evaluate(p, x)
        log_likelihood, force = found.log_likelihood.copy(), found.force.copy()
        force[:50] = p.measurement.force
        force[:50, i] += 1e95
        residual = p.measurement.force - force[:50]
        log_likelihood[:50] = p.noise.log_likelihood(residual, p.hypothesis.noise_coordinates(x[:50]))
        return replace(found, log_likelihood=log_likelihood, force=force)

    monkeypatch.setattr(Posterior, "evaluate", absurd)
    terms = data.log_likelihood["force"].values.reshape(len(draws), -1).astype(float)
    pool = Pool(posterior(), draws, data.sample_stats["lp"].values.ravel(), terms, np.random.default_rng(0))
    assert len(pool._drawn_towards(i)) >= LED_BY * posterior().size


def test_terms_without_digits_lead_nobody(monkeypatch):
    """A form error a million times the noise leaves none: such a term said that the others like a draw by e^(10^12)."""
    pointwise, data, draws, i = Posterior.pointwise, run().groups, run().draws(), 4

    def lost(p, x, force):
        terms = pointwise(p, x, force)
        terms[:3, i] = -1e12
        return terms

    monkeypatch.setattr(Posterior, "pointwise", lost)
    terms = data.log_likelihood["force"].values.reshape(len(draws), -1).astype(float)
    pool = Pool(posterior(), draws, data.sample_stats["lp"].values.ravel(), terms, np.random.default_rng(0))
    assert len(pool._drawn_towards(i)) >= LED_BY * posterior().size


def test_draws_that_are_all_the_same_end_the_search(monkeypatch):
    data, draws = run().groups, run().draws()
    monkeypatch.setattr(Pool, "_drawn_towards", lambda pool, i: pool.x[:1])
    terms = data.log_likelihood["force"].values.reshape(len(draws), -1).astype(float)
    pool = Pool(posterior(), draws, data.sample_stats["lp"].values.ravel(), terms, np.random.default_rng(0))
    _, error, worth = pool.without(4)
    assert worth < ENOUGH
    assert error > 0.1  # what is not known is told


def test_exact_refits_agree_with_the_grid(monkeypatch):
    monkeypatch.setattr(pc, "PARETO_K", -np.inf)
    x, weight, force = grid()
    exact = -logsumexp(weight[:, None] - posterior().pointwise(x, force), axis=0)
    found = pc.leave_one_out(posterior(), run().groups, seed=2)
    assert found.refitted == tuple(range(12))
    # The outlier, fifteen orders of e away, is known within a tenth of its logarithm, all others within 0.1.
    assert np.all(np.abs(found.pointwise - exact) < 0.1 + 0.1 * np.maximum(-exact, 0.0))
    assert abs(found.elpd - np.sum(exact)) < 1.5


@pytest.mark.parametrize("noise", ["correlated", "none"])
def test_the_others_integrated_by_themselves_agree_with_the_grid(noise, monkeypatch):
    """The outlier is fifteen orders of e away, where no draw of the whole posterior is."""
    x, weight, force = grid(noise)
    exact = -logsumexp(weight[:, None] - posterior(noise).pointwise(x, force), axis=0)
    monkeypatch.setattr(pc, "PARETO_K", -np.inf)
    monkeypatch.setattr(pc, "MOST_INTEGRALS", 12)
    monkeypatch.setattr(Pool, "without", lambda *_: (0.0, np.inf, 0.0))
    for integral in (None, run(noise).integral):
        found = pc.leave_one_out(posterior(noise), run(noise).groups, seed=3, integral=integral)
        assert found.monte_carlo_sd < 0.4
        # A reading that says nothing is one with a noise of thirty times the largest force: 0.001 in its logarithm.
        assert np.all(np.abs(found.pointwise - exact) < 5 * found.monte_carlo_sd / np.sqrt(12) + 0.03)


def test_an_outlier_of_many_readings_costs_no_other_its_term():
    """ln Z is above two hundred there: what few rounds add to it is not enough."""
    rng, deflection = np.random.default_rng(SEED), np.linspace(2e-3, 48e-3, 90)
    force = api.solve(api.request(material("neo_hookean"), np.array([[8.0]]), deflection, 0.01, 0.035)).force[0]
    force = force + 0.003 * np.max(force) * rng.standard_normal(90)
    force[60] += 0.12 * np.max(force)
    m = Measurement(deflection, force, Annulus(0.01, 0.035), Specimen("film", 5e-5))
    p, found = Posterior(hypothesis("neo_hookean"), m), sample(m, hypothesis("neo_hookean"), RunSettings(seed=SEED))
    assert found.status["importance"]["log_integral"] > 200 - 90 * np.log(np.max(force))
    loo = pc.leave_one_out(p, found.groups, seed=1, integral=found.integral)
    assert loo.refitted == (60,)
    # Films of one modulus are one curve in proportion to it: both integrals over a grid of modulus and noise.
    unit = p.forward(np.array([[0.0, 0.0]])).force[0]
    modulus = found.draws()[:, 0].mean() + np.linspace(-0.1, 0.1, 401)
    x = np.stack([a.ravel() for a in np.meshgrid(modulus, np.linspace(-7, -2, 501))], axis=1)
    sd = np.exp(x[:, 1:]) * np.max(np.abs(force))
    each = -0.5 * ((force - np.exp(x[:, :1]) * unit) / sd) ** 2 - np.log(sd * np.sqrt(2 * np.pi))
    whole = p.prior.log_density(x) + np.sum(each, axis=1)
    exact = logsumexp(whole) - logsumexp(whole[:, None] - each, axis=0)
    assert exact[60] < -100
    assert loo.pointwise == pytest.approx(exact, abs=0.15)


def test_where_no_proposal_is_good_the_error_is_told(monkeypatch):
    monkeypatch.setattr(refit, "independent", lambda *_: None)
    assert refit.log_integral_without(posterior(), 4, run().draws(), np.random.default_rng(0))[1] == np.inf
    monkeypatch.setattr(Pool, "without", lambda *_: (-3.0, 2.0, 1.0))
    monkeypatch.setattr(pc, "PARETO_K", -np.inf)
    found = pc.leave_one_out(posterior(), run().groups, seed=3)
    assert found.pointwise == pytest.approx(-3.0)
    assert found.monte_carlo_sd == pytest.approx(2.0 * np.sqrt(12))


@pytest.mark.parametrize("noise", ["correlated", "none"])
def test_the_rest_of_the_range_agrees_with_the_grid(noise):
    whole = measured(noise)
    part = whole.up_to(0.030)
    claim = hypothesis("neo_hookean")
    p = Posterior(claim, part)
    draws = sample(part, claim, RunSettings(seed=SEED, ess=1500)).draws()
    found = pc.leave_range_out(p, draws, whole)
    centre, sd = draws.mean(axis=0), draws.std(axis=0)
    axes = [np.linspace(c - 8 * s, c + 8 * s, 161) for c, s in zip(centre, sd, strict=True)]
    x = np.stack([a.ravel() for a in np.meshgrid(*axes, indexing="ij")], axis=1)
    # p(y_h | y_f) = integral of p0 p(y_f, y_h | x) / integral of p0 p(y_f | x), with the same noise in N.
    same_noise = x.copy()
    same_noise[:, 1] += np.log(np.max(np.abs(part.force)) / np.max(np.abs(whole.force)))
    both = p.log_prior(x) + Posterior(claim, whole).log_likelihood(same_noise)
    first = p.log_prior(x) + p.log_likelihood(x)
    exact = logsumexp(both) - logsumexp(first)
    assert found.elpd == pytest.approx(exact, abs=4 * found.monte_carlo_sd + 0.05)
    assert found.points == len(whole) - len(part)
    assert found.lost == 0.0
    assert found.rmse_N <= found.max_N
    assert found.effective > 1


def test_there_must_be_a_rest():
    with pytest.raises(SettingsError, match="whole range"):
        pc.leave_range_out(posterior(), run().draws(), measured())


def test_draws_without_a_curve_predict_nothing():
    """A Gent film that locks before the held-out deflections has probability zero there, and says so."""
    whole = measured("none")
    p = Posterior(hypothesis("gent"), whole.up_to(0.030))
    x = np.tile([np.log(16.0), np.log(0.9), -4.0], (50, 1))
    found = pc.leave_range_out(p, x, whole)
    assert found.lost == 1.0
    assert found.elpd < -1e3 or found.elpd == -np.inf
    assert np.isnan(found.rmse_N)


@pytest.mark.parametrize("noise", ["form", "form_ar1"])
def test_sizes_relative_to_the_largest_force_are_carried_over_to_a_larger_one(noise):
    whole = measured("none")
    first = Posterior(hypothesis("neo_hookean", ["mullins"], noise), whole.up_to(0.03))
    draws = np.zeros((2, first.size))
    shift = dict(
        zip((p.name for p in first.hypothesis.noise.coordinates), pc._carried(first, draws, whole)[0], strict=True)
    )
    ratio = np.log(np.max(np.abs(first.measurement.force)) / np.max(np.abs(whole.force)))
    assert ratio < -0.3
    assert shift["ln_sd"] == shift["ln_eta_local"] == pytest.approx(ratio)
    assert shift["ln_eta"] == shift["ln_eta_law"] == 0
