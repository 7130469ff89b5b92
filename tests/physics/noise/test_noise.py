"""Noise models: every likelihood against SciPy's multivariate normal with the covariance written out."""

import pickle
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.form_error import MIXED, MOST_MIXED
from bayesmembrane.physics.noise.ar1 import AR1, AR1Likelihood
from bayesmembrane.physics.noise.ar1_readings import AR1Readings
from bayesmembrane.physics.noise.base import SD, Elsewhere, Noise, NoiseLikelihood
from bayesmembrane.physics.noise.form import Form
from bayesmembrane.physics.noise.form_ar1 import FormAR1
from bayesmembrane.physics.noise.white import White
from bayesmembrane.physics.rigs.annulus import Annulus

N = 7
SEED = 20240611


def measurement(given: str, time: bool = False) -> Measurement:
    rng = np.random.default_rng(SEED)
    deflection = np.cumsum(rng.uniform(1e-3, 6e-3, N))
    noise: dict[str, object] = {}
    if given == "sd":
        noise["force_sd"] = rng.uniform(0.01, 0.05, N)
    if given == "covariance":
        a = rng.standard_normal((N, N))
        noise["covariance"] = 1e-3 * (a @ a.T + np.eye(N))
    if time:
        noise["time"] = np.cumsum(rng.uniform(0.5, 4.0, N))
    return Measurement(
        deflection,
        100 * deflection,
        Annulus(0.01, 0.035),
        Specimen("film", 5e-5),
        **noise,  # type: ignore[arg-type]
    )


def draws(noise: Noise, count: int = 5) -> np.ndarray:
    rng = np.random.default_rng(SEED + 1)
    return np.stack([rng.normal(p.prior.quantile(0.5), 1.0, count) for p in noise.coordinates], axis=1)


def told(noise: Noise, bound: NoiseLikelihood, rows: int | slice = slice(None), count: int = 5) -> NoiseLikelihood:
    """The noise at some of ``count`` curves with two traces each."""
    rng = np.random.default_rng(SEED + 5)
    force, traces = 1.0 + rng.uniform(0, 2, (count, N)), 0.2 * rng.standard_normal((count, 2, N))
    rows = slice(rows, rows + 1) if isinstance(rows, int) else rows
    return bound.at(force[rows], traces[rows] if bound.traced else None)


MODELS = [*(components("noise")[name]() for name in components("noise")), Form(laws=True), FormAR1(laws=True)]
GIVEN = ["none", "sd", "covariance"]


@pytest.mark.parametrize("noise", MODELS, ids=lambda n: n.name)
@pytest.mark.parametrize("given", GIVEN)
@pytest.mark.parametrize("time", [False, True], ids=["no time", "time"])
def test_likelihood_is_that_of_its_covariance(noise: Noise, given: str, time: bool) -> None:
    m = measurement(given, time)
    bound, x = noise.bind(m), draws(noise)
    residual = 0.05 * np.random.default_rng(SEED + 2).standard_normal((len(x), N))
    expected = [
        multivariate_normal(np.zeros(N), told(noise, bound, b).covariance(x[b])).logpdf(residual[b]) for b in range(5)
    ]
    assert told(noise, bound).log_likelihood(residual, x) == pytest.approx(np.array(expected), rel=1e-9)


@pytest.mark.parametrize("noise", MODELS, ids=lambda n: n.name)
@pytest.mark.parametrize("given", GIVEN)
def test_pointwise_is_the_density_given_all_other_points(noise: Noise, given: str) -> None:
    bound, x = noise.bind(measurement(given)), draws(noise, 2)
    residual = 0.05 * np.random.default_rng(SEED + 3).standard_normal((2, N))
    got = told(noise, bound, count=2).pointwise(residual, x)
    for b in range(2):
        sigma = told(noise, bound, b, count=2).covariance(x[b])
        whole = multivariate_normal(np.zeros(N), sigma).logpdf(residual[b])
        for i in range(N):
            rest = np.delete(np.arange(N), i)
            others = multivariate_normal(np.zeros(N - 1), sigma[np.ix_(rest, rest)]).logpdf(residual[b, rest])
            assert got[b, i] == pytest.approx(whole - others, rel=1e-7)


