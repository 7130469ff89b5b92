"""Ten thousand tiny runs: what a campaign costs beside the work itself.

    python -m tests.studies.scale [--count 10000] [--cluster] [--table docs/studies/scale.md]

Each run draws and records, and does nothing else, so that the time of a run is that of handing it out, locking,
recording (whole and synced), taking back and indexing. `status` and `report` are timed as processes of their own, as
users start them.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bayesmembrane.campaign.cluster import DaskCluster
from bayesmembrane.campaign.drive import Session, drive
from bayesmembrane.campaign.index import INDEX, rebuild
from bayesmembrane.campaign.plan import PLAN, read_plan
from bayesmembrane.campaign.pool import Executor, LocalPool
from bayesmembrane.ground.jobs import cores
from tests.campaign.doing import quick
from tests.campaign.films import planned

COUNT = 10_000
WORKERS = 2
Row = tuple[str, str]


def megabytes(size: float) -> str:
    return f"{size / 1e6:.1f} MB"


@dataclass(frozen=True)
class Spent:
    """Time by the clock, and of a processor alone, s."""

    clock: float
    processor: float

    def __str__(self) -> str:
        return f"{self.clock:.2f} s ({self.processor:.2f} s)"


def clocked(work: Callable[[], Any], who: int = resource.RUSAGE_SELF) -> tuple[Spent, Any]:
    """What ``work`` took this process, or those that it starts."""
    before, began = resource.getrusage(who), time.perf_counter()
    result = work()
    clock, after = time.perf_counter() - began, resource.getrusage(who)
    return Spent(clock, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime), result


def peak() -> float:
    """Bytes that this process had in memory at most."""
    return 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def typed(*words: object) -> tuple[Spent, str]:
    """What a command takes, the quickest of three, and its stdout."""
    command = [sys.executable, "-m", "bayesmembrane", "campaign", *map(str, words), "--json"]

    def once() -> str:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout

    return min((clocked(once, resource.RUSAGE_CHILDREN) for _ in range(3)), key=lambda found: found[0].clock)


def measured(folder: Path, count: int, begin: Callable[[], Executor]) -> list[Row]:
    """What one campaign of ``count`` runs costs."""
    campaign, plan = planned(folder, count)
    empty = campaign.parent / "empty"
    before = peak()
    spent, ended = clocked(lambda: drive(campaign, plan, begin, Session(quick)))
    assert ended.states == {"done": count}, ended.states
    after = peak()
    rebuilding, _ = clocked(lambda: rebuild(campaign, read_plan(campaign)))
    status, told = typed("status", campaign)
    assert json.loads(told)["tasks"]["done"] == count
    report, told = typed("report", campaign, "--out", empty)
    page = Path(json.loads(told)["report"])
    records = sum(entry.stat().st_size for entry in os.scandir(campaign / "records"))
    return [
        ("runs", f"{count}"),
        ("all of them", f"{spent.clock:.1f} s"),
        ("a run, on each worker", f"{1e3 * spent.clock * WORKERS / count:.1f} ms"),
        ("a run, processor of the client", f"{1e3 * spent.processor / count:.2f} ms"),
        ("memory of the client, at most", megabytes(after)),
        ("of that, more than before the first run", megabytes(after - before)),
        ("plan", megabytes((campaign / PLAN).stat().st_size)),
        ("index", megabytes((campaign / INDEX).stat().st_size)),
        ("records", megabytes(records)),
        ("index made again from plan and records", str(rebuilding)),
        ("`campaign status`", str(status)),
        ("`campaign report`", str(report)),
        ("its page", megabytes(page.stat().st_size)),
    ]


def on_cluster(folder: Path, count: int) -> list[Row]:
    """The same on a scheduler and workers that are processes of this machine."""
    file = folder / "scheduler.json"
    dask = [sys.executable, "-m", "distributed.cli"]
    words = ["--scheduler-file", str(file), "--no-dashboard"]
    scheduler = [f"{dask[2]}.dask_scheduler", *words, "--port", "0"]
    worker = [f"{dask[2]}.dask_worker", *words, "--nthreads", "1", "--no-nanny", "--local-directory", str(folder)]
    processes = []
    try:
        for command in (scheduler, *[worker] * WORKERS):
            processes.append(subprocess.Popen([*dask[:2], *command], stderr=subprocess.DEVNULL))
            while not file.exists():
                time.sleep(0.1)
        return measured(folder, count, lambda: DaskCluster(str(file)))
    finally:
        for process in reversed(processes):
            process.kill()
            process.wait()


def table(local: list[Row], cluster: list[Row]) -> str:
    lines = ["| | local pool | Dask |", "|---|---|---|"]
    return "\n".join([*lines, *(f"| {a} | {x} | {y} |" for (a, x), (_, y) in zip(local, cluster, strict=True))])


WORDS = """# Scale: ten thousand tiny runs

Made by `make study-scale`. A run here draws a hundred numbers and says what a posterior would; everything else is the
campaign itself: handing a run out, locking it, writing its record whole and synced, taking it back, noting it in the
index. Two workers, {machine}; `status` and `report` are processes of their own, the
quickest of three; in parentheses the time of a processor alone, which does not hang on what else the machine does.

{table}

"A run, on each worker" is how long a worker is busy or waiting for each run, its start and end among it; a real run
takes seconds to minutes. The page has a row for each of them. Memory before the first run is that of the
program with its plan.
"""


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=COUNT)
    parser.add_argument("--table", type=Path)
    parser.add_argument("--only", choices=["local", "cluster"], help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.only:
        with tempfile.TemporaryDirectory(prefix="scale-") as name:
            local = asked.only == "local"
            pool = measured(Path(name), asked.count, lambda: LocalPool(WORKERS)) if local else None
            print(json.dumps(pool or on_cluster(Path(name), asked.count)))
        return
    found = []
    for where in ("local", "cluster"):  # each in a process of its own, so that the memory is its own
        command = [sys.executable, "-m", "tests.studies.scale", "--count", str(asked.count), "--only", where]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
        found.append([tuple(row) for row in json.loads(done.stdout.splitlines()[-1])])
    machine = f"{cores()} core{'s' if cores() > 1 else ''} shared with other work, Python {platform.python_version()}"
    text = WORDS.format(machine=machine, table=table(*found))
    print(text)
    if asked.table:
        asked.table.write_text(text)


if __name__ == "__main__":
    main()
