"""Evidence of fits: an effect of no use gains nothing, and Laplace's approximation equals importance sampling."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import cauchy, multivariate_t, norm

from bayesmembrane.calibration.fit import fit
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.data.shipped import shipped
from bayesmembrane.diagnosis.candidates.candidate import Candidate, available, hidden, unsought, with_effects
from bayesmembrane.diagnosis.candidates.evidence import log_inside
from bayesmembrane.diagnosis.candidates.sampled import sampled
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.candidates.standard import standard
from bayesmembrane.diagnosis.candidates.weighing import starts_with
from bayesmembrane.diagnosis.explanation.case import Question, opened
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.form_error import form_columns, traces
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics.api import solve
from bayesmembrane.physics.rigs.annulus import Annulus
from tests.diagnosis.curves import pulled_and_held, triangle, white_noise
from tests.generator.film import Film

SD, N = 0.004, 90
PLAIN = hypothesis("neo_hookean")
EFFECTS = sorted(n for n, e in components("effects").items() if not e.absorbed)


def curve(path: Array, seed: int) -> Measurement:
    film = Film("neo_hookean", (8.0,), 0.010, 0.035, 0.04)
    force = film.force(path) + SD * np.random.default_rng(seed).standard_normal(path.size)
    return Measurement(path, force, Annulus(0.010, 0.035), Specimen("film", 5e-5), time=np.arange(1.0, path.size + 1))


@pytest.fixture(scope="module")
def single() -> tuple[Search, Candidate]:
    m = curve(np.linspace(0.0, 0.03, N + 1)[1:], 3)
    search = Search(m, white_noise(m, SD, 80.0))
    found = search.fit(PLAIN, search.material_starts(PLAIN))
    assert found is not None
    return search, found


def beside(search: Search, plain: Candidate, name: str) -> Candidate:
    effect = components("effects")[name]()
    claim = with_effects(plain.hypothesis, [effect])
    found = search.fit(claim, starts_with([plain.x], effect, search.expected_sizes(effect)), plain)
    assert found is not None
    return search.polished(found)


@pytest.mark.parametrize("name", ["mullins", "permanent_set", "tearing", "clamp_slip"])
def test_an_effect_that_leaves_no_trace_gains_and_loses_nothing(single, name) -> None:
    """On a single loading these change nothing, or what the energy's own error has as well."""
    search, plain = single
    assert beside(search, plain, name).log_evidence - plain.log_evidence < 0.7


def test_what_a_first_loading_alone_hides_is_looked_for_where_the_film_returns_or_rests(single, cyclic) -> None:
    """There it is another energy; further tests of the material may show it."""
    m = single[0].measurement
    sought, there = ({e.name for e in available(x, PLAIN)} for x in (m, cyclic[0].measurement))
    kept = {"mullins", "permanent_set", "viscoelastic", "hysteresis", "rate"}
    assert not kept & sought
    assert kept <= there
    assert kept <= {e.name for e in hidden(m, PLAIN)}
    assert kept == {e.name for e in unsought(m, PLAIN)}
    assert not unsought(cyclic[0].measurement, PLAIN)
    held = curve(np.concatenate([m.deflection, np.full(40, m.deflection[-1])]), 3)
    assert kept & {e.name for e in available(held, PLAIN)} == {"viscoelastic", "rate"}  # that stops at once, or slowly


@pytest.fixture(scope="module")
def cyclic() -> tuple[Search, Candidate]:
    m = curve(triangle(N, (0.02, 0.03)), 4)
    search = Search(m, white_noise(m, SD, 80.0))
    found = search.fit(PLAIN, search.material_starts(PLAIN))
    assert found is not None
    return search, found


