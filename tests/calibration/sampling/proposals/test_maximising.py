"""The compiled expectation maximisation against its formulas, written out."""

import numpy as np
import pytest
from scipy.stats import multivariate_t

from bayesmembrane.calibration.sampling.proposals.maximising import PULL, RIDGE, maximised


def two_heaps(k: int) -> np.ndarray:
    x = np.random.default_rng(3).standard_normal((600, k))
    x[:200] = 0.3 * x[:200] + 2.0
    return x


@pytest.mark.parametrize("degrees", [4, 10, 50])
@pytest.mark.parametrize("k", [1, 2, 5])
def test_rounds_are_those_of_the_formulas(k: int, degrees: int) -> None:
    x = two_heaps(k)
    share = np.full((2, len(x)), 0.1)
    share[0, :200] = share[1, 200:] = 0.9
    tail = np.ones_like(share)
    found = maximised(np.ascontiguousarray(x.T), share.copy(), degrees, 3, -np.inf)
    for turn in range(4):
        weights = np.mean(share, axis=1)
        v = share * tail
        means = (v @ x) / np.sum(v, axis=1)[:, None]
        spreads = [
            (x - m).T @ ((x - m) * v[j][:, None]) / np.sum(share[j]) + (RIDGE + PULL * k / np.sum(share[j])) * np.eye(k)
            for j, m in enumerate(means)
        ]
        if turn == 3:
            break
        share = np.stack(
            [w * multivariate_t(m, s, degrees).pdf(x) for w, m, s in zip(weights, means, spreads, strict=True)]
        )
        share /= np.sum(share, axis=0)
        far = [np.sum((x - m) @ np.linalg.inv(s) * (x - m), axis=1) for m, s in zip(means, spreads, strict=True)]
        tail = (degrees + k) / (degrees + np.stack(far))
    np.testing.assert_allclose(found[0], weights, rtol=1e-10)
    np.testing.assert_allclose(found[1], means, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found[2] @ np.swapaxes(found[2], 1, 2), spreads, rtol=1e-9, atol=1e-12)


def test_it_ends_where_a_round_gains_little() -> None:
    x = np.ascontiguousarray(two_heaps(2).T)
    share = np.random.default_rng(1).dirichlet([1.0, 1.0], x.shape[1]).T.copy()
    once, often = (maximised(x, share.copy(), 10, 60, enough) for enough in (1e9, 1e-9))
    first = maximised(x, share.copy(), 10, 1, -np.inf)
    for a, b in zip(once, first, strict=True):
        np.testing.assert_array_equal(a, b)
    assert np.linalg.norm(often[1] - first[1]) > 0.5
