"""The inverse by columns that are orthogonal is the inverse."""

import numpy as np
import pytest

from bayesmembrane.diagnosis.candidates.gram import Gram

N = 60


def columns(apart: np.ndarray) -> np.ndarray:
    rng = np.random.default_rng(4)
    out = rng.standard_normal((N, apart.size))
    orthogonal, _ = np.linalg.qr(rng.standard_normal((N, N)))
    out[:, apart] = orthogonal[:, : np.sum(apart)] * rng.uniform(0.1, 30.0, np.sum(apart))
    return out


@pytest.mark.parametrize("where", ["none", "last", "between"])
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_inverse_and_determinant_are_those_of_the_whole(where: str, size: float) -> None:
    apart = np.zeros(20, dtype=bool)
    apart[{"none": slice(0, 0), "last": slice(8, None), "between": slice(5, 15)}[where]] = True
    b, scale = columns(apart), size * np.linspace(0.5, 2.0, 20)
    dense = np.eye(20) + scale[:, None] * (b.T @ b) * scale
    found = Gram.of(b, apart).plus_one(scale)
    assert found is not None
    np.testing.assert_allclose(found.whole @ dense, np.eye(20), atol=1e-7)
    assert found.log_det == pytest.approx(np.linalg.slogdet(dense)[1], rel=1e-9)
    v = np.linspace(-1.0, 1.0, 20)
    np.testing.assert_allclose(found.times(v), np.linalg.solve(dense, v), rtol=1e-6, atol=1e-12)


def test_round_off_leaves_no_eigenvalue_below_one() -> None:
    b = np.repeat(np.random.default_rng(1).standard_normal((N, 1)), 6, axis=1)
    found = Gram.of(b, np.zeros(6, dtype=bool)).plus_one(np.full(6, 1e12))
    assert found is not None
    value = np.linalg.eigvalsh(found.whole)
    assert np.all(value <= 1 + 1e-9)
    assert found.log_det >= 0


def test_what_doubles_do_not_hold_is_nothing() -> None:
    b = columns(np.zeros(3, dtype=bool))
    assert Gram.of(b, np.zeros(3, dtype=bool)).plus_one(np.full(3, 1e200)) is None
