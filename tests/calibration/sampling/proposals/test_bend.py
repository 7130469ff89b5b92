"""Bends: coordinates in which a bent valley is straight, and none where there is no bend."""

import numpy as np
import pytest

from bayesmembrane.calibration.sampling.proposals.bend import FARTHEST, Bend, bend_of
from bayesmembrane.calibration.sampling.proposals.mixture import fit_mixture


def sheet(rng: np.random.Generator, count: int, k: int = 5) -> np.ndarray:
    """Draws of a bent valley: two coordinates are next to polynomials of the three that are long."""
    z = rng.standard_normal((count, k))
    t, far = z[:, : min(3, k - 2)], min(3, k - 2)
    z[:, far] = 0.3 * t[:, 0] ** 2 - 0.1 * t[:, 0] * t[:, -1] + 0.01 * z[:, far]
    z[:, far + 1] = 0.3 * t[:, -1] ** 2 + 0.05 * t[:, 0] ** 3 + 0.01 * z[:, far + 1]
    z[:, :far] *= 3.0
    return z


def bend(k: int = 5) -> Bend:
    found = bend_of(sheet(np.random.default_rng(1), 3000, k))
    assert found is not None
    return found


def test_a_bent_valley_is_straightened() -> None:
    """Densities follow it more closely."""
    rng = np.random.default_rng(5)
    z, held = sheet(rng, 4000), sheet(rng, 4000)
    found = bend_of(z)
    assert found is not None
    of_straight = fit_mixture(found.of(z), rng).log_density(found.of(held)) - found.log_stretch
    assert np.mean(of_straight) > np.mean(fit_mixture(z, rng).log_density(held)) + 0.5


def test_draws_that_are_not_bent_get_no_bend() -> None:
    rng = np.random.default_rng(6)
    assert bend_of(rng.standard_normal((3000, 4)) @ rng.standard_normal((4, 4))) is None
    assert bend_of(rng.standard_normal((3000, 1))) is None
    assert bend_of(rng.standard_normal((15, 3))) is None
    assert bend_of(np.ones((100, 1)) * np.arange(3)) is None
    assert bend_of(np.repeat(rng.standard_normal((60, 3)), [4000] + [1] * 59, axis=0)) is None


@pytest.mark.parametrize("distinct", [60, 300])
def test_places_that_were_stood_at_many_times_are_no_bend(distinct: int) -> None:
    rng = np.random.default_rng(10)
    often = rng.choice(distinct, 4000, p=rng.dirichlet(np.full(distinct, 0.5)))
    assert bend_of(rng.standard_normal((distinct, 5))[often]) is None


def test_a_bend_goes_on_as_it_is_beyond_the_draws() -> None:
    found = bend()
    far = found.back(np.outer([2 * FARTHEST, 3 * FARTHEST], [1.0, 0.0, 0.0, 0.0, 0.0]))
    step = FARTHEST * found.root[:, 0]
    assert far[1] - far[0] == pytest.approx(step, abs=1e-9)
    assert np.all(np.isfinite(found.back(np.full((1, 5), 1e6))))
