"""The joint prior: densities, quantiles, and the mass that convexity leaves."""

import numpy as np
import pytest

from bayesmembrane.calibration.prior import DRAWS, MOST_DRAWS, JointPrior
from bayesmembrane.ground.registry import materials
from bayesmembrane.physics.convexity import MODES
from bayesmembrane.physics.hypothesis import hypothesis
from tests.physics.predicting import predict


@pytest.mark.parametrize("name", materials())
def test_density_and_quantiles_are_those_of_independent_coordinates(name: str) -> None:
    prior = JointPrior(hypothesis(name, noise="ar1"))
    rng = np.random.default_rng(2)
    x = prior.draw(rng, 6)
    parts = [p.prior.distribution().logpdf(x[:, i]) for i, p in enumerate(prior.hypothesis.parameters)]
    assert prior.log_density(x) == pytest.approx(np.sum(parts, axis=0))
    u = rng.random((5, x.shape[1]))
    back = [p.prior.distribution().cdf(prior.transform(u)[:, i]) for i, p in enumerate(prior.hypothesis.parameters)]
    assert np.transpose(back) == pytest.approx(u)
    assert prior.transform(u[0]) == pytest.approx(prior.transform(u)[0])


def test_draws_of_yeoh_are_counted(film) -> None:  # type: ignore[no-untyped-def]
    """On the reached states a Yeoh energy with c2, c3 >= 0 is convex, so that its mass is a quarter at least."""
    h = hypothesis("yeoh")
    prior, curve = JointPrior(h), film("neo_hookean", (7.5,), points=4)
    masses, inside = prior.survey(curve, seed=3, draws=600)
    assert list(masses) == list(MODES)
    assert masses["none"].value == 1.0
    assert masses["none"].sd == 0.0
    assert 0.25 < masses["reached"].value <= masses["elliptic"].value < 1.0
    assert 0 < masses["reached"].sd < np.sqrt(0.25 / 600)
    assert len(inside) == round(8 * 128 * masses["reached"].value)
    assert np.all(prior.inside(predict(h, inside, curve)))


def test_mass_of_a_known_cut_is_found(film) -> None:  # type: ignore[no-untyped-def]
    """Mooney-Rivlin is convex on the box where the share of c2 lies in an interval: its mass is a normal's."""
    h, curve = hypothesis("mooney_rivlin", convexity="box"), film("neo_hookean", (7.5,), points=4)
    prior = JointPrior(h)
    share = np.linspace(-0.2, 0.2, 801)
    x = np.column_stack([np.zeros(801), share, np.full(801, -5.0)])
    inside = share[prior.inside(predict(h, x, curve))]
    normal = h.material.coordinates[1].prior.distribution()
    expected = normal.cdf(inside[-1]) - normal.cdf(inside[0])
    mass = prior.masses(curve, seed=4, draws=4000)["box"]
    assert abs(mass.value - expected) < 8 * mass.sd + 5e-4


def ball(x: np.ndarray) -> np.ndarray:
    """The inside of an ellipsoid of the prior's spread."""
    return np.asarray(np.sum(x * x, axis=1) < 2.0)


@pytest.mark.parametrize("name", ["mooney_rivlin", "yeoh"])
def test_the_error_of_a_mass_is_the_error_made(name: str) -> None:
    """Over seeds: as large as stated, small, and another for each hypothesis."""
    prior = JointPrior(hypothesis(name))
    centre = prior.transform(np.full(len(prior.hypothesis.parameters), 0.5))
    spread = prior.transform(np.full(len(centre), 0.84)) - centre

    def inside(x: np.ndarray) -> np.ndarray:
        return ball((x - centre) / spread)

    exact = np.mean([np.mean(inside(prior.draw(np.random.default_rng([5, i]), 500_000))) for i in range(4)])
    found = [prior.mass(inside, seed) for seed in range(40)]
    error = np.array([np.log(m.value / exact) for m in found])
    stated = np.array([m.sd / m.value for m in found])
    assert np.max(stated) <= 0.01
    assert 0.3 < np.sqrt(np.mean(error**2) / np.mean(stated**2)) < 2.0
    assert np.unique([m.value for m in found]).size > 10


def test_a_small_mass_takes_more_points_and_none_is_none() -> None:
    prior, asked = JointPrior(hypothesis("yeoh")), []

    def rare(x: np.ndarray) -> np.ndarray:
        asked.append(len(x))
        return np.asarray(np.all(x > prior.transform(np.full(x.shape[1], 0.75)), axis=1))

    mass = prior.mass(rare, 1)
    assert sum(asked) > DRAWS
    assert abs(mass.value - 0.25**4) < 8 * mass.sd
    nothing = prior.mass(lambda x: np.zeros(len(x), dtype=bool), 1)
    assert (nothing.value, nothing.sd) == (0.0, 1 / MOST_DRAWS)


def test_points_differ_by_hypothesis_and_seed() -> None:
    def first(name: str, seed: int) -> np.ndarray:
        h = hypothesis(name)
        x = JointPrior(h).scrambled(seed)[0].draw(4)
        return np.asarray(h.parameters[0].prior.distribution().cdf(x[:, 0]))

    assert first("yeoh", 0) == pytest.approx(first("yeoh", 0))
    assert first("yeoh", 0) != pytest.approx(first("gent", 0))
    assert first("yeoh", 0) != pytest.approx(first("yeoh", 1))


def test_nothing_inside_still_has_a_logarithm() -> None:
    from bayesmembrane.calibration.prior import _mass

    assert 0 < _mass(np.zeros(8, dtype=int), 100).value < 0.01
    assert _mass(np.zeros(8, dtype=int), 100).sd > 0
    assert _mass(np.full(8, 100), 100).value == 1.0
    assert _mass(np.full(8, 50), 100).sd > 0
