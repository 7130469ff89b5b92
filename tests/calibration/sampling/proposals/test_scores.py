"""Normal scores and bends: other coordinates of the same density, in which moves leave it as it is."""

from dataclasses import replace
from typing import Any

import emcee
import numpy as np
import pytest
from scipy.stats import kstest, norm

from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.calibration.sampling.proposals.collapsed import collapsed
from bayesmembrane.calibration.sampling.proposals.ensemble import ensemble_moves
from bayesmembrane.calibration.sampling.proposals.jumping import jumping
from bayesmembrane.calibration.sampling.proposals.mixture import Mixture, fit_mixture, widened
from bayesmembrane.calibration.sampling.proposals.proposing import proposing
from bayesmembrane.calibration.sampling.proposals.scored import Scored, scores_of
from bayesmembrane.calibration.sampling.proposals.scores import Scores
from bayesmembrane.calibration.sampling.proposals.scoring import among_scores
from bayesmembrane.calibration.sampling.weights import worth
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.parameters import HalfNormal, LogNormal, Lomax, Normal, Uniform
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from tests.calibration.sampling.proposals.test_bend import bend

PRIORS = (Normal(1.0, 2.0), Uniform(0.0, 1.0), HalfNormal(0.3), LogNormal(30.0, 1.5), Lomax(0.4))


def each() -> list[Scores]:
    return [Scores(PRIORS), Scores(PRIORS, bend(len(PRIORS)))]


@pytest.mark.parametrize("scores", each(), ids=["plain", "bent"])
def test_there_and_back_again(scores: Scores) -> None:
    x = np.stack([p.draw(np.random.default_rng(2), 500) for p in PRIORS], axis=1)
    z = scores.of(x)
    assert scores.back(z) == pytest.approx(x, rel=1e-9, abs=1e-9)
    assert scores.of(scores.back(z)) == pytest.approx(z, rel=1e-7, abs=1e-7)


@pytest.mark.parametrize("scores", each(), ids=["plain", "bent"])
def test_volumes_are_stretched_as_told(scores: Scores) -> None:
    """By differences, where polynomials are no constants yet."""
    x = np.stack([p.quantile(np.random.default_rng(3).uniform(0.1, 0.9, 20)) for p in PRIORS], axis=1)
    z, k, h = scores.of(x), len(PRIORS), 1e-5
    for row, told in zip(z, scores.log_stretch(z), strict=True):
        moved = row + h * np.concatenate([np.eye(k), -np.eye(k)])
        slopes = (scores.back(moved)[:k] - scores.back(moved)[k:]) / (2 * h)
        assert np.linalg.slogdet(slopes)[1] == pytest.approx(told, abs=1e-5)


@pytest.mark.parametrize("scores", each(), ids=["plain", "bent"])
def test_the_prior_of_scores_is_that_of_coordinates_stretched(scores: Scores) -> None:
    x = np.stack([p.draw(np.random.default_rng(4), 300) for p in PRIORS], axis=1)
    z = scores.of(x)
    own = np.sum([p.log_density(x[:, i]) for i, p in enumerate(PRIORS)], axis=0)
    assert scores.log_prior(z) == pytest.approx(own + scores.log_stretch(z), abs=1e-6)


def test_an_end_of_the_support_is_as_far_as_a_double_tells() -> None:
    scores = Scores((Uniform(0.0, 1.0), HalfNormal(0.3)))
    z = scores.of(np.array([[0.0, 0.0], [1.0, 10.0]]))
    assert z[0].tolist() == [-7.5, -7.5]
    assert z[1, 0] == 7.5
    assert z[1, 1] == pytest.approx(33.3, abs=0.1)
    assert scores.log_prior(np.array([[8.0, 0.0], [0.0, 36.0]])).tolist() == [-np.inf, -np.inf]
    assert scores.log_stretch(np.array([[8.0, 0.0], [0.0, 36.0]])).tolist() == [-np.inf, -np.inf]


def test_normal_priors_alone_leave_coordinates_as_they_are() -> None:
    x = np.ones((2, 2))
    scores = Scores((Normal(0.0, 1.0), Normal(2.0, 3.0)))
    assert scores.plain
    assert scores.of(x) is x
    assert among_scores(move := emcee.moves.DEMove(), scores) is move


def test_a_place_at_an_end_of_the_support_stays_possible() -> None:
    """Whatever round-off a bend adds to its score."""
    scores = Scores(PRIORS, bend(len(PRIORS)))
    rng = np.random.default_rng(11)
    x = np.stack([p.draw(rng, 300) for p in PRIORS], axis=1)
    x[:100, 1], x[100:200, 1], x[200:, 2] = 0.0, 1.0, 0.0
    z = scores.of(x)
    assert np.all(np.isfinite(scores.log_stretch(z)))
    assert np.all(np.isfinite(scores.log_prior(z)))


