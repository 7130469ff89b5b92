"""Eigenvalues are found where the quick algorithm gives up, and draws have the covariance that was asked for."""

import numpy as np
import pytest

from bayesmembrane.ground import symmetric
from bayesmembrane.ground.symmetric import eigh, normal_draws


def gives_up(_: np.ndarray) -> None:
    raise np.linalg.LinAlgError("Eigenvalues did not converge")


def some(count: int, size: int = 5) -> np.ndarray:
    a = np.random.default_rng(3).standard_normal((count, size, size))
    return a @ a.transpose(0, 2, 1)


@pytest.mark.parametrize("shape", [(5, 5), (4, 5, 5), (2, 2, 5, 5)])
def test_where_the_quick_algorithm_gives_up_the_other_one_finds_the_same(
    shape: tuple[int, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    a = some(4).reshape((-1, 5, 5))[: int(np.prod(shape[:-2]))].reshape(shape)
    expected, _ = eigh(a)
    monkeypatch.setattr(symmetric.np.linalg, "eigh", gives_up)
    values, vectors = eigh(a)
    assert values == pytest.approx(expected, rel=1e-10)
    rebuilt = (vectors * values[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    np.testing.assert_allclose(rebuilt, a, atol=1e-12 * np.max(a))


def test_what_is_no_number_has_no_eigenvalues() -> None:
    with pytest.raises(np.linalg.LinAlgError):
        eigh(np.full((3, 3), np.nan))


def test_draws_have_the_covariance_also_where_that_is_singular() -> None:
    root = np.random.default_rng(5).standard_normal((4, 2))
    draws = normal_draws(root @ root.T, 3, np.random.default_rng(1))
    # What lies outside of the two directions is nothing, and within them the draws are standard normal.
    inside = np.linalg.lstsq(root, draws.T, rcond=None)[0]
    np.testing.assert_allclose(root @ inside, draws.T, atol=1e-7)
    many = normal_draws(root @ root.T, 40_000, np.random.default_rng(2))
    np.testing.assert_allclose(np.cov(many.T), root @ root.T, atol=0.06 * np.max(root @ root.T))
