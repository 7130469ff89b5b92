"""Which hypothesis the data support, by how much, and whether two estimators and prediction say the same."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from queue import Empty
from threading import Thread
from typing import Any

import numpy as np

from bayesmembrane.comparison.jobs import Job, Tell, judge
from bayesmembrane.comparison.result import Comparison, Row, ranked
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.physics.hypothesis import Hypothesis, hypothesis

# By what their films cost: the slow ones first, so that the others fill the gaps of the second core.
SLOW = ("ogden", "yeoh", "mooney_rivlin", "gent", "neo_hookean")


@dataclass(frozen=True)
class Range:
    """The measurement that hypotheses are fitted to, and the whole one if the rest is to be predicted."""

    measurement: Measurement
    whole: Measurement | None = None


def claimed(materials: str, effects: str, noise: str, convexity: str) -> tuple[Hypothesis, ...]:
    """The hypotheses "yeoh,gent+prestretch" with the ``effects`` "a,b" beside each of them.

    Raises `SettingsError` for a name that nobody declared.
    """
    found = []
    for name in (m.strip() for m in materials.split(",") if m.strip()):
        material, *own = (part.strip() for part in name.split("+"))
        common = [e.strip() for e in effects.split(",") if e.strip()]
        found.append(hypothesis(material, dict.fromkeys([*own, *common]), noise, convexity))
    return tuple(found)


def ranges_of(whole: Measurement, ends: Sequence[float]) -> dict[str, Range]:
    """The measurement up to each of ``ends`` (m), all of it without any; by names such as "up to 35.1 mm".

    Raises `SettingsError` for an end that leaves fewer than two points.
    """
    found = {}
    for end in ends or [float(np.max(whole.deflection))]:
        part = whole.up_to(end)
        rest = whole if len(part) < len(whole) else None
        found[f"up to {1e3 * float(np.max(part.deflection)):.4g} mm"] = Range(part, rest)
    return found


Key = tuple[str, str]  # name of a range, label of a hypothesis


def compare(
    measurement: Measurement,
    hypotheses: Sequence[Hypothesis],
    seed: int = 0,
    *,
    out: str | Path | None = "chains",
    ess: float = 1000.0,
    whole: Measurement | None = None,
    modes: bool = True,
    workers: int | None = None,
    progress: Tell | None = None,
) -> Comparison:
    """ln Z of every hypothesis by nested and bridge sampling, with prior sensitivity and prediction beside it.

    Parameters
    ----------
    out : folder of the runs; what is stored there with the same data, settings and code is used again. None: no storage
    ess : effective sample size of the posterior draws
    whole : the measurement that this one is the first part of; the rest is then predicted
    modes : also the evidence under every convexity mode
    workers : processes, None: one for each core; 1 stays in this one
    progress : is told (label of a hypothesis, what is being done)

    A hypothesis that cannot be fitted has a row that says why. Where the two estimators differ by two to four joint
    standard errors, which chance alone does to one hypothesis in twenty, nested sampling is repeated with another seed
    and both are averaged. Ctrl-C stores what there is and raises KeyboardInterrupt; the same call goes on from there.
    Raises `SettingsError` for no hypothesis or the same one twice, `StorageError` if ``out`` cannot be written. Scripts
    that use more than one process need the usual ``if __name__ == "__main__"``.
    """
    ranges = {"": Range(measurement, whole)}
    found = compare_ranges(ranges, hypotheses, seed, out=out, ess=ess, modes=modes, workers=workers, progress=progress)
    return found[""]


def compare_ranges(
    ranges: Mapping[str, Range],
    hypotheses: Sequence[Hypothesis],
    seed: int = 0,
    *,
    out: str | Path | None = "chains",
    ess: float = 1000.0,
    modes: bool = True,
    workers: int | None = None,
    progress: Tell | None = None,
) -> dict[str, Comparison]:
    """`compare` on several measurements, by name, in one queue of jobs."""
    labels = _labels(hypotheses)
    folder = None if out is None else Path(out)
    jobs: dict[Key, Job] = {
        (name, label): Job(
            ", ".join(n for n in (label, name) if n), r.measurement, h, seed, ess, folder, r.whole, modes
        )
        for name, r in ranges.items()
        for label, h in zip(labels, hypotheses, strict=True)
    }
    with _workers(_cores() if workers is None else workers, len(jobs), progress or _silent) as submit:
        rows = _rows(jobs, submit)
    return {name: ranked([rows[name, label] for label in labels]) for name in ranges}


def _labels(hypotheses: Sequence[Hypothesis]) -> list[str]:
    """Material and effects; noise and convexity where that does not tell two of them apart."""
    short = [h.label() for h in hypotheses]
    full = [f"{h.label()} ({h.noise.name}, {h.convexity})" for h in hypotheses]
    labels = [s if short.count(s) == 1 else f for s, f in zip(short, full, strict=True)]
    twice = {n for n in labels if labels.count(n) > 1}
    if not labels or twice:
        fault = f'"{min(twice)}" is there twice' if twice else "there is no hypothesis to compare"
        raise SettingsError(fault, remedy="name each material once" if twice else "name some materials")
    return labels


# ---- on the cores there are ------------------------------------------------------------------------------------------

Submit = Callable[[Callable[[Job, Tell], Any], Job], "Future[Any]"]


def _rows(jobs: Mapping[Key, Job], submit: Submit) -> dict[Key, Row]:
    """Every job judged, wherever a core is free; its row is called as the hypothesis is."""
    order = sorted(jobs, key=lambda k: _place(jobs[k].hypothesis))
    waiting = {submit(judge, jobs[key]): key for key in order}
    done = {waiting[future]: future.result() for future in as_completed(waiting)}
    return {key: replace(done[key], label=key[1]) for key in jobs}


@contextmanager
def _workers(count: int, jobs: int, tell: Tell) -> Iterator[Submit]:
    """Something that takes work: fresh processes, or this one."""
    if count == 1:
        yield lambda work, job: _at_once(work, job, tell)
        return
    with _pool(min(count, jobs), tell) as (pool, queue):
        yield lambda work, job: pool.submit(_in_worker, work, job, queue)


def _at_once(work: Callable[[Job, Tell], Any], job: Job, tell: Tell) -> Future[Any]:
    done: Future[Any] = Future()
    done.set_result(work(job, tell))
    return done


def _place(hypothesis: Hypothesis) -> int:
    """Where a hypothesis stands in the queue: what is not known to be fast comes first."""
    return SLOW.index(hypothesis.material.name) if hypothesis.material.name in SLOW else -1


def _in_worker(work: Callable[[Job, Tell], Any], job: Job, queue: Any) -> Any:
    return work(job, lambda label, text: queue.put((label, text)))


@contextmanager
def _pool(workers: int, tell: Tell) -> Iterator[tuple[ProcessPoolExecutor, Any]]:
    """Fresh processes, and a queue on which they tell how far they are."""
    context = multiprocessing.get_context("spawn")
    with context.Manager() as manager, ProcessPoolExecutor(workers, mp_context=context) as pool:
        queue, stop = manager.Queue(), list[bool]()
        listener = Thread(target=_listen, args=(queue, tell, stop), daemon=True)
        listener.start()
        try:
            yield pool, queue
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise
        finally:
            stop.append(True)
            listener.join(timeout=2)


def _listen(queue: Any, tell: Tell, stop: list[bool]) -> None:
    while not stop:
        try:
            tell(*queue.get(timeout=0.2))
        except Empty:
            continue
        except (EOFError, OSError):
            return


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _silent(label: str, text: str) -> None:
    """Tells nobody."""