@pytest.mark.parametrize("name", EFFECTS)
def test_evidence_equals_importance_sampling(cyclic, name) -> None:
    """At the size of noise and form error that the fit shows; draws of a wide t about the linear model's posterior."""
    search, plain = cyclic
    if not components("effects")[name].occurs_on(search.measurement.rig):
        pytest.skip("does not occur on this rig")
    found = beside(search, plain, name)
    axes = standard(found.hypothesis, search.measurement)
    u = axes.to_u(found.x)
    spread = axes.local(u)
    model = search.linear(found)
    mean, covariance = model.coefficients(found.theta)
    k = u.size
    low, high = axes.bounds
    low = np.where(axes.one_sided, 0.0, low)
    own = covariance[:k, :k]
    inside = log_inside(mean[:k], own, low / spread, high / spread)
    replaced = axes.log_replaced(u, mean[:k] * spread, np.diag(own) * spread**2)
    linear = model.log_density(found.theta).value + replaced + inside
    prior_of_sizes = norm.logpdf(found.theta, model.priors[:, 0], model.priors[:, 1]).sum()

    law = multivariate_t(mean[:k] * spread, 1.5 * own * np.outer(spread, spread), df=4, seed=8, allow_singular=True)
    draws = np.atleast_2d(law.rvs(4000).reshape(4000, k))
    kept = np.all((draws >= low) & (draws <= high), axis=1)
    x = axes.to_x(draws[kept])
    force = Forward(found.hypothesis, search.measurement, search.measurement.deflection)(x, reached=False).force
    freed = _inverse(search, found)
    r = search.noise.white((search.measurement.force - np.nan_to_num(force, nan=1e3)).T)
    log_likelihood = -0.5 * np.sum(r * (freed @ r), axis=0) + 0.5 * np.linalg.slogdet(freed)[1]
    log_likelihood -= 0.5 * N * np.log(2 * np.pi)
    log_prior = np.where(axes.heavy, cauchy.logpdf(draws[kept]), norm.logpdf(draws[kept]))
    within = np.where(axes.heavy, (np.arctan(high) - np.arctan(low)) / np.pi, np.where(axes.one_sided, 0.5, 1.0))
    log_prior = log_prior.sum(axis=1) - np.log(within).sum()
    weights = np.full(4000, -np.inf)
    weights[kept] = log_likelihood + log_prior - law.logpdf(draws[kept])
    drawn = logsumexp(weights) - np.log(4000) + prior_of_sizes
    # Of what is sudden few draws count: places that are a reading apart are no line. Nor are signs on the way back.
    bent = bool(search.event_steps(found.hypothesis)) or name == "rate"
    assert linear == pytest.approx(drawn, abs=1.5 if bent else 0.8)

    # What the diagnosis draws itself, of fewer draws, adapted: within five standard errors of both, and what it says
    # that its draws have not seen.
    own = sampled(search, found, np.random.default_rng(9))
    w = np.exp(weights - np.max(weights))
    sd = np.sqrt(np.sum(w * w)) / np.sum(w)
    assert own.good
    assert linear + own.difference == pytest.approx(drawn, abs=5 * float(np.hypot(own.sd, sd)) + own.unseen)


def _inverse(search: Search, found: Candidate) -> Array:
    """(N, N) inverse of noise and form error, freed of noise, at the fit."""
    eta = np.exp(found.theta)
    fitted = search.measurement.force - found.residual
    columns = form_columns(search.factors, fitted, found.hypothesis.effects, found.traces)
    sizes = iter(eta[1:])
    columns = [c if size is None else next(sizes) * c for size, c in columns]
    white = search.noise.white(np.column_stack(columns))
    return np.linalg.inv(eta[0] ** 2 * np.eye(N) + white @ white.T)


def test_an_evidence_of_which_a_part_counts_has_its_prior_whole(cyclic) -> None:
    """All of it: ln Z, what draws said of it too. A part: what is believed of the sizes costs as much as before."""
    search, plain = cyclic
    found = [plain, beside(search, plain, "force_offset")]
    for c in found:
        assert search.log_tempered(c, 1.0) == pytest.approx(c.log_evidence, abs=1e-3)
        more = replace(c, by_draws=2.0)
        assert search.log_tempered(more, 0.5) - search.log_tempered(c, 0.5) == pytest.approx(1.0, abs=1e-3)
    whole, part = (search.log_tempered(found[1], a) - search.log_tempered(plain, a) for a in (1.0, 0.5))
    assert whole < 0.0  # it is not there, and costs what it could have been
    assert part < 0.7 * whole


