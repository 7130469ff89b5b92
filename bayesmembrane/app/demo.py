"""Everything on the data that ship: reconstruct, calibrate and compare five materials, follow valleys, close loops."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from pathlib import Path
from queue import Empty
from threading import Thread
from typing import Any

import numpy as np
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bars

from bayesmembrane.app.terminal import lines, log
from bayesmembrane.calibration.beside_paper import Compared, compare_with_paper, paper_break_points
from bayesmembrane.calibration.fit import fit
from bayesmembrane.calibration.predictions import Wanted
from bayesmembrane.calibration.run import load_run, predictions_of, sample
from bayesmembrane.calibration.sampling.walk import Progress
from bayesmembrane.comparison.compare import Range, compare_ranges
from bayesmembrane.comparison.jobs import Judging
from bayesmembrane.comparison.result import Comparison
from bayesmembrane.data.measurement import Measurement, read_measurement
from bayesmembrane.data.published import read_published_table
from bayesmembrane.data.shipped import shipped
from bayesmembrane.diagnosis.loop import Loop, LoopSettings, loop
from bayesmembrane.ground.jobs import Tell, silent
from bayesmembrane.ground.registry import materials
from bayesmembrane.physics.cache import CachedSolver, Tally
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.reconstruction.reconstruct import reconstruct
from bayesmembrane.reconstruction.result import Reconstruction
from bayesmembrane.report.page import write_report
from bayesmembrane.valleys.follow import Valleys, valleys_of
from bayesmembrane.words.loop import sentence
from bayesmembrane.words.reconstruction import document as reconstruction_document

RANGES = ("OP1", "OP2")
# The slowest first, two materials at a time: the others fill the gaps, and no solver is compiled twice.
ORDER = tuple(
    [("ogden", "OP1"), ("yeoh", "OP1"), ("ogden", "OP2"), ("yeoh", "OP2")]
    + [(name, range_name) for name in ("mooney_rivlin", "gent", "neo_hookean") for range_name in RANGES]
)
VALLEYS = ("yeoh", "mooney_rivlin", "gent")
# What the loop is closed on: the paper's curve over both of its ranges, and a cyclic curve with something hidden in it.
LOOPS = (("yeoh", "elastosil_50um_first_loading"), ("yeoh", "elastosil_50um_op1"), ("yeoh", "synthetic_cyclic"))
LOOP_ESS = 400.0
FINISHED = "finished"
TITLE = "What the published force curve of a 50 um silicone film says about five materials"


@dataclass(frozen=True)
class Done:
    """One material on one range: its run folder, our optimum beside the paper's, what the cache did."""

    run: Path
    compared: tuple[Compared, ...]
    tally: Tally


def shipped_measurement(range_name: str) -> Measurement:
    """The reconstructed curve of one range of the paper; the film was tested to the end of the longer one."""
    both = [_read(name) for name in RANGES]
    chosen = both[RANGES.index(range_name)]
    return replace(chosen, full_range=max(float(m.deflection.max()) for m in both))


def _read(range_name: str) -> Measurement:
    stem = f"elastosil_50um_{range_name.lower()}"
    return read_measurement(shipped(f"{stem}.csv"), shipped(f"{stem}.toml"))


def calibrate(
    name: str, range_name: str, chains: Path, seed: int, ess: float, tell: Callable[[Progress | None], None]
) -> Done:
    """Fit and sample one material on one range, stored under ``chains``."""
    cache, claim, measurement = CachedSolver(chains / "curves"), hypothesis(name), shipped_measurement(range_name)
    published = [row.values for row in read_published_table().rows if row.material == name]
    tell(None)
    found = fit(measurement, claim, seed=seed, starts=published)
    stem = f"elastosil_50um_{range_name.lower()}_{name}"
    options: dict[str, Any] = {"seed": seed, "out": chains, "name": stem, "ess": ess, "progress": tell, "solve": cache}
    run = sample(measurement, claim, predictions=False, **options)
    if run.interrupted or run.path is None:
        raise KeyboardInterrupt
    whole = shipped_measurement(RANGES[-1])
    beyond = whole.deflection > measurement.deflection.max()
    last = not np.any(beyond)
    wanted = Wanted(breaks=paper_break_points()) if last else Wanted(rest=whole.select(beyond))
    predictions_of(run, wanted, cache)
    return Done(run.path, compare_with_paper(measurement, [found], range_name, solve=cache), cache.tally)


def demo(out: Path, chains: Path, seed: int = 0, ess: float = 1000.0) -> dict[str, Any]:
    """Run it all on the cores there are, show progress on stderr, and write the report to ``out``.

    Returns the JSON answer: where the report lies, the runs, and the seconds it took. Runs of an earlier demo with the
    same data, settings and code are read back. Raises `StorageError` if a folder cannot be written.
    """
    began = time.perf_counter()
    done: dict[tuple[str, str], Done] = {}
    with _workers() as (pool, queue), _progress(queue):
        jobs = {pool.submit(_in_worker, *case, chains, seed, ess, queue): case for case in ORDER}
        other = pool.submit(_reconstruct_in_worker, seed, queue)
        for job in as_completed(jobs):
            done[jobs[job]] = job.result()
        found: Reconstruction = other.result()
        closing = [pool.submit(_loop_in_worker, *case, chains, seed, min(ess, LOOP_ESS), queue) for case in LOOPS]
        following = [
            pool.submit(_valleys_in_worker, name, [done[name, r].run for r in RANGES], seed, queue) for name in VALLEYS
        ]
        loops: list[Loop] = [job.result() for job in closing]
        valleys: list[Valleys] = [job.result() for job in following]
    with lines() as tell:
        comparison = compare(chains, seed, ess, tell)
    ordered = [done[name, range_name] for name in materials() for range_name in RANGES if (name, range_name) in done]
    compared = [c for d in ordered for c in d.compared]
    shown = [*(d.run for d in ordered), found, *compared, _sum([d.tally for d in ordered]), *valleys, comparison]
    page = write_report([*shown, read_published_table(), *loops], out, TITLE)
    return {
        "report": str(page),
        "verdicts": [{"verdict": c.rounds[0].diagnosis.verdict, "sentence": sentence(c)} for c in loops],
        "runs": [str(d.run) for d in ordered],
        "suspect_rows": reconstruction_document(found)["suspect_rows"],
        "seconds": time.perf_counter() - began,
    }