@pytest.mark.parametrize("noise", MODELS, ids=lambda n: n.name)
@pytest.mark.parametrize("given", GIVEN)
def test_draws_have_the_covariance(noise: Noise, given: str) -> None:
    bound = told(noise, noise.bind(measurement(given)), 0)
    x = np.repeat(draws(noise, 1), 20000, axis=0)
    sigma = bound.covariance(x[0])
    assert bound.sd(x[:1])[0] == pytest.approx(np.sqrt(np.diag(sigma)))
    z = bound.draw(x, np.random.default_rng(SEED + 4))
    root = np.sqrt(np.diag(sigma))
    assert np.max(np.abs(np.cov(z.T) - sigma) / np.outer(root, root)) < 0.06  # six deviations of a variance


@pytest.mark.parametrize("noise", MODELS, ids=lambda n: n.name)
def test_given_noise_is_a_floor(noise: Noise) -> None:
    m = measurement("covariance")
    assert m.covariance is not None
    added = told(noise, noise.bind(m), 0).covariance(draws(noise, 1)[0]) - m.covariance
    assert np.min(np.linalg.eigvalsh(added)) > 0


@pytest.mark.parametrize("noise", MODELS, ids=lambda n: n.name)
def test_component_is_complete(noise: Noise) -> None:
    assert pickle.loads(pickle.dumps(noise)) == noise
    x = draws(noise, 4)
    natural = noise.natural(x, 2.0)
    assert natural.shape == (4, len(noise.natural_parameters))
    assert noise.natural_parameters[0] == SD
    assert all(p.unit and len(p.meaning) > 5 for p in noise.natural_parameters)
    assert len(noise.title) > 5
    assert natural[:, 0] == pytest.approx(2.0 * np.exp(x[:, 0]))
    for p in noise.coordinates:
        assert np.isfinite(p.prior.log_density(p.prior.quantile(0.5)))
        assert p.bounds[0] < p.prior.quantile(0.001) < p.prior.quantile(0.999) < p.bounds[1]
    assert type(noise).__doc__


def test_short_memory_is_white_noise() -> None:
    m = measurement("sd")
    residual = 0.03 * np.random.default_rng(SEED).standard_normal((3, N))
    x = np.full((3, 1), -3.0)
    white = White().bind(m).log_likelihood(residual, x)
    assert AR1().bind(m).log_likelihood(residual, np.hstack([x, np.full((3, 1), -8.0)])) == pytest.approx(white)


def test_evenly_spaced_points_have_the_correlation_rho() -> None:
    d = np.linspace(0.01, 0.05, 5)
    m = Measurement(d, d, Annulus(0.01, 0.035), Specimen("film", 5e-5))
    x = np.array([[0.0, 0.7]])
    rho = AR1().natural(x, 1.0)[0, 1]
    sigma = AR1().bind(m).covariance(x[0])
    assert sigma[0, 2] / sigma[0, 0] == pytest.approx(rho**2)


def test_stated_noise_alone_must_be_stated() -> None:
    assert White(extra=False).bind(measurement("sd")).log_likelihood(np.zeros((1, N)), np.empty((1, 0))).shape == (1,)
    with pytest.raises(SettingsError, match="no noise at all"):
        White(extra=False).bind(measurement("none"))


