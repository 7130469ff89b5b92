"""Stability limits: where work by a small change ceases to be positive, by hand and by differences."""

import numpy as np
import pytest

from bayesmembrane.ground.registry import material, materials
from bayesmembrane.physics.stability import MODES, SIDES, stability, tangent


def test_a_neo_hookean_film_is_stable_everywhere() -> None:
    found = stability(material("neo_hookean"), [[3.0], [300.0]])
    assert all(np.all(np.isnan(limit)) for limit in found.limits.values())
    assert found.share("uniaxial", "tension") == 0.0


@pytest.mark.parametrize("name", sorted(materials()))
def test_the_tangent_is_the_second_derivative_in_logarithms(name: str) -> None:
    made = material(name)
    p = np.asarray(made.typical())[None, :]
    h, (a, b) = 1e-4, np.log((1.2, 1.05))

    def energy(x: float, y: float) -> float:
        return float(made.from_vector(p[0]).energy(np.exp(x), np.exp(y)))

    d11 = (energy(a + h, b) - 2 * energy(a, b) + energy(a - h, b)) / h**2
    d22 = (energy(a, b + h) - 2 * energy(a, b) + energy(a, b - h)) / h**2
    d12 = (energy(a + h, b + h) - energy(a + h, b - h) - energy(a - h, b + h) + energy(a - h, b - h)) / (4 * h**2)
    found = tangent(made, p, np.array([[1.2]]), np.array([[1.05]]))
    np.testing.assert_allclose([v[0, 0] for v in found], [d11, d12, d22], rtol=1e-5)


def test_mooney_rivlin_with_a_negative_second_constant_has_the_limits_of_its_closed_form() -> None:
    """Equibiaxial, l1 = l2 = l: D has the eigenvectors (1, 1) and (1, -1), and both eigenvalues are closed forms."""
    c1, c2 = 1.0, -0.05
    found = stability(material("mooney_rivlin"), [[c1, c2]])

    def eigenvalues(stretch: np.ndarray) -> np.ndarray:
        square, power = stretch**2, stretch**-4
        along = 4 * c1 * square + 8 * c1 * power + c2 * (8 * stretch**4 + 4 / square)
        apart = 4 * c1 * square + c2 * 4 / square
        return np.minimum(along + 0 * apart, apart)

    for side, end in SIDES.items():
        grid = np.exp(np.linspace(0, np.log(end), 200001))
        bad = eigenvalues(grid) <= 0
        limit = found.limits["equibiaxial", side][0]
        if not np.any(bad):
            assert np.isnan(limit)
            continue
        assert limit == pytest.approx(grid[int(np.argmax(bad))], rel=1e-4)
    assert 1 < found.limits["equibiaxial", "tension"][0] < 10


def test_below_a_limit_it_is_stable_and_above_it_is_not() -> None:
    made, p = material("yeoh"), np.array([[1.0, -0.08, 0.001], [1.0, -0.2, 0.01]])
    found = stability(made, p)
    assert found.share("equibiaxial", "tension") > 0
    for (mode, side), limits in found.limits.items():
        for film, limit in zip(p, limits, strict=True):
            if np.isnan(limit):
                continue
            for factor, stable in ((0.999, True), (1.001, False)):
                stretch = np.array([[limit**factor]])
                d11, d12, d22 = tangent(made, film[None, :], stretch, MODES[mode](stretch))
                definite = (d11 + d22 > 0) & (d11 * d22 - d12**2 > 0)
                assert bool(definite[0, 0]) is stable, (mode, side)


def test_chains_that_lock_are_no_loss_of_stability() -> None:
    found = stability(material("gent"), [[1.0, 5.0]])
    assert np.isnan(found.limits["uniaxial", "tension"][0])