def compare(chains: Path, seed: int = 0, ess: float = 1000.0, progress: Tell = silent) -> dict[str, Comparison]:
    """The five materials on each range of the paper, from runs of the demo where there are any.

    Raises `StorageError` if ``chains`` cannot be written; Ctrl-C stores what is finished.
    """
    claims = [hypothesis(name) for name in materials()]
    ranges = {name: shipped_ranges()[name] for name in RANGES}
    return compare_ranges(ranges, claims, Judging(seed, ess, out=chains), progress=progress)


def shipped_ranges() -> dict[str, Range]:
    """Both ranges of the paper, and all their points together; of the shorter one the rest is to be predicted."""
    short, long, both = shipped_measurement("OP1"), shipped_measurement("OP2"), _read("first_loading")
    # Of both, the points of the shorter range and those beyond it: their joint covariance says what follows.
    end = float(short.deflection.max())
    used = np.isclose(both.deflection[:, None], short.deflection, rtol=1e-9).any(axis=1)
    return {
        "OP1": Range(short, both.select(used | (both.deflection > end * (1 + 1e-9)))),
        "OP2": Range(long),
        "OP1 and OP2": Range(both),
    }


@contextmanager
def _workers() -> Iterator[tuple[ProcessPoolExecutor, Any]]:
    """Fresh processes, one for each core, and a queue on which they tell how far they are."""
    context = multiprocessing.get_context("spawn")
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    with context.Manager() as manager, ProcessPoolExecutor(cores, mp_context=context) as pool:
        try:
            yield pool, manager.Queue()
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise


def _in_worker(name: str, range_name: str, chains: Path, seed: int, ess: float, queue: Any) -> Done:
    label = f"{name}, {range_name}"
    return calibrate(name, range_name, chains, seed, ess, lambda progress: queue.put((label, progress)))


def _loop_in_worker(name: str, stem: str, chains: Path, seed: int, ess: float, queue: Any) -> Loop:
    queue.put((f"loop, {stem}", None))
    measurement = read_measurement(shipped(f"{stem}.csv"), shipped(f"{stem}.toml"))
    found = loop(measurement, hypothesis(name), LoopSettings(seed, chains, ess, adapt_noise=True))
    queue.put((f"loop, {stem}", FINISHED))
    return found


def _valleys_in_worker(name: str, runs: list[Path], seed: int, queue: Any) -> Valleys:
    queue.put((f"valleys, {name}", None))
    draws = [load_run(run).draws() for run in runs]
    found = valleys_of([shipped_measurement(r) for r in RANGES], hypothesis(name), seed=seed, draws=draws)
    queue.put((f"valleys, {name}", FINISHED))
    return found


def _reconstruct_in_worker(seed: int, queue: Any) -> Reconstruction:
    queue.put(("reconstruct", None))
    return reconstruct(seed=seed)


@contextmanager
def _progress(queue: Any) -> Iterator[None]:
    """A line per job: what it does and, while it samples, ESS and the time left."""
    columns = (
        TextColumn("{task.description:<22}"),
        BarColumn(),
        TextColumn("{task.fields[text]}"),
        TimeElapsedColumn(),
    )
    with Bars(*columns, console=log) as bars:
        stop: list[bool] = []
        thread = Thread(target=_listen, args=(queue, bars, stop), daemon=True)
        thread.start()
        try:
            yield
        finally:
            stop.append(True)
            thread.join(timeout=2)


def _listen(queue: Any, bars: Bars, stop: list[bool]) -> None:
    tasks: dict[str, Any] = {}
    while not stop:
        try:
            label, progress = queue.get(timeout=0.2)
        except Empty:
            continue
        except (EOFError, OSError):
            return
        if label not in tasks:
            tasks[label] = bars.add_task(label, total=1.0, text="fitting" if "," in label else "")
        if progress == FINISHED:
            bars.update(tasks[label], completed=1.0, text="done")
        elif progress is not None:
            bars.update(tasks[label], completed=share(progress), text=told(progress))


def share(progress: Progress) -> float:
    """How much of a run is done, from 0 to 1: the worse of ESS and time."""
    left = progress.seconds_left
    if progress.steps_per_second > 0 and left == left:
        spent = progress.steps / progress.steps_per_second
        return float(spent / (spent + left)) if spent + left > 0 else 1.0
    return float(min(progress.ess / progress.wanted, 1.0))


def told(progress: Progress) -> str:
    """ESS and time left in words."""
    left = progress.seconds_left
    rest = f", {left:.0f} s left" if left == left else ""
    return f"ESS {progress.ess:.0f} of {progress.wanted:.0f}, R-hat {progress.r_hat:.3f}{rest}"


def _sum(tallies: list[Tally]) -> Tally:
    return Tally(**{f.name: sum(getattr(t, f.name) for t in tallies) for f in fields(Tally)})