def test_a_filter_of_readings_is_found_where_the_speed_changes() -> None:
    """Every reading remembers half of the one before, on a slow leg and on one ten times as fast alike."""
    rng = np.random.default_rng(SEED + 9)
    n = 2400  # the deviation of a correlation found from so many is 0.018
    r = rng.standard_normal(n)
    for i in range(1, r.size):
        r[i] = 0.5 * r[i - 1] + np.sqrt(0.75) * r[i]
    time = np.cumsum(np.where(np.arange(n) < n // 2, 1.0, 0.1))
    d = np.linspace(1e-3, 0.04, n)
    m = Measurement(d, 100 * d, Annulus(0.01, 0.035), Specimen("film", 5e-5), time=time)
    by_reading, by_time = (components("noise")[n]().bind(m) for n in ("ar1_readings", "ar1"))
    lengths = np.linspace(-2.0, 3.0, 101)
    x = np.column_stack([np.full(101, np.log(1 / by_reading.scale)), lengths])
    values, others = (b.log_likelihood(np.tile(r, (101, 1)), x) for b in (by_reading, by_time))
    assert np.exp(-np.exp(-lengths[np.argmax(values)])) == pytest.approx(0.5, abs=0.1)
    assert values.max() > others.max() + 5


@pytest.mark.parametrize("name", sorted(components("noise")))
def test_a_model_keeps_to_the_stated_noise_or_says_that_it_cannot(name: str) -> None:
    kind = components("noise")[name]
    assert kind().inferred == bool(kind().coordinates)
    if kind.stated_only.__func__ is Noise.stated_only.__func__:
        with pytest.raises(SettingsError, match=name):
            kind.stated_only()
        return
    without = kind.stated_only()
    assert not without.inferred
    assert without.coordinates == without.natural_parameters == ()
    found = without.bind(measurement("sd")).covariance(np.empty(0))
    np.testing.assert_allclose(found, measurement("sd").noise_covariance, rtol=1e-14)


def test_white_noise_can_do_without_its_own() -> None:
    assert White.stated_only() == White(extra=False)


# ---- form error ------------------------------------------------------------------------------------------------------


def smooth_part(bound: NoiseLikelihood, x: np.ndarray) -> np.ndarray:
    """The covariance of the form error alone, without what is not steady."""
    quiet, none = np.array([-25.0, x[1], -40.0, *x[3:]]), np.array([-25.0, -40.0, -40.0, -40.0, *x[4:]])
    return bound.covariance(quiet) - bound.at(bound.force, 0 * bound.traces).covariance(none)


@pytest.mark.parametrize("given", GIVEN)
def test_no_form_error_is_white_noise(given: str) -> None:
    m = measurement(given)
    residual = 0.03 * np.random.default_rng(SEED).standard_normal((5, N))
    x = np.column_stack([np.full(5, -3.0), *(np.full(5, -40.0),) * 3])
    white, form = White().bind(m), Form(laws=True).bind(m).at(np.full((5, N), 2.0), np.zeros((5, 2, N)))
    assert form.log_likelihood(residual, x) == pytest.approx(white.log_likelihood(residual, x[:, :1]), rel=1e-12)
    assert form.pointwise(residual, x) == pytest.approx(white.pointwise(residual, x[:, :1]), rel=1e-9)


@pytest.mark.parametrize("given", GIVEN)
def test_noise_that_forgets_at_once_is_white_beside_a_form_error(given: str) -> None:
    m, x = measurement(given), draws(Form(laws=True))
    residual = 0.03 * np.random.default_rng(SEED).standard_normal((5, N))
    white, forgets = (told(n, n.bind(m)) for n in (Form(laws=True), FormAR1(laws=True)))
    at_once = np.column_stack([x, np.full(5, -8.0)])
    assert forgets.log_likelihood(residual, at_once) == pytest.approx(white.log_likelihood(residual, x), rel=1e-9)


@pytest.mark.parametrize("given", ["none", "sd"])
def test_no_form_error_is_noise_that_remembers(given: str) -> None:
    m, residual = measurement(given), 0.03 * np.random.default_rng(SEED).standard_normal((5, N))
    x = np.column_stack([np.full(5, -3.0), np.full(5, -40.0), np.full(5, -40.0), np.full(5, 0.4)])
    alone, beside = AR1Readings().bind(m), FormAR1().bind(m).at(np.full((5, N), 2.0))
    assert beside.log_likelihood(residual, x) == pytest.approx(alone.log_likelihood(residual, x[:, [0, 3]]), rel=1e-9)


def test_effects_without_a_trace_have_no_form_error() -> None:
    bound, x = Form(laws=True).bind(measurement("sd")), draws(Form(laws=True))
    force, residual = np.full((5, N), 2.0), 0.03 * np.random.default_rng(SEED).standard_normal((5, N))
    without = Form().bind(measurement("sd")).at(force).log_likelihood(residual, x[:, :3])
    assert bound.at(force, np.zeros((5, 2, N))).log_likelihood(residual, x) == pytest.approx(without, rel=1e-12)


@pytest.mark.parametrize("noise", [Form(laws=True), FormAR1(laws=True)], ids=lambda n: n.name)
@pytest.mark.parametrize("given", GIVEN)
def test_what_recurs_is_the_form_error_given_the_residual(given: str, noise: Noise) -> None:
    """S_s S^-1 r and S_s - S_s S^-1 S_s, at the readings, and at other points where they are the same ones."""
    m, x = measurement(given), draws(noise, 1)[0]
    bound = told(noise, noise.bind(m), 0)
    sigma, smooth = bound.covariance(x), smooth_part(bound, x)
    residual = 0.3 * np.random.default_rng(SEED).standard_normal(N)
    gain = smooth @ np.linalg.inv(sigma)
    many = np.repeat(x[None], 4000, axis=0)
    same = Elsewhere(m.path, np.repeat(bound.force, 4000, axis=0), np.repeat(bound.traces, 4000, axis=0))
    for there in (None, same):
        z = bound.recurring(np.tile(residual, (4000, 1)), many, np.random.default_rng(SEED + 7), there)
        left = smooth - gain @ smooth
        root = np.sqrt(np.diag(left))
        assert np.max(np.abs(np.mean(z, axis=0) - gain @ residual) / root) < 0.1
        assert np.max(np.abs(np.cov(z.T) - left) / np.outer(root, root)) < 0.12


def test_what_film_and_effects_mix_is_as_large_as_the_traces() -> None:
    bound, x = (
        told(Form(laws=True), Form(laws=True).bind(measurement("none")), 0),
        np.array([-25.0, -40.0, -40.0, -40.0]),
    )
    small = bound.at(bound.force, 0.1 * bound.traces)
    assert np.trace(small.covariance(x)) == pytest.approx(MIXED**2 * np.sum(small.traces[0] ** 2), rel=1e-6)
    # However large they are, it stays a small part of the force.
    large = bound.at(bound.force, 10 * bound.traces)
    assert np.trace(large.covariance(x)) == pytest.approx(MOST_MIXED**2 * np.sum(bound.force[0] ** 2), rel=1e-6)


def test_the_film_alone_has_no_part_in_what_effects_mix() -> None:
    """Where no effect is at work, only the energy's error recurs; with the effects, the other does too."""
    m, count = measurement("none"), 2000
    bound = told(Form(laws=True), Form(laws=True).bind(m), 0)
    x = np.tile([-7.0, np.log(1e-4), -40.0, np.log(1e-4)], (count, 1))
    force = np.repeat(bound.force, count, axis=0)
    one = np.zeros((count, N)), x, np.random.default_rng(SEED)
    alone = bound.recurring(*one, Elsewhere(m.path, force))
    both = bound.recurring(*one, Elsewhere(m.path, force, np.repeat(bound.traces, count, axis=0)))
    assert np.std(alone / force, axis=0) == pytest.approx(np.full(N, 1e-4), rel=0.2)
    assert np.mean(np.std(both / force, axis=0)) > 3e-4


def test_far_from_the_readings_the_form_error_is_that_of_the_prior() -> None:
    m, x = measurement("sd"), np.array([[-7.0, np.log(0.05), -40.0]])
    bound = Form().bind(m).at(np.ones((1, N)))
    far = Elsewhere(replace(m.path, deflection=m.deflection + 4 * m.full_range), np.ones((1, N)))
    one = (np.zeros((1, N)), x, np.random.default_rng(SEED))
    near, away = (np.std([bound.recurring(*one, there)[0] for _ in range(400)]) for there in (None, far))
    assert away == pytest.approx(0.05, rel=0.25)
    assert near < 0.7 * away


def test_chi_square_counts_the_form_error_beside_the_stated_noise() -> None:
    m, x = measurement("covariance"), draws(Form(laws=True), 1)
    bound = told(Form(laws=True), Form(laws=True).bind(m), 0)
    r = 0.03 * np.random.default_rng(SEED).standard_normal(N)
    local = np.diag(np.exp(2 * x[0, 2]) * np.max(bound.force) ** 2 * bound.spots)
    expected = r @ np.linalg.solve(m.covariance + smooth_part(bound, x[0]) + local, r)
    assert bound.stated(r[None], x) == pytest.approx(expected, rel=1e-6)
    assert Form().bind(measurement("none")).stated(r[None], draws(Form(), 1)) is None


@pytest.mark.parametrize("noise", [Form(), FormAR1()], ids=lambda n: n.name)
@pytest.mark.parametrize("given", GIVEN)
def test_what_is_not_steady_is_an_error_of_its_readings_alone(given: str, noise: Noise) -> None:
    """Sigma + (eta_l F_max)^2 P; the first three and the last two of seven readings of one loading, no others."""
    bound, x = told(noise, noise.bind(measurement(given)), 0), draws(noise, 1)[0]
    without = np.array([*x[:2], -40.0, *x[3:]])
    expected = np.zeros(N)
    expected[[0, 1, 2, -2, -1]] = (np.exp(x[2]) * np.max(bound.force)) ** 2
    assert bound.covariance(x) - bound.covariance(without) == pytest.approx(np.diag(expected), abs=1e-15)
    # It is no error of the film: another test has it anew.
    once = (np.full((4000, N), 0.0), np.tile([-20.0, -40.0, x[2], *x[3:]], (4000, 1)), np.random.default_rng(SEED + 8))
    assert np.max(np.abs(bound.recurring(*once))) < 1e-9
    if given == "none":
        assert np.std(bound.fresh(*once[1:]), axis=0) == pytest.approx(np.sqrt(expected), rel=0.08, abs=1e-6)


def test_twenty_thousand_readings_need_no_square_of_that() -> None:
    n = 20_000
    d = np.linspace(1e-3, 0.04, n)
    m = Measurement(d, 50 * d, Annulus(0.01, 0.035), Specimen("film", 5e-5))
    # What compiles is not what is looked at, and tracing it takes ten times as long.
    few = replace(m, deflection=d[:40], force=m.force[:40])
    Form().bind(few).log_likelihood(np.full((1, 40), 1e-3), np.array([[-6.0, -6.0, -6.0]]))
    tracemalloc.start()
    try:
        found = Form().bind(m).log_likelihood(np.full((1, n), 1e-3), np.array([[-6.0, -6.0, -6.0]]))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert np.isfinite(found[0])
    assert peak < n * n  # bytes: an eighth of such a square


def test_a_memory_of_many_times_the_test_beside_a_given_covariance_has_a_likelihood() -> None:
    """Such a covariance is of rank one but for round-off: no factor of it can be taken as it is."""
    n = 12
    m = Measurement(
        np.linspace(0.001, 0.01, n),
        np.ones(n),
        Annulus(0.010, 0.035),
        Specimen("film", 50e-6),
        time=np.arange(1.0, n + 1),
        covariance=1e-22 * np.eye(n),
    )
    x = np.array([[0.0, 45.0], [np.log(1e-3), 1.0]])
    found = AR1Likelihood(m).log_likelihood(np.full((2, n), 1e-3), x)
    assert np.all(np.isfinite(found))
    # The same beside a form error, which is none at ln_eta = -40.
    both = FormAR1().bind(m).log_likelihood(np.full((2, n), 1e-3), np.insert(x, [1, 1], -40.0, axis=1))
    assert both == pytest.approx(found, rel=1e-6)
