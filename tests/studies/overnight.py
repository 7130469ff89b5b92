"""What a night costs beside its likelihoods, and whether it ends on time.

    python -m tests.studies.overnight [--draws 10000000] [--table docs/studies/overnight.md]

The time that checkpoints take where a likelihood costs microseconds, the memory of ten million draws, and how late a
campaign ends that has a deadline. Each measurement is a process of its own, so that the memory is its own.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from bayesmembrane.calibration.run import Run, RunSettings, load_run, predictions_of, sample
from bayesmembrane.calibration.sampling import walk
from bayesmembrane.calibration.sampling.chains import Chains
from bayesmembrane.calibration.sampling.growing import HELD
from bayesmembrane.calibration.sampling.proposals import learned
from bayesmembrane.calibration.sampling.segments import Segments
from bayesmembrane.calibration.sampling.walk import Meanwhile, Settings, begun, run_ensembles
from bayesmembrane.campaign.drive import DEADLINE, GRACE, Session, drive
from bayesmembrane.campaign.pool import LocalPool
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.report.page import write_report
from tests.calibration.test_resume import strip
from tests.campaign.doing import deaf
from tests.campaign.films import planned

ROOT = Path(__file__).resolve().parents[2]

WALKERS, ENSEMBLES = 512, 2
CLAIM = hypothesis("ogden", convexity="none")
LESSON = 8000  # steps after which the walk of ten million draws learns its proposal, from eight million of them
ENOUGH = 120.0  # s of a processor for each membrane
LASTS = 60.0  # s of the walk whose checkpoints are timed
Row = tuple[str, str]


def peak() -> str:
    """Most memory that this process has had."""
    return f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10:.0f} MiB"


# ---- checkpoints -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Standard:
    """A normal distribution of as many coordinates, in the place of a posterior."""

    size: int = 5

    def evaluate(self, x: Array) -> Any:
        return SimpleNamespace(log_posterior=-0.5 * np.sum(x * x, axis=1), outcome=np.zeros(len(x), dtype=np.int8))


def checkpoints(place: Path) -> list[Row]:
    """The time that writing segments takes of a walk whose likelihood takes next to none."""
    learned.FIRST_LESSON = 10**9  # an emulator of curves has nothing to learn here
    posterior, spent = Standard(), [0.0]
    segments = Segments(place)

    def keep(part: Chains) -> None:
        began = time.perf_counter()
        segments.write(part)
        spent[0] += time.perf_counter() - began

    start = np.random.default_rng(0).standard_normal((2, 32, posterior.size))
    began = time.perf_counter()
    settings = Settings(ess=1e9, walkers=32, chunk=10**8, most_steps=10**8)
    beside = Meanwhile(keep, lambda: time.perf_counter() - began > LASTS)
    found = run_ensembles(posterior, settings, 0, chains=begun(posterior, start, 0), beside=beside)  # type: ignore[arg-type]
    took, evaluations = time.perf_counter() - began, found.chains.evaluations
    size = sum(path.stat().st_size for path in segments.paths)
    return [
        ("a walk of", f"{took:.0f} s, 2 ensembles of 32 walkers in 5 coordinates"),
        ("evaluations", f"{evaluations}, {1e6 * took / evaluations:.0f} µs each, all that emcee does included"),
        ("checkpoints", f"{len(segments.paths)}, one every {walk.SAVE_AFTER:.0f} s; {size / 1e6:.0f} MB"),
        ("time to write and sync them", f"{spent[0]:.2f} s, {100 * spent[0] / took:.2f} % of the walk"),
    ]


# ---- memory ----------------------------------------------------------------------------------------------------------


def walked(place: Path, draws: int) -> list[Row]:
    """Sample a rubber band so often."""
    steps = -(-draws // (WALKERS * ENSEMBLES))
    run = _long(place, steps)
    count = run.status["steps"] * WALKERS * ENSEMBLES
    took = f"{count} of {len(CLAIM.names)} coordinates, in {time.process_time():.0f} s of a processor"
    return [("draws", took), ("sampling them", peak())]


def _long(place: Path, steps: int) -> Run:
    learned.FIRST_LESSON = LESSON
    settings = Settings(ess=1e9, walkers=WALKERS, chunk=100, most_steps=steps, sampler="emcee")
    return sample(strip(), CLAIM, RunSettings(0, place, "long", settings=settings))


def thinned(place: Path, _: int) -> list[Row]:
    """The whole walk, thinned by tau."""
    kept = sum(part[..., 0].size for part in load_run(place / "long").walk())
    return [("reading them thinned by tau", f"{peak()}, {kept} draws kept")]


def reported(place: Path, _: int) -> list[Row]:
    """The page about the run."""
    write_report([place / "long"], place / "page")
    return [("`report`", peak())]


def continued(place: Path, draws: int) -> list[Row]:
    """Going on for one step more, all of the walk being read for that."""
    _long(place, -(-draws // (WALKERS * ENSEMBLES)) + 1)
    return [("going on with it", peak())]


# ---- what a kill costs -----------------------------------------------------------------------------------------------

BOTH = ("prestretch", "zero_offset")
MEMBRANES: dict[str, tuple[str, str, tuple[str, ...], str, str]] = {
    "35 mm, Yeoh": ("elastosil_50um_op1", "yeoh", (), "white", "auto"),
    "35 mm, Ogden": ("elastosil_50um_op1", "ogden", (), "white", "auto"),
    "35 mm, Ogden, emcee": ("elastosil_50um_op1", "ogden", (), "white", "emcee"),
    "35 mm, Yeoh, pre-stretch, zero offset": ("elastosil_50um_op1", "yeoh", BOTH, "white", "auto"),
    "35 mm, Ogden, pre-stretch, zero offset, emcee": ("elastosil_50um_op1", "ogden", BOTH, "white", "emcee"),
    "35 mm, Yeoh, pre-stretch, form error": ("elastosil_50um_op1", "yeoh", ("prestretch",), "form", "auto"),
    "91 mm, Yeoh": ("elastosil_50um_op2", "yeoh", (), "white", "auto"),
    "91 mm, Ogden": ("elastosil_50um_op2", "ogden", (), "white", "auto"),
    "91 mm, Ogden, pre-stretch, zero offset": ("elastosil_50um_op2", "ogden", BOTH, "white", "auto"),
    "700 readings, Yeoh, Mullins": ("synthetic_cyclic", "yeoh", ("mullins",), "white", "auto"),
}


def killed(place: Path, _: int) -> list[Row]:
    """What would be lost at most of runs on real membranes and a long curve, wherever they were killed."""
    return [(name, _waits(place / "killed", *asked)) for name, asked in MEMBRANES.items()]


def _waits(place: Path, film: str, material: str, effects: tuple[str, ...], noise: str, sampler: str) -> str:
    """s of a processor until the first segment, between two of them at most, and after the last one."""
    curve = ROOT / "data" / f"{film}.csv"
    measurement = read_measurement(curve, curve.with_suffix(".toml"))
    written: list[float] = []
    write = Segments.write

    def noted(segments: Segments, part: Chains) -> None:
        write(segments, part)
        written.append(time.process_time())

    Segments.write = noted  # type: ignore[method-assign]
    claim, how = hypothesis(material, effects, noise), RunSettings(0, place, settings=Settings(sampler=sampler))
    began = time.process_time()
    try:
        run = sample(measurement, claim, how, stop=lambda: time.process_time() - began > ENOUGH)
        predictions_of(run)
    finally:
        Segments.write = write  # type: ignore[method-assign]
    over = time.process_time()
    apart = max(np.diff(written), default=0.0)
    lessons = Segments(place / run.name).read().lessons  # type: ignore[union-attr]
    told = ", ".join(map(str, lessons)) or "none"
    walk = f"{run.status['steps']} | {told} | {over - began:.0f} s"
    return f"{written[0] - began:.1f} s | {apart:.1f} s | {over - written[-1]:.1f} s | {walk}"


# ---- the deadline ----------------------------------------------------------------------------------------------------


def stubborn(place: Path, _: int) -> list[Row]:
    """Tasks that cannot be interrupted, as in one long call of compiled code: they are ended."""
    campaign, plan = planned(place / "stubborn", 4)
    then = datetime.now() + timedelta(seconds=20)
    ended = drive(campaign, plan, lambda: LocalPool(2), Session(deaf, deadline=then.strftime("%H:%M:%S")))
    late = time.time() - then.replace(microsecond=0).timestamp()
    assert ended.how == DEADLINE, ended
    return [("two tasks that hear nothing", f"{late:.1f} s")]


def sampling(place: Path, _: int) -> list[Row]:
    """Real membranes in the middle of their walks."""
    file, curve = place / "films.toml", ROOT / "data" / "elastosil_50um_op1.csv"
    then = datetime.now() + timedelta(seconds=90)
    materials = json.dumps(["ogden", "yeoh", "gent"])
    file.write_text(
        f'[measurements]\ncurves = ["{curve}"]\n[hypotheses]\nmaterials = {materials}\n[sampling]\ness = 1e6\n'
        f'most_steps = 1000000\n[stop]\ndeadline = "{then:%H:%M:%S}"\n'
    )
    words = ["campaign", "run", str(file), "--out", str(place / "films"), "--workers", "2", "--json"]
    done = subprocess.run([sys.executable, "-m", "bayesmembrane", *words], capture_output=True, text=True, check=True)
    late = time.time() - then.replace(microsecond=0).timestamp()
    answer = json.loads(done.stdout)
    assert answer["ended"] == DEADLINE, answer
    held = sum(len(Segments(path.parent).paths) > 1 for path in (place / "films").rglob("run.toml"))
    return [("two walks of membranes, of the paper's film", f"{late:.1f} s with the page; {held} of them stored")]


PARTS: dict[str, Callable[[Path, int], list[Row]]] = {
    "checkpoints": lambda place, _: checkpoints(place),
    "walked": walked,
    "thinned": thinned,
    "reported": reported,
    "continued": continued,
    "killed": killed,
    "stubborn": stubborn,
    "sampling": sampling,
}


def table(found: dict[str, list[Row]], draws: int) -> str:
    def lines(*names: str) -> str:
        return "\n".join(f"| {a} | {b} |" for name in names for a, b in found[name])

    return f"""# Overnight: checkpoints, memory, deadline

