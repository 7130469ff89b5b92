"""Runs that are killed: none is lost, none damaged, and all end with the same bits as those that were not.

python -m tests.studies.kill --kills 100 --table docs/studies/kill.md

A process that has loaded everything forks; the child samples, and is killed by SIGKILL at a random moment, or in the
middle of writing a segment, and another child goes on, until enough kills are done and the run is let finish.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from bayesmembrane.calibration.run import Run, RunSettings, load_run, sample
from bayesmembrane.calibration.sampling import walk
from bayesmembrane.calibration.sampling.segments import Segments
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground import files
from bayesmembrane.physics.cache import CachedSolver
from bayesmembrane.physics.hypothesis import Hypothesis, hypothesis
from bayesmembrane.physics.mechanics import request, solve
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.physics.rigs.uniaxial import Uniaxial

MOMENTS = ("begun", "written", "synced", "renamed")
"""Of the writing of a segment: its file is there and empty, holds all, is on the disk, has its name."""
SAVE_AFTER, USUAL = 0.05, walk.SAVE_AFTER  # s, so that there are many
MOST_KILLS = 4  # of one run
LEAPS = 150  # steps by a mixture in the time of one by emcee's ensembles, about


@dataclass(frozen=True)
class Case:
    """A run, by the name of what it samples, and its seed: by a mixture if that is odd, else by emcee's ensembles."""

    name: str
    seed: int
    walked: int

    @property
    def steps(self) -> int:
        return self.walked * LEAPS if self.seed % 2 else self.walked

    def sampled(self, out: Path) -> Run:
        measurement, claim = _question(self.name, self.seed)
        sampler = "auto" if self.seed % 2 else "emcee"
        settings = Settings(ess=1e9, walkers=8, chunk=30, most_steps=self.steps, sampler=sampler)
        how = RunSettings(self.seed, out, settings=settings, predictions=False)
        solver = CachedSolver(out / "curves") if self.name.startswith("ring") else solve
        return sample(measurement, claim, how, solve=solver)


def _question(name: str, seed: int) -> tuple[Measurement, Hypothesis]:
    rng = np.random.default_rng(seed)
    if name.startswith("ring"):
        d = np.linspace(5e-3, 40e-3, 8)
        force = solve(request(hypothesis("neo_hookean").material, [7.5], d, 0.01, 0.035)).force[0]
        force = force + 0.02 * rng.standard_normal(d.size)
        return Measurement(d, force, Annulus(0.01, 0.035), Specimen("ring", 5e-5)), hypothesis("neo_hookean")
    stretch = np.linspace(1.1, 2.5, 12)
    force = 0.3 * (stretch - stretch**-2) + 2e-3 * rng.standard_normal(12)
    _, material, noise = name.split()
    return Measurement(stretch, force, Uniaxial(), Specimen("band", 5e-4)), hypothesis(material, noise=noise)


CASES = ("band neo_hookean white", "band mooney_rivlin white", "band neo_hookean ar1", "ring neo_hookean white")


@dataclass
class Count:
    """What became of runs: kills at random moments and in the middle of a segment, and what they did."""

    runs: int = 0
    random: int = 0
    moments: dict[str, int] = field(default_factory=lambda: dict.fromkeys(MOMENTS, 0))
    in_walk: int = 0
    lost: int = 0
    damaged: int = 0
    different: int = 0
    most_seconds_lost: float = 0.0

    @property
    def kills(self) -> int:
        return self.random + sum(self.moments.values())


def _child(case: Case, out: Path, moment: str, after: int) -> int:
    """Sample in a process of its own; at the ``moment`` of writing segment number ``after`` it waits to be killed."""
    pid = os.fork()
    if pid:
        return pid
    try:
        _wait_at(moment, after)
        case.sampled(out)
    except BaseException as error:
        sys.stderr.write(f"{type(error).__name__}: {error}\n")
        os._exit(1)
    os._exit(0)


def _wait_at(moment: str, after: int) -> None:
    sync, replace, mkstemp = files._sync, Path.replace, files.tempfile.mkstemp
    seen = {name: 0 for name in MOMENTS}

    def reached(name: str, path: Path) -> None:
        if ".seg" in path.name:
            seen[name] += 1
            if name == moment and seen[name] > after:
                path.parent.with_name("waiting").touch()
                time.sleep(3600)

    def begin(**more: object) -> tuple[int, str]:
        handle, name = mkstemp(**more)  # type: ignore[call-overload]
        reached("begun", Path(name))
        return handle, name

    def synced(path: Path) -> None:
        reached("written", path)
        sync(path)
        reached("synced", path)

    def renamed(path: Path, target: Path) -> Path:
        found = replace(path, target)
        reached("renamed", target)
        return found

    if moment:
        files.tempfile.mkstemp = begin  # type: ignore[assignment]
        files._sync = synced
        Path.replace = renamed  # type: ignore[method-assign,assignment]


def _ended(pid: int, until: float, out: Path) -> bool:
    """Whether the child came to its own end before ``until``; else it is there, or waits."""
    while time.monotonic() < until:
        done, status = os.waitpid(pid, os.WNOHANG)
        if done:
            if status:
                raise SystemExit(f"a run failed with status {status}")
            return True
        if list(out.glob("*/waiting")):
            return False
        time.sleep(0.005)
    return False


