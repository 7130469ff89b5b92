"""Data that ask for a film beyond the convexity prior are seen to ask for it, by one test and by two."""

import numpy as np
import pytest

from bayesmembrane.calibration.joint.claim import joint
from bayesmembrane.calibration.joint.posterior import JointPosterior
from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.calibration.quality import RULED_OUT
from bayesmembrane.calibration.ruled_out import ruled_out_gain
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.hypothesis import Hypothesis, hypothesis
from bayesmembrane.physics.rigs.equibiaxial import Equibiaxial

THICKNESS, MPA, TOP = 5e-4, 1e6, 2.2


def sheet(c1: float, c2: float, seed: int) -> Measurement:
    """A sheet pulled both ways, P = 2 (c1 + c2 l^2) (l - l^-5), with noise of 0.2 % of the largest force."""
    rig, stretch = Equibiaxial(), np.linspace(1.05, TOP, 30)
    stress = 2 * (c1 + c2 * stretch**2) * (stretch - stretch**-5) * MPA
    force = stress * rig.width * THICKNESS
    y = force + 2e-3 * np.max(force) * np.random.default_rng(seed).standard_normal(stretch.size)
    return Measurement(rig.length * (stretch - 1), y, rig, Specimen("sheet", THICKNESS))


def draws(posterior: Posterior | JointPosterior, centre: Array) -> Array:
    """Films around ``centre`` that the convexity prior allows, spread as a posterior of precise data is."""
    x = centre + 0.02 * np.random.default_rng(5).standard_normal((4000, centre.size))
    return x[posterior.evaluate(x).log_posterior > -np.inf][:500]


def coordinates(claim: Hypothesis, share: float, sd: float) -> Array:
    """Of a film of 0.2 MPa with so much of the second constant, and noise of ``sd``."""
    x = np.array([p.prior.quantile(0.5) for p in claim.parameters], dtype=float)
    x[claim.names.index("mooney_rivlin.ln_gd")] = np.log(0.4 * MPA * THICKNESS)
    x[claim.names.index("mooney_rivlin.share")] = share
    x[claim.names.index("noise.ln_sd")] = np.log(sd)
    return x


def gained(posterior: Posterior | JointPosterior, x: Array) -> float | None:
    """What films beyond the convexity prior gain over the draws x (B, k)."""
    return ruled_out_gain(posterior, x, posterior.evaluate(x).log_posterior, seed=1)


def test_a_film_that_is_convex_is_where_the_data_are() -> None:
    m, claim = sheet(0.2, 0.0005, seed=71), hypothesis("mooney_rivlin")
    posterior = Posterior(claim, m)
    x = draws(posterior, coordinates(claim, 0.01, 2e-3 * float(np.max(m.force))))
    gain = gained(posterior, x)
    assert gain is not None
    assert gain < RULED_OUT


def test_one_that_is_not_convex_is_asked_for_by_one_test_and_by_two() -> None:
    claim, ms = hypothesis("mooney_rivlin"), [sheet(0.16, 0.04, seed=s) for s in (72, 73)]
    one = Posterior(claim, ms[0])
    x = draws(one, coordinates(claim, 0.1, 0.02 * float(np.max(ms[0].force))))
    assert gained(one, x) > RULED_OUT  # type: ignore[operator]
    both = JointPosterior(joint({"one": ms[0], "two": ms[1]}, claim))
    wide = np.column_stack([x, x[:, -1]])
    assert gained(both, wide) > RULED_OUT  # type: ignore[operator]


@pytest.mark.parametrize("two", [False, True])
def test_a_prior_that_asks_nothing_rules_nothing_out(two: bool) -> None:
    claim, m = hypothesis("mooney_rivlin", convexity="none"), sheet(0.16, 0.04, seed=74)
    other = sheet(0.16, 0.04, seed=75)
    posterior = JointPosterior(joint({"one": m, "two": other}, claim)) if two else Posterior(claim, m)
    assert ruled_out_gain(posterior, np.zeros((8, posterior.size)), np.zeros(8), seed=1) is None


def test_draws_that_fill_no_volume_are_asked_all_the_same() -> None:
    """All alike, or all on a line: nothing has to be inverted."""
    m, claim = sheet(0.2, 0.0005, seed=76), hypothesis("mooney_rivlin")
    posterior, at = Posterior(claim, m), coordinates(claim, 0.01, 2e-3 * float(np.max(m.force)))
    assert gained(posterior, np.tile(at, (8, 1))) == 0.0
    line = at + np.linspace(-1e-3, 1e-3, 40)[:, None] * np.array([1.0, 0.0, 0.0])
    assert gained(posterior, line) is not None
