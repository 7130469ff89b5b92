"""Shapes alone: what they weigh is what all coordinates weigh, integrated; proposals of them are exact."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import simpson

from bayesmembrane.calibration.few import weighing
from bayesmembrane.calibration.posterior import Outcome, Posterior
from bayesmembrane.calibration.sampling.proposals.collapsed import Collapsed, collapsed
from bayesmembrane.calibration.sampling.proposals.mixture import Mixture
from bayesmembrane.calibration.sampling.proposals.proposing import ShapeFirst, Whole, proposing
from bayesmembrane.calibration.sampling.weights import worth
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.physics.rigs.contour import Contour
from bayesmembrane.physics.rigs.uniaxial import Uniaxial


def strip(noise: str, points: int = 12) -> Measurement:
    """A rubber band, whose law is a closed form, with noise that is stated or not."""
    rng = np.random.default_rng(51)
    stretch = np.linspace(1.1, 2.5, points)
    force = 0.15 * (stretch - stretch**-2) + 2e-3 * rng.standard_normal(points)
    stated: dict[str, np.ndarray] = {}
    if noise == "sd":
        stated["force_sd"] = rng.uniform(5e-4, 2e-3, points)
    if noise == "covariance":
        a = rng.standard_normal((points, points))
        stated["covariance"] = 1e-7 * (a @ a.T + np.eye(points))
    return Measurement(0.05 * (stretch - 1), force, Uniaxial(0.05, 0.01), Specimen("band", 5e-4), **stated)  # type: ignore[arg-type]


def shapes_of(noise: str, points: int = 12, effects: tuple[str, ...] = ()) -> Collapsed:
    found = collapsed(Posterior(hypothesis("gent", effects), strip(noise, points)))
    assert found is not None
    return found


@pytest.mark.parametrize("effects", [(), ("permanent_set",)])
@pytest.mark.parametrize("noise", ["none", "sd", "covariance"])
def test_collapsed_equals_quadrature(noise: str, effects: tuple[str, ...]) -> None:
    shape = shapes_of(noise, effects=effects)
    of_effects = np.concatenate([[], *(e.typical for e in shape.posterior.hypothesis.effects)])
    for limit in (2.5, 4.0):  # ln of it
        s = np.append(limit, of_effects)[None]
        x = shape.whole(s)[0]
        best = 0.5 * np.log(np.sum(shape.posterior.measured**2) / np.sum(shape.evaluate(s).force ** 2))
        t, u = np.linspace(best - 0.5, best + 0.5, 801), np.linspace(-14, 1, 181)
        grid = np.tile(x, (t.size * u.size, 1))
        grid[:, 0], grid[:, -1] = (v.ravel() for v in np.meshgrid(t, u, indexing="ij"))
        lp = shape.posterior.evaluate(grid).log_posterior.reshape(t.size, u.size)
        exact = np.max(lp) + np.log(simpson(simpson(np.exp(lp - np.max(lp)), x=u, axis=1), x=t))
        found = shape.evaluate(s).log_posterior - shape.scores.log_stretch(s)
        assert found[0] == pytest.approx(exact, abs=0.02)


def test_few_numbers_weigh_as_all_readings() -> None:
    """A long curve told at few deflections, and the same at every reading: to the digits of a spline."""
    rng = np.random.default_rng(52)
    deflection = np.linspace(1e-3, 0.04, 1600)
    rig, specimen = Annulus(0.01, 0.035), Specimen("film", 5e-5)
    plain = Measurement(deflection, deflection, rig, specimen)
    x = np.array([[np.log(15.0), np.log(25.0), -4.0]])
    force = Posterior(hypothesis("gent"), plain).forward(x).force[0]
    m = replace(plain, force=force + 0.01 * rng.standard_normal(force.size))
    whole = Posterior(hypothesis("gent"), m)
    few = weighing(whole)
    assert few is not whole
    s = np.linspace(3.0, 3.5, 5)[:, None]
    a, b = (collapsed(p).evaluate(s).log_posterior for p in (whole, few))  # type: ignore[union-attr]
    assert b == pytest.approx(a, abs=1e-4)


def test_forces_too_large_to_be_squared_weigh_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    shape, s = shapes_of("covariance"), np.array([[3.0], [4.0]])
    plain = shape.posterior.evaluate(shape.whole(s))
    assert np.all(np.isfinite(shape.evaluate(s).log_posterior))
    huge = replace(plain, force=plain.force * np.array([[1.0], [1e200]]))
    monkeypatch.setattr(Posterior, "evaluate", lambda posterior, x: huge)
    found = shape.evaluate(s)
    assert np.isfinite(found.log_posterior[0])
    assert found.log_prior[1] == found.log_likelihood[1] == -np.inf


def mixture(centre: float, sd: float) -> Mixture:
    return Mixture(np.zeros(1), np.array([[centre]]), np.array([[[sd]]]), 5.0)


@pytest.mark.parametrize("noise", ["none", "covariance"])
def test_proposals_are_weighed_by_the_exact_density(noise: str) -> None:
    """ln p is that of the posterior, and mean weights under two mixtures are the same integral."""
    shape = shapes_of(noise)
    s = np.linspace(1.0, 10.0, 400)[:, None]
    lp = shape.evaluate(s).log_posterior
    w = np.exp(lp - np.max(lp))
    mean, sd = np.average(s[:, 0], weights=w), np.sqrt(np.cov(s[:, 0], aweights=w))
    found = []
    for g, seed in ((mixture(mean, sd), 53), (mixture(mean + sd, 2 * sd), 54)):
        proposal = proposing(shape.posterior, g)
        assert isinstance(proposal, ShapeFirst)
        made = proposal.solved(proposal.drawn(np.random.default_rng(seed), 20_000))
        ok = np.isfinite(made.log_posterior)
        exact = shape.posterior.evaluate(made.x[ok]).log_posterior
        assert made.log_posterior[ok] == pytest.approx(exact, rel=1e-9, abs=1e-6)
        assert proposal.log_weights(made.x, made.log_posterior)[ok] == pytest.approx(made.log_weights[ok], abs=1e-9)
        assert np.all(made.outcome[ok] == Outcome.OK)
        found.append(worth(made.log_weights))
    assert all(f.good for f in found)
    assert found[0].log_mean == pytest.approx(found[1].log_mean, abs=6 * np.hypot(*(f.log_mean_sd for f in found)))


@pytest.mark.parametrize("rig", ["strip", "annulus"])
def test_what_was_proposed_is_known_to_the_last_digit(monkeypatch: pytest.MonkeyPatch, rig: str) -> None:
    """And is what all coordinates weigh, to round-off; films that nothing knows are solved."""
    m = strip("none")
    if rig == "annulus":
        lifts = np.linspace(4e-3, 0.04, 8)
        m = Measurement(lifts, 30.0 * lifts + 1.0, Annulus(0.01, 0.035), Specimen("film", 5e-5))
    known, anew = (collapsed(Posterior(hypothesis("gent"), m)) for _ in range(2))
    assert known is not None
    assert anew is not None
    proposal = ShapeFirst(known, mixture(3.5, 0.3))
    made = proposal.solved(proposal.drawn(np.random.default_rng(55), 64))
    x = np.concatenate([made.x[np.isfinite(made.log_posterior)], anew.whole(np.array([[3.4], [-40.0]]))])
    plain, solved = known.posterior.evaluate(x), anew.at(x)
    told = known.at(x)
    assert np.array_equal(told.outcome, plain.outcome)
    for name in ("force", "log_prior", "log_likelihood"):
        a, b, c = (getattr(e, name) for e in (told, solved, plain))
        assert np.array_equal(a, b, equal_nan=True)
        assert a == pytest.approx(c, rel=1e-9, abs=1e-12, nan_ok=True)
    lp = plain.log_posterior[:-2]
    weights = ShapeFirst(anew, proposal.mixture).log_weights(x[:-2], lp)
    monkeypatch.setattr(Posterior, "evaluate", lambda *_: pytest.fail("solved again"))
    assert np.array_equal(known.at(x[:-2]).force, told.force[:-2])
    assert proposal.log_weights(x[:-2], lp) == pytest.approx(weights, rel=1e-9)


def test_a_mixture_of_all_coordinates_proposes_those() -> None:
    p = Posterior(hypothesis("gent"), strip("none"))
    assert isinstance(proposing(p, Mixture(np.zeros(1), np.zeros((1, 3)), np.eye(3)[None], 5.0)), Whole)


def test_what_is_not_proportional_to_a_modulus_is_not_collapsed() -> None:
    m = strip("sd", 15)
    assert collapsed(Posterior(hypothesis("gent"), m)) is not None
    assert collapsed(Posterior(hypothesis("neo_hookean"), m)) is None
    assert collapsed(Posterior(hypothesis("gent", noise="ar1"), m)) is None
    assert collapsed(Posterior(hypothesis("gent", extra_noise=False), m)) is None
    assert collapsed(Posterior(hypothesis("neo_hookean", ["permanent_set"]), m)) is not None
    for effect in ("force_offset", "machine_compliance"):
        assert collapsed(Posterior(hypothesis("gent", ["permanent_set", effect]), m)) is None
    assert collapsed(object()) is None
    rig = Contour.example()
    radius = rig.inner_radius + (rig.outer_radius - rig.inner_radius) * np.linspace(0.1, 0.9, 9)
    heights = Measurement(radius, rig.lift * np.linspace(0.9, 0.1, 9), rig, Specimen("film", 1e-4))
    assert collapsed(Posterior(hypothesis("gent"), heights)) is None