def test_traces_of_an_exact_effect_are_nothing(cyclic) -> None:
    search, plain = cyclic
    found = beside(search, plain, "force_offset")
    forward = Forward(found.hypothesis, search.measurement, search.measurement.deflection)
    force = forward(found.x[None, :], reached=False).force
    assert not np.any(traces(forward, found.x[None, :], force))
    assert found.law_errors == {}


def test_evidence_under_another_noise_is_that_of_a_new_fit(cyclic) -> None:
    search, plain = cyclic
    other = replace(search, noise=white_noise(search.measurement, 1.2 * SD, 80.0))
    anew = other.fit(PLAIN, [plain.x])
    assert anew is not None
    assert other.weighed_anew(plain).log_evidence == pytest.approx(other.polished(anew).log_evidence, abs=0.3)


@pytest.mark.parametrize("name", ["viscoelastic", "mullins", "permanent_set"])
def test_a_polished_fit_is_where_its_linear_model_has_its_mode(cyclic, name) -> None:
    search, plain = cyclic
    found = beside(search, plain, name)
    mean, covariance = search.linear(found).coefficients(found.theta)
    k = found.x.size
    inside = ~standard(found.hypothesis, search.measurement).one_sided  # at a bound the mode may lie beyond
    off = (mean[:k] - search.coefficients_at(found)) / np.sqrt(np.diag(covariance))[:k]
    assert np.max(np.abs(off[inside])) < 0.5


def relaxing() -> tuple[Search, Candidate]:
    """A strip that relaxes by a power of time, pulled and held, and its fit with relaxation."""
    time = np.concatenate([np.linspace(0.1, 10, 60), 10 + np.geomspace(0.2, 1800, 80)])
    noise = 1e-3
    m = pulled_and_held(time, 10.0, lambda lag: (1 + lag / 0.05) ** -0.2, noise, 50814)
    search = Search(m, white_noise(m, noise * float(np.max(m.force)), 80.0))
    plain = search.fit(PLAIN, search.material_starts(PLAIN))
    assert plain is not None
    return search, beside(search, plain, "viscoelastic")


@pytest.mark.parametrize("error", [0.1, 0.2, 0.4])
def test_no_search_ends_where_it_is_less_probable_than_where_it_began(error: float) -> None:
    """Searched on as if the law were off by so much, it had ended far from the film, where that error carries it."""
    search, found = relaxing()
    thought = replace(found, theta=np.append(found.theta[:2], [np.log(error), found.theta[-1]]))
    again = search.polished(thought)
    assert search.log_there(again) >= search.log_there(found) - 0.1
    assert np.std(again.residual) < 5 * search.noise.sd
    assert again.log_evidence == pytest.approx(found.log_evidence, abs=1.0)
    assert search.polished(replace(thought, log_evidence=-np.inf)) is not thought


def test_of_several_fits_each_is_searched_on_as_alone() -> None:
    search, found = relaxing()
    thought = replace(found, theta=np.append(found.theta[:2], [np.log(0.3), found.theta[-1]]))
    both = search.all_polished([found, thought, found])
    assert both[1].x == pytest.approx(search.polished(thought).x)
    assert both[0].x == pytest.approx(both[2].x)
    assert search.all_polished([]) == []


def test_what_a_model_leaves_at_best_is_no_less_than_it_can_leave() -> None:
    """Gent beside a curve that softens: its limit is far, and going on from there would leave half of what it can."""
    m = read_measurement(shipped("elastosil_50um_op1.csv"), shipped("elastosil_50um_op1.toml"))
    case = opened(m, Question(hypothesis("gent")), 0, solve, lambda _: None)
    gent = case.plain["gent"]
    told = case.search.adapted(gent)
    best = fit(m, hypothesis("gent"), loss="weighted")
    assert np.sqrt(np.mean(told**2)) == pytest.approx(best.rmse_N, rel=0.02)
    low, high = np.array([p.bounds for p in gent.hypothesis.parameters[: gent.x.size]]).T
    assert np.all((gent.x >= low) & (gent.x <= high))
