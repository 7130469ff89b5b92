"""Work in one process and in several: results, messages, and what happens when it is stopped."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Future
from pathlib import Path
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


def waiting(place: Path, tell: Tell) -> str:
    """Says that it is at work, and what ended it."""
    (place / str(os.getpid())).touch()
    try:
        time.sleep(60)
    except KeyboardInterrupt:
        (place / f"{os.getpid()} was told").touch()
        raise
    return "never"


MAIN = """
from pathlib import Path
from tests.ground.test_jobs import waiting
from bayesmembrane.ground.interrupts import raised
from bayesmembrane.ground.jobs import workers

if __name__ == "__main__":
    with raised(), workers(count=2) as submit:
        [job.result() for job in [submit(waiting, Path({place!r})) for _ in range(4)]]
"""


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_workers_end_with_their_parent(number: int, tmp_path: Path) -> None:
    """Told to end they say so, and nothing that waits is begun; a parent that is killed leaves nobody behind."""
    script = tmp_path / "main.py"
    script.write_text(MAIN.format(place=str(tmp_path)))
    root = Path(__file__).resolve().parents[2]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    parent = subprocess.Popen([sys.executable, str(script)], env=environment, stderr=subprocess.DEVNULL)
    patience = time.monotonic() + 120
    while len(started := [int(p.name) for p in tmp_path.glob("*") if p.name.isdigit()]) < 2:
        assert time.monotonic() < patience
        time.sleep(0.05)
    os.kill(parent.pid, number)
    assert parent.wait(60) != 0
    while any(map(_alive, started)):
        assert time.monotonic() < patience, "a worker outlives its parent"
        time.sleep(0.05)
    told = len(list(tmp_path.glob("*was told")))
    assert told == (2 if number == signal.SIGTERM else 0)
    assert len([p for p in tmp_path.glob("*") if p.name.isdigit()]) == 2


def test_there_is_a_core() -> None:
    assert cores() >= 1