def _killed(case: Case, out: Path, rng: np.random.Generator, typical: float, count: Count) -> bool:
    """One start and one kill; False if the run came to its end before."""
    inside = rng.random() < 0.4
    moment, after = (str(rng.choice(MOMENTS)), int(rng.integers(0, 6))) if inside else ("", 0)
    before = _steps(out)
    pid = _child(case, out, moment, after)
    # A run that goes on is nearer to its end than one that begins.
    ended = _ended(pid, time.monotonic() + (60.0 if inside else float(rng.uniform(0.0, 0.9 * typical))), out)
    if ended:
        return False
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    for place in out.glob("*/waiting"):
        place.unlink()
        count.moments[moment] += 1
        break
    else:
        count.random += 1
    steps = _steps(out)
    count.in_walk += 0 < steps < case.steps
    count.lost += steps < before
    newest = max((p.stat().st_mtime for p in out.glob("*/segments/*.seg")), default=None)
    if newest is not None and steps < case.steps:
        count.most_seconds_lost = max(count.most_seconds_lost, time.time() - newest)
    return True


def _steps(out: Path) -> int:
    """That can be read of the walk; raises `StorageError` if it is damaged."""
    chains = [Segments(p.parent).read() for p in out.glob("*/run.toml")]
    return max((c.steps for c in chains if c is not None), default=0)


def same(one: Run, other: Run) -> bool:
    """Whether two stored runs have the same walk, numbers and arrays, to the last bit."""
    assert one.path is not None
    assert other.path is not None
    a, b = Segments(one.path).read(), Segments(other.path).read()
    if a is None or b is None or not np.array_equal(a.x, b.x) or not np.array_equal(a.log_posterior, b.log_posterior):
        return False
    untimed = {"seconds": 0, "cache": 0}
    arrays = (
        np.array_equal(v.values, other.data[group][name].values, equal_nan=True)
        for group in one.data.groups()
        for name, v in one.data[group].data_vars.items()
    )
    return {**one.status, **untimed} == {**other.status, **untimed} and all(arrays)


def study(kills: int, steps: int, seed: int, place: Path) -> Count:
    """Runs until there were so many kills."""
    walk.SAVE_AFTER = SAVE_AFTER
    rng, count = np.random.default_rng(seed), Count()
    whole: dict[tuple[str, int], tuple[Run, float]] = {}
    while count.kills < kills:
        name, own = str(rng.choice(CASES)), int(rng.integers(2))
        case, out = Case(name, own, steps), place / f"run {count.runs}"
        if (name, own) not in whole:
            case.sampled(place / "warm" / f"{name} {own}")  # compiled and loaded, so that the next shows the time
            began = time.monotonic()
            whole[name, own] = case.sampled(place / "whole" / f"{name} {own}"), time.monotonic() - began
        reference, typical = whole[name, own]
        out.mkdir()
        for _ in range(int(rng.integers(1, MOST_KILLS + 1))):
            if count.kills >= kills or not _killed(case, out, rng, typical, count):
                break
        found = case.sampled(out)
        assert found.path is not None
        count.different += not same(load_run(found.path), reference)
        count.damaged += any(p.is_file() for p in found.path.rglob(".*"))
        count.runs += 1
    return count


def table(count: Count, steps: int, seed: int) -> str:
    """What was found, as a page."""
    rows = [
        ("runs", count.runs),
        ("SIGKILLs", count.kills),
        ("... at random moments", count.random),
        *((f"... in a segment: {name}", n) for name, n in count.moments.items()),
        ("... with a part of the walk on the disk", count.in_walk),
        ("runs lost, or shorter than before the kill", count.lost),
        ("runs with files damaged or left over", count.damaged),
        ("runs that ended with another bit than uninterrupted", count.different),
    ]
    lines = "\n".join(f"| {name} | {value} |" for name, value in rows)
    return f"""# Runs that are killed

`make study-kill` (`python -m tests.studies.kill --kills {count.kills} --steps {steps} --seed {seed}`):
bands and rings, neo-Hookean and Mooney-Rivlin, white and AR(1) noise, half of them {steps} steps of emcee's
ensembles and half {steps * LEAPS} proposed by a mixture, with {1000 * SAVE_AFTER:.0f} ms between segments instead of
{USUAL:.0f} s, so that there are many to be hit. A child is killed at a random moment, or where it writes a segment: its
file is begun, written, synced, or renamed and its folder not yet synced. Up to {MOST_KILLS} kills a run, then it is let
finish and compared: walk, generators, counts, every stored array.

| | |
|---|---|
{lines}

The newest segment was at most {count.most_seconds_lost:.1f} s old when a walk was killed (a lesson is learned between
two steps, and no segment is written meanwhile).
"""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--kills", type=int, default=110)
    parser.add_argument("--steps", type=int, default=110)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--table", type=Path)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        count = study(given.kills, given.steps, given.seed, Path(place))
    page = table(count, given.steps, given.seed)
    if given.table is not None:
        given.table.write_text(page, encoding="utf-8")
    print(page)
    return int(bool(count.lost or count.damaged or count.different))


if __name__ == "__main__":
    sys.exit(main())
