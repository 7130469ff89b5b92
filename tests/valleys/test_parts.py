"""Pieces of the valleys on problems whose answer is known in closed form."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bayesmembrane.calibration.descent import descend
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.registry import material
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.valleys import follow
from bayesmembrane.valleys.between import arc_length, closest_approach
from bayesmembrane.valleys.next_tests import rank
from bayesmembrane.valleys.posterior import NormalPosterior
from bayesmembrane.valleys.profile import floor, pair_maps, profiles
from bayesmembrane.valleys.result import metric_of
from bayesmembrane.valleys.surface import Surface
from tests.reference.slow_solver import force_curve


class Quadratic:
    """L^2 = a^2 + |A (z - z0)|^2 in as many parameters as A has columns."""

    def __init__(self, matrix: np.ndarray, at: np.ndarray, floor_of_loss: float) -> None:
        self.matrix, self.at, self.least = matrix, at, floor_of_loss
        size = at.size
        self.chart: Any = SimpleNamespace(
            followed=(np.full(size, -100.0), np.full(size, 100.0)),
            limits=(np.full(size, -200.0), np.full(size, 200.0)),
            natural=lambda z: np.asarray(z),
            from_natural=lambda p: np.asarray(p),
        )

    def batch(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        r = (z - self.at) @ self.matrix.T
        r = np.concatenate([r, np.full((len(z), 1), self.least)], axis=1)
        j = np.vstack([self.matrix, np.zeros(self.at.size)])
        return r, np.tile(j, (len(z), 1, 1))

    loss = Surface.loss
    _rooted = Surface._rooted
    minimise = Surface.minimise


MATRIX = np.array([[3.0, 2.9, 0.4], [0.1, -0.2, 1.0], [0.3, 0.1, -0.1]])
AT = np.array([1.0, -2.0, 0.5])


@pytest.fixture
def bowl() -> Any:
    return Quadratic(MATRIX, AT, 0.3)


def test_profile_of_a_quadratic_ends_where_its_inverse_curvature_says(bowl: Any) -> None:
    found, _ = profiles(bowl, AT, 0.03)
    inverse = np.linalg.inv(MATRIX.T @ MATRIX)
    for p in found:
        half = np.sqrt(inverse[p.index, p.index] * (0.33**2 - 0.3**2))
        low, high = p.ends
        assert low.value == pytest.approx(AT[p.index] - half, rel=1e-6)
        assert high.value == pytest.approx(AT[p.index] + half, rel=1e-6)
        assert not low.open
        assert not high.open


def test_floor_of_a_quadratic_is_a_straight_line_in_the_conditional_direction(bowl: Any) -> None:
    found, _ = profiles(bowl, AT, 0.03)
    z, loss = floor(bowl, found[0], 11, AT)
    inverse = np.linalg.inv(MATRIX.T @ MATRIX)
    direction = inverse[:, 0] / inverse[0, 0]
    np.testing.assert_allclose(z, AT + (z[:, :1] - AT[0]) * direction, atol=1e-5)
    np.testing.assert_allclose(loss[[0, -1]], 0.33, rtol=1e-6)
    half = np.sqrt(inverse[0, 0] * (0.33**2 - 0.3**2))
    assert arc_length(z)[-1] == pytest.approx(2 * half * np.linalg.norm(direction), rel=1e-5)


def test_pair_map_of_a_quadratic_is_the_marginal_quadratic(bowl: Any) -> None:
    found, _ = profiles(bowl, AT, 0.03)
    inverse = np.linalg.inv(MATRIX.T @ MATRIX)
    for m in pair_maps(bowl, AT, found, 7):
        part = np.linalg.inv(inverse[np.ix_(m.pair, m.pair)])
        a, b = np.meshgrid(m.first - AT[m.pair[0]], m.second - AT[m.pair[1]], indexing="ij")
        d = np.stack([a, b], axis=-1)
        np.testing.assert_allclose(m.loss, np.sqrt(0.09 + np.einsum("abi,ij,abj->ab", d, part, d)), rtol=1e-6)


def test_a_parameter_without_influence_has_two_open_ends() -> None:
    flat = Quadratic(np.array([[1.0, 0.0], [0.5, 0.0]]), np.array([1.0, 3.0]), 0.2)
    found, _ = profiles(flat, np.array([1.0, 3.0]), 0.02)  # type: ignore[arg-type]
    assert [e.open for e in found[0].ends] == [False, False]
    assert [e.open for e in found[1].ends] == [True, True]
    assert all(e.tends for e in found[1].ends)


def test_a_loss_with_a_limit_is_open_on_that_side_only() -> None:
    class Fading(Quadratic):
        """r = e^-z - 0 beside a constant: the loss falls to its limit as z grows."""

        def batch(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            e = np.exp(-z[:, :1])
            return np.concatenate([e, np.ones_like(e)], axis=1), np.stack([-e, np.zeros_like(e)], axis=1)

    surface = Fading(np.eye(1), np.zeros(1), 1.0)
    surface.chart.followed = (np.array([-5.0]), np.array([20.0]))
    found, _ = profiles(surface, np.array([18.0]), 0.1)  # type: ignore[arg-type]
    low, high = found[0].ends
    assert not low.open
    assert low.value == pytest.approx(-0.5 * np.log(1.1**2 - 1), abs=1e-5)
    assert high.open
    assert high.tends


@pytest.mark.parametrize(
    ("first", "second", "distance"),
    [
        ([[0, 0], [1, 0]], [[0, 1], [1, 2]], 1.0),
        ([[0, 0], [2, 2]], [[0, 2], [2, 0]], 0.0),
        ([[0, 0], [1, 0], [1, 1]], [[3, 0.5]], 2.0),
        ([[0, 0, 0], [1, 0, 0]], [[0.5, -1, 2], [0.5, 1, 2]], 2.0),
    ],
)
def test_closest_approach_of_known_lines(first: Any, second: Any, distance: float) -> None:
    a, b = np.array(first, dtype=float), np.array(second, dtype=float)
    found = closest_approach(a, b, np.eye(a.shape[1]))
    assert found.distance == pytest.approx(distance, abs=1e-12)
    assert np.linalg.norm(found.first - found.second) == pytest.approx(distance, abs=1e-12)
    assert (found.crossing is not None) == (distance == 0)


def test_closest_approach_is_in_units_of_the_covariance_and_symmetric() -> None:
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(6, 3)), rng.normal(size=(5, 3)) + 4
    root = rng.normal(size=(3, 3))
    c = root @ root.T
    one, two = closest_approach(a, b, c), closest_approach(b, a, c)
    assert one.distance == pytest.approx(two.distance)
    gap = one.first - one.second
    assert one.distance == pytest.approx(np.sqrt(gap @ np.linalg.solve(c, gap)))
    assert closest_approach(a, b, 4 * c).distance == pytest.approx(one.distance / 2)


def test_equibiaxial_data_shorten_a_mooney_rivlin_valley_more_than_the_same_test_again() -> None:
    at = np.linspace(0.004, 0.035, 8)
    force = force_curve(material("mooney_rivlin")(6.0, 1.5), at, 0.010, 0.035)
    m = Measurement(at, force, Annulus(0.010, 0.035), Specimen("synthetic", 5e-5), force_sd=np.full(8, 0.005))
    surface = Surface(hypothesis("mooney_rivlin", convexity="none"), m)
    normal = NormalPosterior(surface, np.array([6.0, 1.5]))
    metric = metric_of(surface.chart)
    tests = {t.kind: t for t in rank(surface, normal, normal.spread(), lambda z: metric.scale(surface.chart, z))}
    assert tests["equibiaxial"].reduction > tests["repeat"].reduction > 0
    assert tests["equibiaxial"].reduction > tests["uniaxial"].reduction
    # Twice the data halve the variance, but for the prior.
    assert tests["repeat"].reduction == pytest.approx(1 - np.sqrt(0.5), abs=0.06)
    assert all(0 <= t.reduction < 1 for t in tests.values())


def test_what_is_held_is_not_moved(bowl: Any) -> None:
    start = np.array([[4.0, 1.0, -1.0]])
    z, _ = Surface.minimise(bowl, start, np.array([True, False, False]))
    assert z[0, 0] == 4.0
    free, _ = descend(bowl.batch, start, (np.full(3, -99.0), np.full(3, 99.0)), 50, np.array([[True, False, False]]))
    np.testing.assert_allclose(z, free, atol=1e-4)


def test_a_band_is_as_wide_where_slopes_are_missing_as_beside(monkeypatch: pytest.MonkeyPatch) -> None:
    """Films that are solved together may lack what each has alone: then nothing of the band was a number."""

    class Lossy(Quadratic):
        found = False

        def batch(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            r, j = super().batch(z)
            if self.found:
                r[-9:], j[-9:] = np.nan, np.nan
            return r, j

        def minimise(self, start: np.ndarray, held: np.ndarray) -> tuple[np.ndarray, np.ndarray]:  # type: ignore[override]
            z, size = super().minimise(start, held)  # type: ignore[arg-type]
            self.found = True
            return z, size

    monkeypatch.setattr(follow, "grid", lambda _, z: z)
    line: Any = SimpleNamespace(index=0, points=np.array([[-1.0, -2.0], [3.0, -2.0]]))
    normal: Any = SimpleNamespace(z=AT[:2], spread=lambda: SimpleNamespace(covariance=np.diag([0.1, 0.1])))
    whole, lossy = (
        np.asarray(follow._band(kind(MATRIX[:, :2], AT[:2], 0.3), line, 0.3, normal)) for kind in (Quadratic, Lossy)
    )
    assert np.all(np.isfinite(lossy))
    np.testing.assert_array_equal(lossy[:-9], whole[:-9])
    assert np.all(np.ptp(lossy[-9:, :, 1], axis=1) > 0)
