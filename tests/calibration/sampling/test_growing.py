"""Long walks lie in files: the same bits as in memory, little of it held, and without room for files as before."""

import tracemalloc
from collections import Counter
from typing import Any

import numpy as np
import pytest

from bayesmembrane.calibration.sampling import convergence as judging
from bayesmembrane.calibration.sampling import growing, walk
from bayesmembrane.calibration.sampling.chains import Chains, joined
from bayesmembrane.calibration.sampling.convergence import convergence
from bayesmembrane.calibration.sampling.growing import changed, followed, picked, stretches
from bayesmembrane.calibration.sampling.walk import Settings, run_ensembles
from tests.calibration.sampling.test_walk import Normal, start


@pytest.fixture
def _in_files(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(growing, "HELD", 0)
    monkeypatch.setattr(growing, "STRETCH", 5000)
    monkeypatch.setattr(walk, "AHEAD", 9000)


def steps(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((2, count, 4, 3))


def in_file(values: np.ndarray) -> bool:
    return not values.flags.c_contiguous and not values.flags.writeable


@pytest.mark.usefixtures("_in_files")
def test_what_follows_is_behind_what_was_there() -> None:
    a, b, c = steps(40), steps(1, 1), steps(90, 2)
    two = followed(a, b)
    three = followed(two, c)
    other = followed(two, a)  # it does not go on where another one does already
    assert in_file(three)
    assert np.array_equal(two, np.concatenate([a, b], axis=1))
    assert np.array_equal(three, np.concatenate([a, b, c], axis=1))
    assert np.array_equal(other, np.concatenate([a, b, a], axis=1))
    assert np.array_equal(changed(three, lambda part: 2 * part[..., [2, 0]]), 2 * three[..., [2, 0]])
    for at in ([0, 1, 99, 130], [], range(131)):
        some = np.array(at, dtype=int)
        assert np.array_equal(picked(three, some), three[:, some])
    for overlap in (0, 1):
        parts = list(stretches(three, overlap))
        assert len(parts) > 3
        assert np.array_equal(np.concatenate([p[:, overlap:] for p in parts], axis=1), three[:, overlap:])


@pytest.mark.usefixtures("_in_files")
def test_without_room_for_a_file_it_stays_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """At once, and after some of it was written."""
    a, b = steps(40), steps(50, 1)
    two = followed(a, b)

    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(growing._StepsFile, "take", full)
    for values in (followed(a, b), followed(two, b)):
        assert not in_file(values)
    assert np.array_equal(followed(two, b), np.concatenate([a, b, b], axis=1))


def test_a_walk_in_files_is_that_in_memory(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """Lessons, looks and an interruption among it; and what is judged of it has the same bits."""
    settings = Settings(ess=1500, chunk=100)
    whole = run_ensembles(Normal(), settings, 0, chains=start(Normal()))  # type: ignore[arg-type]
    assert not in_file(whole.chains.x)
    request.getfixturevalue("_in_files")
    broken = run_ensembles(Normal(stop_after=450), settings, 0, chains=start(Normal()))  # type: ignore[arg-type]
    filed = run_ensembles(Normal(), settings, 0, chains=broken.chains)  # type: ignore[arg-type]
    assert broken.status == "interrupted"
    assert in_file(filed.chains.x)
    assert whole.chains.lessons == filed.chains.lessons != ()
    assert np.array_equal(whole.chains.x, filed.chains.x)
    assert np.array_equal(whole.chains.log_posterior, filed.chains.log_posterior)
    for name, value in vars(whole.convergence).items():
        assert np.array_equal(value, getattr(filed.convergence, name)), name
    for a, b in zip(whole.draws(500), filed.draws(500), strict=True):
        assert np.array_equal(a, b)


def test_a_long_walk_is_neither_held_nor_doubled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither when more is joined to it nor when it is judged."""
    monkeypatch.setattr(growing, "HELD", 2**20)
    monkeypatch.setattr(judging, "R_HAT_DRAWS", 2**12)
    part = np.random.default_rng(0).standard_normal((2, 500, 16, 7))
    chains = Chains(part, part[..., 0], (), Counter(), 0.0)
    more, size = chains, 0
    tracemalloc.start()
    for _ in range(60):
        chains = joined([chains, more])
        size = chains.x.nbytes
    convergence(chains)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert size > 50 * 2**20
    assert peak < size / 2
