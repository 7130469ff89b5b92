"""Convexity: the sharp answer against brute force and closed forms, the quick one against the sharp one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.registry import materials
from bayesmembrane.physics.materials.gent import Gent
from bayesmembrane.physics.materials.mooney_rivlin import MooneyRivlin
from bayesmembrane.physics.materials.neo_hookean import NeoHookean
from bayesmembrane.physics.materials.ogden import Ogden
from bayesmembrane.physics.materials.yeoh import Yeoh
from bayesmembrane.physics.mechanics.convexity import (
    box_convexity,
    box_ellipticity,
    box_margins,
    least_eigenvalue,
    reached_convexity,
    reached_ellipticity,
)
from bayesmembrane.physics.mechanics.solution import Curves, Status

BOX = (1.0, 8.0)
every_material = pytest.mark.parametrize("material", materials().values(), ids=materials().keys())


def prior_draws(material, n, seed):
    rng = np.random.default_rng(seed)
    return material.from_coordinates(np.stack([c.prior.draw(rng, n) for c in material.coordinates])).T


def brute(film, low, high, n=240):
    """Least eigenvalue and least diagonal of the Hessian on a dense grid, from differences of the tensions."""
    x = np.linspace(low, high, n)
    l1, l2 = np.meshgrid(x, x)
    h = 1e-5

    def slope(i, d1, d2):
        up, down = film.tension(l1 + d1, l2 + d2)[i], film.tension(l1 - d1, l2 - d2)[i]
        return (up - down) / (2 * h)

    rows = np.array([[slope(0, h, 0), slope(0, 0, h)], [slope(1, h, 0), slope(1, 0, h)]])
    matrix = np.moveaxis(rows, (0, 1), (-2, -1))
    # Differences fail beside the limit of extensibility, where the eigenvalues are large anyway.
    k = l1**2 + l2**2 + (l1 * l2) ** -2 - 3
    exists = k < 0.98 * film.extensibility(film.vector)
    gd = film.shear_modulus(film.vector)
    least = np.linalg.eigvalsh(matrix[exists])[:, 0].min() / gd
    return least, min(matrix[exists][:, 0, 0].min(), matrix[exists][:, 1, 1].min()) / gd


@every_material
@pytest.mark.parametrize("box", [(1.0, 4.0), (0.7, 3.0)])
def test_sharp_answer_is_the_least_of_a_dense_numerical_hessian(material, box):
    for p in prior_draws(material, 6, seed=5):
        film = material.from_vector(p)
        dense, diagonal = brute(film, *box)
        sharp, elliptic = box_convexity(film, *box), box_ellipticity(film, *box)
        for answer, reference in ((sharp, dense), (elliptic, diagonal)):
            tolerance = 1e-2 * abs(reference) + 1e-4
            assert answer.margin == pytest.approx(reference, abs=tolerance)
            assert answer.margin <= reference + 1e-5 * (1 + abs(reference)), "the grid cannot be below the least value"
        assert (sharp.convex, elliptic.elliptic) == (sharp.margin >= 0, elliptic.margin > 0)


@every_material
def test_margin_is_the_value_at_the_worst_point(material):
    for p in prior_draws(material, 5, seed=6):
        film = material.from_vector(p)
        answer = box_convexity(film, *BOX)
        value = np.linalg.eigvalsh(film.hessian(*answer.worst))[0] / film.shear_modulus(film.vector)
        size = np.abs(film.hessian(*answer.worst)).max() / film.shear_modulus(film.vector)
        assert answer.margin == pytest.approx(value, rel=1e-9, abs=1e-12 * size)
        assert BOX[1] >= answer.worst[0] >= answer.worst[1] >= BOX[0]
        elliptic = box_ellipticity(film, *BOX)
        diagonal = np.diag(film.hessian(*elliptic.worst)).min() / film.shear_modulus(film.vector)
        assert elliptic.margin == pytest.approx(diagonal, rel=1e-12)
        assert elliptic.margin >= answer.margin - 1e-9 * size, "a diagonal entry is never below the least eigenvalue"


@pytest.mark.parametrize(("low", "high"), [(1.0, 8.0), (0.1, 10.0), (0.5, 1.5), (3.0, 4.0)])
def test_neo_hooke_is_convex_for_all_stretches(low, high):
    # H / (2 c1) = I + a positive semidefinite matrix; at l1 = l2 = l its least eigenvalue is 1 + l^-6.
    answer = box_convexity(NeoHookean(7.5), low, high)
    assert answer.convex
    assert answer.margin == pytest.approx(1 + high**-6, rel=1e-9)


@pytest.mark.parametrize(("c1", "c2", "high"), [(0.14, 0.01, 8.0), (1.0, 0.3, 5.0), (1.0, 3.0, 3.0), (5.0, 1.0, 10.0)])
def test_mooney_rivlin_with_positive_constants_fails_first_in_equibiaxial_stretch(c1, c2, high):
    # At l1 = l2 = l the antisymmetric eigenvalue is H11 - H12 = 2 c1 (1 + l^-6) + 2 c2 (3 l^-4 - l^2).
    corner = (c1 * (1 + high**-6) + c2 * (3 * high**-4 - high**2)) / (c1 + c2)
    assert corner < 0
    answer = box_convexity(MooneyRivlin(c1, c2), 1.0, high)
    assert not answer.convex
    assert answer.margin == pytest.approx(corner, rel=1e-9)
    assert answer.worst == pytest.approx((high, high))
    # Each diagonal entry is a sum of positive terms, so the energy is elliptic all the same.
    assert box_ellipticity(MooneyRivlin(c1, c2), 1.0, high).elliptic


def test_mooney_rivlin_turns_where_the_closed_form_says():
    c1, c2 = 7.0, 0.5
    x = np.linspace(2, 5, 300001)
    limit = x[np.argmax(c1 * (1 + x**-6) + c2 * (3 * x**-4 - x**2) < 0)]
    assert box_convexity(MooneyRivlin(c1, c2), 1.0, limit - 1e-4).convex
    assert not box_convexity(MooneyRivlin(c1, c2), 1.0, limit + 1e-4).convex


@pytest.mark.parametrize("jm", [1e-4, 0.1, 1.0, 17.42, 50.0, 500.0])
@pytest.mark.parametrize(("low", "high"), [(1.0, 8.0), (0.2, 8.0), (0.9, 1.1)])
def test_gent_is_convex_on_its_domain(jm, low, high):
    # -ln(1 - K / Jm) is convex and increasing in K, and K is convex.
    film = Gent(7.5, jm)
    answer = box_convexity(film, low, high)
    assert answer.convex
    assert answer.margin > 1.0
    assert np.isfinite(film.energy(*answer.worst))
    assert box_margins(Gent, [[7.5, jm]], low, high)[0] == pytest.approx(answer.margin, rel=0.02)


def test_a_box_where_the_material_does_not_exist_is_an_error():
    with pytest.raises(SettingsError, match="no state of the box"):
        box_convexity(Gent(7.5, 10.0), 3.0, 8.0)
    assert np.isnan(box_margins(Gent, [[7.5, 10.0]], 3.0, 8.0)[0])
    edge = 2 * 3.0**2 + 3.0**-4 - 3
    assert box_convexity(Gent(7.5, edge * 1.0001), 3.0, 8.0).worst == pytest.approx((3.0, 3.0), abs=1e-3)


@pytest.mark.parametrize("box", [(8.0, 1.0), (0.0, 2.0), (1.0, 1.0), (1.0, np.inf), (np.nan, 2.0)])
def test_a_box_must_be_one(box):
    for question in (
        lambda: box_convexity(NeoHookean(1.0), *box),
        lambda: box_ellipticity(NeoHookean(1.0), *box),
        lambda: box_margins(NeoHookean, [[1.0]], *box),
    ):
        with pytest.raises(SettingsError, match="box"):
            question()


def test_parameters_of_the_wrong_shape_are_refused():
    with pytest.raises(SettingsError, match="shape"):
        box_margins(Yeoh, [[1.0, 2.0]], *BOX)


def test_convexity_does_not_depend_on_the_modulus():
    for film in (MooneyRivlin(6.2, 1.47), Yeoh(8.8, -0.63, 0.056), Ogden(11.06, 0.196, -0.368, 1.52, 5.8, -1.15)):
        stiffer = type(film).from_vector(film.vector * np.where(np.array(film.scales) == 1, 1e4, 1.0))
        assert box_convexity(stiffer, *BOX).margin == pytest.approx(box_convexity(film, *BOX).margin, rel=1e-6)


@pytest.mark.parametrize("ratio", [-0.3, -0.05, -0.0073, -0.004])
def test_violations_narrower_than_any_grid_are_found(ratio):
    # At l1 = l2 = l the symmetric eigenvalue is W'(K) (2 + 10 l^-6) + 2 W''(K) K1^2, with K1 = 2 l - 2 l^-5. Its least
    # value over l is set to -1e-7 by bisection on c3: it is negative over a few thousandths of l only.
    def least(c3):
        def symmetric(x):
            k = 2 * x**2 + x**-4.0 - 3
            return (1 + k * (2 * ratio + 3 * c3 * k)) * (2 + 10 * x**-6.0) + 2 * (2 * ratio + 6 * c3 * k) * (
                2 * x - 2 * x**-5.0
            ) ** 2

        x = np.linspace(*BOX, 20001)
        start = np.clip(np.argmin(symmetric(x)), 1, x.size - 2)
        found = minimize_scalar(symmetric, bounds=(x[start - 1], x[start + 1]), options={"xatol": 1e-10})
        return found.fun, np.mean(symmetric(x) < 0)

    c3 = brentq(lambda c: least(c)[0] + 1e-7, 0.01 * ratio**2, 2.0 * ratio**2, xtol=1e-18, rtol=1e-14)
    value, share = least(c3)
    assert share < 1e-3
    answer = box_convexity(Yeoh(1.0, ratio, c3), *BOX)
    assert answer.margin <= 0.5 * value + 1e-10
    assert not answer.convex
    assert box_margins(Yeoh, [[1.0, ratio, c3]], *BOX)[0] < 0


@every_material
@pytest.mark.parametrize("box", [(1.0, 8.0), (0.6, 4.0)])
def test_quick_answer_agrees_with_the_sharp_one_on_prior_draws(material, box):
    agree(material, prior_draws(material, 20, seed=7), box)


@pytest.mark.study
@every_material
@pytest.mark.parametrize("box", [(1.0, 8.0), (0.6, 4.0), (0.9, 3.0)])
def test_quick_answer_agrees_with_the_sharp_one_on_thousands_of_prior_draws(material, box):
    agree(material, prior_draws(material, 3000, seed=8), box)


@pytest.mark.parametrize("material", [MooneyRivlin, Yeoh, Ogden])
@pytest.mark.parametrize("box", [(1.0, 8.0), (0.7, 5.0)])
def test_quick_answer_agrees_with_the_sharp_one_at_the_border_of_convexity(material, box):
    inside, outside = border(material, 12, box)
    agree(material, np.concatenate([inside, outside]), box)


def agree(material, p, box):
    quick = box_margins(material, p, *box)
    sharp = np.array([box_convexity(material.from_vector(q), *box).margin for q in p])
    decided = np.abs(sharp) > 1e-9
    np.testing.assert_array_equal((quick >= 0)[decided], (sharp >= 0)[decided])
    convex = sharp >= 0
    np.testing.assert_array_less(sharp[convex] * (1 - 1e-6) - 1e-9, quick[convex])
    np.testing.assert_allclose(quick[convex], sharp[convex], rtol=0.4, atol=1e-6)


def border(material, n, box):
    """Pairs of films, on both sides of the border of convexity and 1e-7 apart, by bisection between prior draws."""
    p = prior_draws(material, 1500, seed=9)
    x = material.to_coordinates(p.T).T
    x[:, 0] = 0.0
    margin = box_margins(material, p, *box)
    inside, outside = x[margin >= 0][:n], x[margin < 0][:n]
    n = min(len(inside), len(outside))
    inside, outside = inside[:n].copy(), outside[:n].copy()
    for _ in range(24):
        middle = 0.5 * (inside + outside)
        convex = box_margins(material, material.from_coordinates(middle.T).T, *box) >= 0
        inside[convex], outside[~convex] = middle[convex], middle[~convex]
    return material.from_coordinates(inside.T).T, material.from_coordinates(outside.T).T


def test_least_eigenvalue_keeps_its_digits_beside_a_large_one():
    assert least_eigenvalue(1e16, 0.1, 1.0) == pytest.approx(1.0, rel=1e-12)
    assert least_eigenvalue(-3.0, 0.0, -4.0) == -4.0
    assert least_eigenvalue(1.0, 2.0, 1.0) == pytest.approx(-1.0)


def curves(convexity, ellipticity, status):
    convexity, ellipticity = np.asarray(convexity, dtype=float), np.asarray(ellipticity, dtype=float)
    zero = np.zeros_like(convexity)
    flag = np.asarray(status, dtype=np.int8)
    return Curves(zero, zero, flag, flag * 0, zero, None, zero, zero + 1, ellipticity, convexity, zero)


def test_reached_margins_are_the_least_over_the_deflections():
    c = curves([[0.9, 0.2, 0.5], [0.9, -0.1, 0.5]], [[1.0, 0.3, 0.6], [1.0, 0.4, 0.8]], np.zeros((2, 3)))
    np.testing.assert_array_equal(reached_convexity(c), [0.2, -0.1])
    np.testing.assert_array_equal(reached_ellipticity(c), [0.3, 0.4])


def test_deflections_without_a_state_say_nothing_unless_ellipticity_was_lost():
    nan = np.nan
    status = [
        [Status.OK, Status.LOCKED],
        [Status.OK, Status.NOT_ELLIPTIC],
        [Status.UNRESOLVED, Status.ITERATION_LIMIT],
        [Status.OK, Status.NOT_ELLIPTIC],
    ]
    value = [[0.4, nan], [0.4, nan], [nan, nan], [0.4, -0.2]]
    c = curves(value, value, status)
    np.testing.assert_array_equal(reached_convexity(c), [0.4, -np.inf, nan, -0.2])
    np.testing.assert_array_equal(reached_ellipticity(c), [0.4, -np.inf, nan, -0.2])
