"""Vector arithmetic against NumPy, lane by lane."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from bayesmembrane.physics.mechanics.ritz.simd import LANES, greatest, least, load, load_all, splat, store, where

OPTIONS = {"error_model": "numpy", "fastmath": {"contract", "arcp"}}


def vectorised(function):
    """``function`` of one vector, applied to an array of any length."""

    @numba.njit(**OPTIONS)
    def rows(x, out):
        for i in range(x.shape[0]):
            store(out, i, function(load(x, i)))

    def apply(x):
        padded = np.ones((-(-x.size // LANES), LANES))
        padded.ravel()[: x.size] = x
        out = np.empty_like(padded)
        rows(padded, out)
        return out.ravel()[: x.size]

    return apply


def ulps(a, b):
    """Largest distance in units of the last place."""
    finite = np.isfinite(b)
    np.testing.assert_array_equal(a[~finite], b[~finite])
    return np.max(np.abs(a[finite] - b[finite]) / np.spacing(np.abs(b[finite])))


rng = np.random.default_rng(7)
SPECIAL = np.array(
    [0.0, -0.0, np.inf, -np.inf, np.nan, -1.0, 5e-324, 2e-310, 1e308, 709.7, 709.8, -745.1, -745.2, 1e3, -1e3]
)
EXPONENTS = [rng.uniform(-745, 709.7, 50_000), rng.uniform(-1, 1, 50_000), 1e-5 * rng.normal(size=10_000), SPECIAL]
ARGUMENTS = [
    np.exp(rng.uniform(-700, 700, 50_000)),
    rng.uniform(0.5, 2, 50_000),
    1 + 1e-6 * rng.normal(size=10_000),
    10.0 ** rng.uniform(-323, -307, 1_000),
    SPECIAL,
]


def test_exp_is_that_of_numpy_within_two_units_of_the_last_place():
    exp = vectorised(np.exp)
    for x in EXPONENTS:
        with np.errstate(all="ignore"):
            assert ulps(exp(x), np.exp(x)) <= 2


def test_log_is_that_of_numpy_within_two_units_of_the_last_place():
    log = vectorised(np.log)
    for x in ARGUMENTS:
        with np.errstate(all="ignore"):
            assert ulps(log(x), np.log(x)) <= 2


@pytest.mark.parametrize("function", [np.sqrt, abs])
def test_functions_are_those_of_numpy(function):
    x = np.array([0.0, 2.0, np.inf, 1e-300, 3.5])
    np.testing.assert_array_equal(vectorised(function)(x), function(x))


def test_arithmetic_mixes_vectors_floats_and_integers():
    @numba.njit(**OPTIONS)
    def formula(x):
        y = 2 * x - 1.0 + x / 4
        y += x
        y *= 0.5
        y -= 1
        y /= x
        return -y * splat(3.0)

    x = rng.uniform(0.1, 3, 40)
    assert vectorised(formula)(x) == pytest.approx(-3 * (0.5 * (3.25 * x - 1) - 1) / x, rel=1e-14)


def test_new_nans_stay_visible_in_least_and_greatest():
    @numba.njit
    def low(x):
        return least(x, 2.0)

    @numba.njit
    def high(x):
        return greatest(x, 2.0)

    x = np.array([1.0, 3.0, np.nan, np.inf, -np.inf])
    np.testing.assert_array_equal(vectorised(low)(x), [1, 2, np.nan, 2, -np.inf])
    np.testing.assert_array_equal(vectorised(high)(x), [2, 3, np.nan, np.inf, 2])


def test_where_chooses_lane_by_lane_and_drops_the_other_nan():
    @numba.njit
    def chosen(x):
        return where(x, 1.0 / x, 7.0)

    np.testing.assert_array_equal(vectorised(chosen)(np.array([0.0, 2.0, np.nan])), [7, 0.5, np.nan])


def test_load_all_reads_as_many_rows_as_the_template_is_long():
    @numba.njit
    def total(rows, out):
        a, b, c = load_all(rows, (0.0, 0.0, 0.0))
        store(out, 0, a + 10.0 * b + 100.0 * c)

    rows, out = rng.normal(size=(3, LANES)), np.empty((1, LANES))
    total(rows, out)
    assert out[0] == pytest.approx(rows[0] + 10 * rows[1] + 100 * rows[2])