def test_a_posterior_of_scores_is_that_of_coordinates_stretched() -> None:
    """Also what an emulator asks, which takes a shorter way where the noise allows for it."""
    stretch = np.linspace(1.1, 2.5, 15)
    force = 0.15 * (stretch - stretch**-2) + 2e-3 * np.random.default_rng(7).standard_normal(15)
    m = Measurement(0.05 * (stretch - 1), force, Uniaxial(0.05, 0.01), Specimen("band", 5e-4))
    for noise in ("white", "ar1", "form"):
        p = Posterior(hypothesis("gent", ["permanent_set", "machine_compliance"], noise), m)
        x = p.prior.draw(np.random.default_rng(8), 200)
        found = p.evaluate(x)
        x, curves = (v[np.isfinite(found.log_posterior)] for v in (x, found.curves))
        assert len(x) > 20
        for scores in (scores_of(p), scores_of(p).bent(bend(p.size))):
            scored, z = Scored(p, scores), scores.of(x)
            wanted = p.evaluate(x).log_posterior + scores.log_stretch(z)
            assert scored.evaluate(z).log_posterior == pytest.approx(wanted, rel=1e-6, abs=1e-6)
            assert scored.given(curves, z) == pytest.approx(wanted, rel=1e-6, abs=1e-6)


WALKERS, STEPS = 4000, 40


@pytest.mark.parametrize("move", [*ensemble_moves(1.0), "jump"], ids=["de", "de_far", "snooker", "stretch", "jump"])
@pytest.mark.parametrize("scores", each(), ids=["plain", "bent"])
def test_moves_among_scores_leave_coordinates_as_they_are_distributed(scores: Scores, move: Any) -> None:
    """Walkers begin as independent draws, and are independent draws of the same when they have moved.

    Walkers of one ensemble are not quite independent, so that the smallest of 50 p-values is judged at 1e-8.
    """
    if move == "jump":
        wide = Mixture(np.zeros(1), np.zeros((1, 5)), 1.5 * np.eye(5)[None], 5.0)
        move = (jumping(wide), 1.0)

    def log_density(x: np.ndarray) -> np.ndarray:
        with np.errstate(invalid="ignore"):
            return np.sum([p.log_density(x[:, i]) for i, p in enumerate(PRIORS)], axis=0)

    rng = np.random.default_rng([9, scores.bend is not None])
    x = np.stack([p.draw(rng, WALKERS) for p in PRIORS], axis=1)
    sampler = emcee.EnsembleSampler(WALKERS, 5, log_density, moves=among_scores(move[0], scores), vectorize=True)
    start = emcee.State(x, random_state=np.random.RandomState(int(rng.integers(2**31))).get_state())
    for state in sampler.sample(start, iterations=STEPS, store=False):
        end = state.coords
    assert np.mean(np.any(end != x, axis=1)) > 0.3
    for i, p in enumerate(PRIORS):
        assert kstest(norm.cdf(p.scores(end[:, i])), "uniform").pvalue > 1e-8


def test_proposals_of_effects_have_the_integral_of_prior_draws() -> None:
    """Of all coordinates or of shapes alone, straight or bent: weights are right where priors are not normal, too."""
    stretch = np.linspace(1.1, 2.5, 12)
    force = 0.15 * (stretch - stretch**-2) + 1e-2 * np.random.default_rng(12).standard_normal(12)
    m = Measurement(0.05 * (stretch - 1), force, Uniaxial(0.05, 0.01), Specimen("band", 5e-4))
    p, rng = Posterior(hypothesis("neo_hookean", ["permanent_set"]), m), np.random.default_rng(13)
    shape = collapsed(p)
    assert shape is not None
    s = shape.part(p.prior.draw(rng, 40_000))
    told = shape.evaluate(s).log_likelihood
    w = np.exp(told - np.max(told))
    wanted = np.log(np.mean(w)) + np.max(told)
    x = p.prior.draw(rng, 3000)
    x[:, 1:-1] = shape.whole(s[rng.choice(len(s), 3000, p=w / np.sum(w))])[:, 1:-1]
    given = shape.residuals(shape.evaluate(shape.part(x)).force).given()
    x[:, 0], x[:, -1] = given.drawn(rng.random((3000, 2)))
    for of, places in ((scores_of(p), x), (shape.scores, x[:, 1:-1])):
        z = of.of(places) + 0.05 * rng.standard_normal(places.shape)
        for way in (None, bend(z.shape[1])):
            u = z if way is None else way.of(z)
            proposal = proposing(p, replace(widened(fit_mixture(u, rng), u), bend=way))
            made = proposal.solved(proposal.drawn(rng, 20_000))
            found, ok = worth(made.log_weights), made.log_weights > np.max(made.log_weights) - 50
            assert found.good
            assert found.log_mean == pytest.approx(wanted, abs=6 * found.log_mean_sd + 2e-3)
            again = proposal.log_weights(made.x[ok], made.log_posterior[ok])
            assert again == pytest.approx(made.log_weights[ok], abs=1e-3)
