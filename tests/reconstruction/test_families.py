"""Families of curves: derivatives, curves that they are made ready for, and mixtures."""

from __future__ import annotations

import numpy as np
import pytest

from bayesmembrane.data.published import PublishedTable, read_published_table
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import material
from bayesmembrane.reconstruction.families.base import CurveFamily
from bayesmembrane.reconstruction.families.displaced import SHIFT
from bayesmembrane.reconstruction.families.energy import half_normal, natural, standard
from bayesmembrane.reconstruction.mixture import LEAST, TOLD_APART, families, mixture, probabilities
from bayesmembrane.reconstruction.reconstruct import simulate_on
from bayesmembrane.reconstruction.simulations import tabulate

NAMES = (
    "smooth_logarithm",
    "smooth_logarithm_displaced",
    "smooth_force",
    "neo_hookean",
    "mooney_rivlin",
    "gent",
    "yeoh",
    "ogden",
)
X = np.linspace(1e-3, 0.0915, 12)


@pytest.fixture(scope="module")
def table() -> PublishedTable:
    return read_published_table()


@pytest.fixture(scope="module")
def film(table: PublishedTable) -> Array:
    """Forces (N,) of the Yeoh film of the whole range."""
    return simulate_on(table)("yeoh", table.rows[11].values, X)


@pytest.fixture(scope="module")
def every(table: PublishedTable, film: Array) -> dict[str, CurveFamily]:
    simulate = simulate_on(table)
    found = families(table, tabulate(table, simulate), simulate, np.array([X, film]))
    return {f.name: f for f in found}


def test_every_energy_of_the_table_is_a_family(every: dict[str, CurveFamily]) -> None:
    assert tuple(every) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_slopes_are_derivatives(every: dict[str, CurveFamily], film: Array, name: str) -> None:
    family = every[name]
    c = 0.1 * np.random.default_rng(0).standard_normal((1, family.size))
    size, step = np.array([family.middle]), 1e-5
    force, slope, rates = family.force(c, size, X[None])
    along = [family.force(c, size, X[None] + s)[0][0] for s in (1e-7, -1e-7)]
    np.testing.assert_allclose(slope[0], (along[0] - along[1]) / 2e-7, rtol=1e-3, atol=1e-3 * np.max(slope))
    for j in range(family.size):
        up, down = (family.force(c + s * step * (np.arange(family.size) == j), size, X[None])[0][0] for s in (1, -1))
        # The frame's compliance is balanced to second order; its derivative is that of the balance.
        np.testing.assert_allclose(rates[0, :, j], (up - down) / (2 * step), rtol=0.03, atol=1e-4 * np.max(film))
    assert force.shape == (1, X.size)


@pytest.mark.parametrize("name", [n for n in NAMES if n not in ("neo_hookean", "mooney_rivlin")])
def test_a_family_comes_near_a_film_of_another_energy(every: dict[str, CurveFamily], film: Array, name: str) -> None:
    family, c = every[name].placed(X, film)
    force = family.force(c[None], np.array([family.middle]), X[None])[0][0]
    assert np.max(np.abs(force - film) / (film + 0.02 * np.max(film))) < 0.1, "near enough to climb from"


def test_a_displaced_curve_is_the_curve_further_on(every: dict[str, CurveFamily]) -> None:
    inner, moved = every["smooth_logarithm"], every["smooth_logarithm_displaced"]
    c, size = np.zeros((1, moved.size)), np.array([0.14])
    c[0, -2] = -1.0
    np.testing.assert_allclose(moved.force(c, size, X[None])[0], inner.force(c[:, :-2], size, X[None] + SHIFT)[0])


def test_standard_numbers_of_a_film_and_back(table: PublishedTable) -> None:
    for row in table.rows:
        z = standard(material(row.material), np.array(row.values))
        if np.all(np.isfinite(z)):
            np.testing.assert_allclose(natural(material(row.material), z), row.values, rtol=1e-6)


def test_half_normal_keeps_probabilities() -> None:
    z = np.linspace(-4, 4, 9)
    h, slope = half_normal(z)
    assert np.all(h > 0)
    assert h[4] == pytest.approx(0.67449, abs=1e-5)
    up, down = half_normal(z + 1e-5)[0], half_normal(z - 1e-5)[0]
    np.testing.assert_allclose(slope, (up - down) / 2e-5, rtol=1e-5)


def test_moments_of_a_mixture_are_those_of_its_draws() -> None:
    rng = np.random.default_rng(4)
    means, share = rng.standard_normal((3, 2)), np.array([0.5, 0.3, 0.2])
    roots = rng.standard_normal((3, 2, 2))
    mean, covariance = mixture(means, roots @ np.swapaxes(roots, 1, 2), share)
    # Exact for draws with exact moments: each part at its mean plus and minus sqrt(2) columns of its root.
    points = np.concatenate([m + np.sqrt(2) * np.vstack([r.T, -r.T]) for m, r in zip(means, roots, strict=True)])
    weight = np.repeat(share / 4, 4)
    np.testing.assert_allclose(mean, weight @ points)
    np.testing.assert_allclose(covariance, ((points - mean).T * weight) @ (points - mean))


def test_probabilities_know_that_evidence_is_uncertain() -> None:
    np.testing.assert_allclose(probabilities([3.0] * 4), 0.25, atol=2e-3)
    first, second = probabilities([0.0, -3.0])
    assert 0.05 < second < 0.3, "more than exp(-3), less than half"
    assert first + second == pytest.approx(1.0)
    assert probabilities([0.0, -40.0])[1] < 1e-9
    assert np.all(np.diff(probabilities([0.0, -1.0, -2.0, -4.0])) < 0)


def test_a_family_that_is_not_told_from_the_best_keeps_a_part_of_the_weight() -> None:
    near, far = TOLD_APART - 0.1, TOLD_APART + 0.1
    last = probabilities([0.0, -1.0, -near, -far])
    assert last[2] > LEAST
    assert last[3] < LEAST
    assert np.sum(last) == pytest.approx(1.0)
    np.testing.assert_allclose(probabilities([0.0] * 40), 1 / 40, rtol=0.1)