`make study-overnight` (`python -m tests.studies.overnight --draws {draws}`).

## Checkpoints

A normal density stands in for a likelihood of microseconds, so that next to nothing but the sampler itself is there to
be compared with.

| | |
|---|---|
{lines("checkpoints")}

## Memory

A rubber band of Ogden's energy, {ENSEMBLES} ensembles of {WALKERS} walkers, which learn their proposal after
{LESSON} steps; peak of a process of its own.

| | |
|---|---|
{lines("walked", "thinned", "reported", "continued")}

Whoever reads holds one segment at a time. The process that samples keeps a walk of more than {HELD / 2**20:.0f} MiB,
8 bytes for each coordinate of each draw and ln p, in a file without a name where temporary files lie (`TMPDIR`), and
holds one coordinate of one ensemble while it judges it; where there is no room for the file, it holds all. The usual
limit of 20 000 steps ends a walk of seven coordinates at 1.3 million draws.

## What a kill costs

Runs on both curves of the paper's film, and on a synthetic cyclic one, in s of a processor, stopped after
{ENOUGH:.0f} s if not over: until the first segment (the search for starts and for a mixture), between two segments
(steps, and lessons, in which none is written), and after the last one (what follows from the walk, and predictions).
The largest of the three is what a kill can cost where the processor is not shared.

| | until the first segment | between two, at most | after the last | steps | lessons after | all of it |
|---|---|---|---|---|---|---|
{lines("killed")}

## The deadline

Two workers; how long after it `campaign` was over. What stores nothing within {GRACE:.0f} s is ended.

| | |
|---|---|
{lines("stubborn", "sampling")}
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--draws", type=int, default=10_000_000)
    parser.add_argument("--table", type=Path)
    parser.add_argument("--part", nargs=2, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.part:
        print(json.dumps(PARTS[given.part[0]](Path(given.part[1]), given.draws)))
        return
    found: dict[str, list[Row]] = {}
    with tempfile.TemporaryDirectory(prefix="long-") as place:
        for name in PARTS:
            command = [sys.executable, "-m", "tests.studies.overnight", "--draws", str(given.draws)]
            done = subprocess.run([*command, "--part", name, place], stdout=subprocess.PIPE, text=True, check=True)
            found[name] = json.loads(done.stdout.splitlines()[-1])
            print(found[name], flush=True)
    text = table(found, given.draws)
    print(text)
    if given.table:
        given.table.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
