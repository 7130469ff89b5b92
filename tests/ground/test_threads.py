"""Linear algebra by one thread, while the work is done and no longer."""

import os

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from bayesmembrane.diagnosis.diagnose import diagnose
from bayesmembrane.ground.threads import NAMES, one_thread


def blas() -> set[int]:
    np.linalg.inv(np.eye(2))
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


def test_work_has_one_thread_and_its_processes_too_and_nothing_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in NAMES:
        monkeypatch.delenv(name, raising=False)
    with threadpool_limits(limits=2, user_api="blas"):
        before = blas()
        inside = one_thread(lambda: (blas(), [os.environ.get(name) for name in NAMES]))()
        assert inside == ({1}, ["1"] * len(NAMES))
        assert blas() == before
    assert not set(NAMES) & set(os.environ)


def test_what_was_said_of_processes_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    assert one_thread(lambda: os.environ["OMP_NUM_THREADS"])() == "2"
    assert os.environ["OMP_NUM_THREADS"] == "2"


def test_a_diagnosis_is_made_by_one_thread() -> None:
    assert hasattr(diagnose, "__wrapped__")
