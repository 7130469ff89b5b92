"""The joint prior: densities, quantiles, and the mass that convexity leaves."""

import numpy as np
import pytest

from bayesmembrane.calibration.prior import JointPrior
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
    assert masses["reached"].sd == pytest.approx(np.sqrt(masses["reached"].value * (1 - masses["reached"].value) / 600))
    assert len(inside) == round(600 * masses["reached"].value)
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
    assert abs(mass.value - expected) < 4 * mass.sd + 5e-4


def test_nothing_inside_still_has_a_logarithm(film) -> None:  # type: ignore[no-untyped-def]
    from bayesmembrane.calibration.prior import _mass

    assert 0 < _mass(0, 100).value < 0.01
    assert _mass(0, 100).sd > 0
    assert _mass(100, 100).value == 1.0
