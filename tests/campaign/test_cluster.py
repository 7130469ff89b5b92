"""A Dask cluster does what the local pool does, with the same answers, also when one of its workers is killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from bayesmembrane.campaign.cluster import DaskCluster
from bayesmembrane.campaign.drive import Session, drive
from bayesmembrane.campaign.plan import write_plan
from bayesmembrane.campaign.pool import LocalPool
from bayesmembrane.campaign.record import DONE, read_now, read_records
from bayesmembrane.ground.errors import SettingsError
from tests.campaign.doing import faulty, quick, slow
from tests.campaign.films import planned

ROOT = Path(__file__).resolve().parents[2]

# What distributed says of itself while a cluster goes down around it is no business of these tests.
pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The file of a scheduler that runs as a process of its own, with two workers."""
    folder = tmp_path_factory.mktemp("cluster")
    file = folder / "scheduler.json"
    common = {"cwd": folder, "env": {**os.environ, "PYTHONPATH": str(ROOT)}, "stderr": subprocess.DEVNULL}
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--scheduler-file", str(file)]
    processes = [subprocess.Popen([*command, "--port", "0", "--no-dashboard"], **common)]  # type: ignore[call-overload]
    try:
        wait_for(file.exists)
        for _ in range(2):
            command = [sys.executable, "-m", "distributed.cli.dask_worker", "--scheduler-file", str(file)]
            options = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(folder)]
            processes.append(subprocess.Popen([*command, *options], **common))  # type: ignore[call-overload]
        cluster = DaskCluster(str(file))
        wait_for(lambda: cluster.workers() == 2)
        cluster.close()
        yield file
    finally:
        for process in reversed(processes):
            process.kill()
            process.wait(timeout=60)


def wait_for(what: Callable[[], bool], seconds: float = 300.0) -> None:
    latest = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < latest, "it never came"
        time.sleep(0.02)


def answers(campaign: Path) -> dict[str, str]:
    return {key: json.dumps(dict(r.found)) for key, r in read_records(campaign).items()}


def test_faults_are_told_as_by_the_local_pool(tmp_path: Path, scheduler: Path) -> None:
    here, plan = planned(tmp_path / "here", 3)
    drive(here, plan, lambda: LocalPool(1), Session(faulty))
    there = tmp_path / "there"
    write_plan(there, plan)
    drive(there, plan, lambda: DaskCluster(str(scheduler)), Session(faulty))
    told = [{k: (r.state, r.reason, r.attempts) for k, r in read_records(c).items()} for c in (here, there)]
    assert told[0] == told[1]


def test_a_worker_that_is_killed_loses_nothing(tmp_path: Path, scheduler: Path) -> None:
    """Last, for it leaves one worker. The steps of its task are gone on with, and nothing is done twice."""
    calm, plan = planned(tmp_path / "calm", 4)
    drive(calm, plan, lambda: LocalPool(1), Session(quick))
    shot, killed = tmp_path / "shot", []
    write_plan(shot, plan)

    def kill(_: object) -> None:
        now = read_now(shot)
        steps = {key: shot / "films" / f"{key}.steps" for key in now}
        far = [key for key, path in steps.items() if path.exists() and int(path.read_text()) > 10]
        if not killed and far:
            killed.append(far[0])
            os.kill(int(now[far[0]]["worker"].rpartition(":")[2]), signal.SIGKILL)

    ended = drive(shot, plan, lambda: DaskCluster(str(scheduler)), Session(slow, show=kill))
    assert len(killed) == 1
    assert ended.states == {DONE: 4}
    assert answers(shot) == answers(calm)
    assert {p.read_text() for p in (shot / "films").glob("*.ends")} == {"x"}
    assert max(r.attempts for r in read_records(shot).values()) == 1, "the dead worker wrote no record"


def test_a_cluster_that_is_not_there_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bayesmembrane.campaign.cluster.PATIENCE", 0.5)
    with pytest.raises(SettingsError, match="no Dask scheduler answers"):
        DaskCluster("tcp://127.0.0.1:1")


def test_a_missing_package_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(SettingsError, match="cluster"):
        DaskCluster("tcp://127.0.0.1:1")
