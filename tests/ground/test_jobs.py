"""Work in one process and in several: results, messages, and what happens when it is stopped."""

from __future__ import annotations

import time
from concurrent.futures import Future
from typing import Any

import pytest

from bayesmembrane.ground.jobs import Tell, cores, workers


def doubled(number: int, tell: Tell) -> int:
    tell(f"job {number}", "working")
    return 2 * number


def slow(number: int, tell: Tell) -> int:
    tell(f"job {number}", "working")
    time.sleep(0.5)
    return number


@pytest.mark.parametrize("count", [1, 2])
def test_results_come_back_and_messages_arrive(count: int) -> None:
    told: list[tuple[str, Any]] = []
    with workers(lambda label, message: told.append((label, message)), count) as submit:
        jobs = [submit(doubled, n) for n in range(3)]
        assert [job.result() for job in jobs] == [0, 2, 4]
        patience = time.monotonic() + 30
        while len(told) < 3 and time.monotonic() < patience:
            time.sleep(0.05)
    assert sorted(told) == [(f"job {n}", "working") for n in range(3)]


def test_an_interruption_passes_on_and_what_has_not_begun_never_does() -> None:
    jobs: list[Future[int]] = []

    def interrupted() -> None:
        with workers(count=2) as submit:
            jobs.extend(submit(slow, n) for n in range(20))
            jobs[0].result()
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert all(job.done() for job in jobs)
    assert jobs[0].result() == 0
    assert jobs[-1].cancelled()


def test_there_is_a_core() -> None:
    assert cores() >= 1
