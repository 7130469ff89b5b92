"""A Dask cluster does what the local pool does, with the same answers, also when one of its workers is killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from bayesmembrane.app.tasks import perform
from bayesmembrane.calibration.run import load_run
from bayesmembrane.campaign.cluster import DaskCluster
from bayesmembrane.campaign.drive import Session, drive
from bayesmembrane.campaign.plan import write_plan
from bayesmembrane.campaign.pool import LocalPool
from bayesmembrane.campaign.record import DONE, read_now, read_records
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.jobs import silent
from tests.campaign.doing import faulty, quick, slow
from tests.campaign.films import planned
from tests.studies.kill import same

ROOT = Path(__file__).resolve().parents[2]

# What distributed says of itself while a cluster goes down around it is no business of these tests.
pytestmark = pytest.mark.filterwarnings("ignore")


@dataclass
class Cluster:
    """A scheduler and its workers, as processes of their own."""

    folder: Path
    processes: list[subprocess.Popen[bytes]] = field(default_factory=list)

    @property
    def file(self) -> Path:
        """Of the scheduler."""
        return self.folder / "scheduler.json"

    def begin(self, part: str, *options: str) -> None:
        command = [sys.executable, "-m", f"distributed.cli.dask_{part}", "--scheduler-file", str(self.file), *options]
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        quiet = subprocess.DEVNULL
        self.processes.append(subprocess.Popen(command, cwd=self.folder, env=environment, stderr=quiet))

    def with_two_workers(self) -> Path:
        """The file of the scheduler, once it has two workers."""
        cluster = DaskCluster(str(self.file))
        for _ in range(cluster.workers(), 2):
            self.begin(
                "worker", "--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(self.folder)
            )
        wait_for(lambda: cluster.workers() == 2)
        cluster.close()
        return self.file


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    found = Cluster(tmp_path_factory.mktemp("cluster"))
    try:
        found.begin("scheduler", "--port", "0", "--no-dashboard")
        wait_for(found.file.exists)
        yield found
    finally:
        for process in reversed(found.processes):
            process.kill()
            process.wait(timeout=60)


@pytest.fixture
def scheduler(cluster: Cluster) -> Path:
    """The file of a scheduler that has two workers."""
    return cluster.with_two_workers()


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
    """The steps of its task are gone on with, and nothing is done twice."""
    calm, plan = planned(tmp_path / "calm", 4)
    drive(calm, plan, lambda: LocalPool(1), Session(quick))
    shot, killed = tmp_path / "shot", list[str]()
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


def test_real_runs_are_those_of_one_process_also_when_a_worker_is_killed(tmp_path: Path, scheduler: Path) -> None:
    lines = "ess = 1e6\nwalkers = 16\nchunk = 40\nmost_steps = 150"
    calm, plan = planned(tmp_path / "calm", sampling=lines, films=("a",))
    for task in plan.tasks:
        perform(task, calm, silent)
    shot, killed = tmp_path / "shot", list[str]()
    write_plan(shot, plan)

    def kill(_: object) -> None:
        if now := {} if killed else read_now(shot):
            killed.append(min(now))
            os.kill(int(now[killed[0]]["worker"].rpartition(":")[2]), signal.SIGKILL)

    ended = drive(shot, plan, lambda: DaskCluster(str(scheduler)), Session(perform, show=kill))
    assert len(killed) == 1
    assert ended.states == {DONE: len(plan.tasks)}, [r.reason + r.trace for r in read_records(shot).values()]
    runs = {path.parent.relative_to(calm): path.parent for path in calm.glob("films/*/*/status.json")}
    assert len(runs) == len(plan.tasks) == 2
    for place, run in runs.items():
        assert same(load_run(run), load_run(shot / place)), place


def test_a_cluster_that_is_not_there_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bayesmembrane.campaign.cluster.PATIENCE", 0.5)
    with pytest.raises(SettingsError, match="no Dask scheduler answers"):
        DaskCluster("tcp://127.0.0.1:1")


def test_a_missing_package_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(SettingsError, match="cluster"):
        DaskCluster("tcp://127.0.0.1:1")
