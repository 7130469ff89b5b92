"""The posterior: what it is made of, and why it is zero where it is."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from bayesmembrane.calibration import posterior
from bayesmembrane.calibration.posterior import Outcome, Outcomes, Posterior
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.registry import material
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics import Request, Status, solve
from bayesmembrane.physics.mechanics.solution import Curves


def at(name: str, films: list[list[float]], ln_sd: float = -4.0) -> np.ndarray:
    x = material(name).to_coordinates(np.transpose(films)).T
    return np.column_stack([x, np.full(len(x), ln_sd)])


def test_it_is_prior_times_likelihood(film) -> None:  # type: ignore[no-untyped-def]
    curve = film("yeoh", (8.0, -0.2, 0.03), noise=0.01, stated=True)
    p, x = Posterior(hypothesis("yeoh"), curve), at("yeoh", [[8.0, -0.2, 0.03], [8.5, -0.1, 0.02]])
    e = p.evaluate(x)
    tau = np.exp(-4.0) * np.max(curve.force)
    for i in range(2):
        normal = multivariate_normal(e.force[i], np.eye(len(curve)) * (0.01**2 + tau**2))
        assert e.log_likelihood[i] == pytest.approx(normal.logpdf(curve.force))
    assert e.log_prior == pytest.approx(p.prior.log_density(x))
    assert e.log_posterior == pytest.approx(e.log_prior + e.log_likelihood)
    assert p.pointwise(x, e.force).sum(axis=1) == pytest.approx(e.log_likelihood)
    assert p.log_prior(x) == pytest.approx(e.log_prior)
    assert p.log_likelihood(x) == pytest.approx(e.log_likelihood)


def test_what_cannot_be_has_a_reason(film) -> None:  # type: ignore[no-untyped-def]
    curve = film("neo_hookean", (7.5,))
    locked = Posterior(hypothesis("gent"), curve).evaluate(at("gent", [[7.5, 2.0], [7.5, 50.0]]))
    assert list(locked.outcome) == [Outcome.LOCKED, Outcome.OK]
    assert locked.log_likelihood[0] == -np.inf
    assert np.isfinite(locked.log_posterior[1])
    films = at("mooney_rivlin", [[3.0, 4.5], [7.0, 0.1]])
    bent = Posterior(hypothesis("mooney_rivlin"), curve).evaluate(films)
    assert list(bent.outcome) == [Outcome.NOT_CONVEX, Outcome.OK]
    assert bent.log_prior[0] == -np.inf
    free = Posterior(hypothesis("mooney_rivlin", convexity="none"), curve).evaluate(films)
    assert np.all(np.isfinite(free.log_posterior))
    counted = Outcomes({"ok": 2})
    counted.note(films, bent.outcome)
    assert counted == {"not convex": 1, "ok": 3}
    assert counted.examples == {"not convex": tuple(films[0])}


def test_a_numerical_failure_is_counted_and_not_taken_for_physics(film) -> None:  # type: ignore[no-untyped-def]
    def failing(asked: Request) -> Curves:
        curves = solve(asked)
        status = curves.status.copy()
        status[0, -1] = Status.UNRESOLVED
        return replace(curves, status=status, force=np.where(status == Status.OK, curves.force, np.nan))

    curve = film("neo_hookean", (7.5,))
    p = Posterior(hypothesis("gent"), curve, failing)
    e = p.evaluate(at("gent", [[7.5, 50.0], [7.5, 60.0]]))
    assert list(e.outcome) == [Outcome.UNRESOLVED, Outcome.OK]
    assert e.log_likelihood[0] == -np.inf


def test_more_parameters_than_points_are_refused(film) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(SettingsError, match="4 points cannot fix the 6 parameters of ogden"):
        Posterior(hypothesis("ogden"), film("neo_hookean", (7.5,), points=4))


def test_noise_that_is_switched_off_must_be_stated(film) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(SettingsError, match="no noise at all"):
        Posterior(hypothesis("yeoh", extra_noise=False), film("neo_hookean", (7.5,)))


def test_many_draws_are_weighed_in_parts(film, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    """Whatever fits into memory: the answer is the same, also where whole parts have no curve."""
    m = film("neo_hookean", (7.0,), points=9, noise=1e-3)
    p = Posterior(hypothesis("gent", ("friction",), "form"), m)
    x = np.concatenate([p.prior.draw(np.random.default_rng(4), 20), np.full((4, p.size), 30.0)])
    whole = p.evaluate(x)
    monkeypatch.setattr(posterior, "AT_ONCE", 4 * len(m))
    parts = posterior.weighed(p, x)
    for name in ("log_prior", "log_likelihood", "outcome"):
        np.testing.assert_allclose(getattr(parts, name), getattr(whole, name), rtol=1e-9, err_msg=name)
    assert type(parts) is not type(whole)  # no curves are kept
    density, curves = posterior.solved_in_parts(p, x)
    np.testing.assert_allclose(density, whole.log_posterior, rtol=1e-9)
    np.testing.assert_allclose(curves, whole.curves, rtol=1e-9)


@pytest.mark.parametrize("name", ["yeoh", "gent", "mooney_rivlin"])
@pytest.mark.parametrize("mode", ["reached", "elliptic"])
def test_films_that_are_convex_everywhere_are_those_that_the_solver_finds_so(  # type: ignore[no-untyped-def]
    film, monkeypatch: pytest.MonkeyPatch, name: str, mode: str
) -> None:
    """Nothing of the posterior changes where nobody looks beyond the readings of such a film."""
    curve = film("neo_hookean", (7.5,), points=12).up_to(0.04)
    p = Posterior(hypothesis(name, convexity=mode), curve)
    x = p.prior.draw(np.random.default_rng(8), 300)
    sure = p.prior.surely_inside(x)
    assert np.any(sure) == (name != "mooney_rivlin")
    found, log_prior, masses = p.evaluate(x), p.log_prior(x), p.prior.masses(curve, draws=256)
    monkeypatch.setattr(material(name), "convex_everywhere", lambda p: np.zeros(np.shape(p[0]), dtype=bool))
    followed = p.evaluate(x)
    assert np.array_equal(found.log_prior, followed.log_prior)
    assert np.array_equal(log_prior, followed.log_prior)
    np.testing.assert_allclose(found.log_likelihood, followed.log_likelihood, rtol=1e-6)
    assert np.array_equal(found.outcome, followed.outcome)
    assert masses == p.prior.masses(curve, draws=256)
