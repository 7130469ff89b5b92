"""Which hypothesis the data support, by how much, and whether two estimators and prediction say the same."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import as_completed
from contextlib import nullcontext
from dataclasses import dataclass, replace

import numpy as np

from bayesmembrane.comparison.jobs import AS_USUAL, Job, Judging, judge
from bayesmembrane.comparison.noises import AUTO, NOISES
from bayesmembrane.comparison.result import Comparison, Row, ranked
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.thinning import MOST, of_few
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.jobs import Submit, Tell, cores, silent, workers
from bayesmembrane.physics.hypothesis import Hypothesis, hypothesis


@dataclass(frozen=True)
class Range:
    """The measurement that hypotheses are fitted to, and the whole one if the rest is to be predicted."""

    measurement: Measurement
    whole: Measurement | None = None


def claimed(materials: str, effects: str, noise: str, convexity: str) -> tuple[Hypothesis, ...]:
    """The hypotheses "yeoh,gent+prestretch" with the ``effects`` "a,b" beside each of them.

    The ``noise`` "auto" makes one of each with every one of `NOISES`. Raises `SettingsError` for a name that nobody
    declared.
    """
    found = []
    for name in (m.strip() for m in materials.split(",") if m.strip()):
        material, *own = (part.strip() for part in name.split("+"))
        common = [e.strip() for e in effects.split(",") if e.strip()]
        effects_of = [*own, *(e for e in common if e not in own)]
        for model in NOISES if noise == AUTO else (noise,):
            found.append(hypothesis(material, effects_of, model, convexity))
    return tuple(found)


def ranges_of(whole: Measurement, ends: Sequence[float]) -> dict[str, Range]:
    """The measurement up to each of ``ends`` (m), all of it without any; by names such as "up to 35.1 mm".

    Of more than `thinning.MOST` readings so many are used: two estimators ask for each a hundred thousand times. Raises
    `SettingsError` for an end that leaves fewer than two points.
    """
    found, whole = {}, of_few(whole, MOST)
    for part in whole.ranges_up_to(ends or [float(np.max(whole.deflection))]):
        rest = whole if len(part) < len(whole) else None
        reached = float(np.max(part.deflection))
        place = whole.rig.place(reached) if whole.rig.homogeneous else f"{1e3 * reached:.4g} mm"
        name = f"up to {place}"
        if name in found:
            raise SettingsError(f'two ranges would both be called "{name}"', remedy="give ends farther apart")
        found[name] = Range(part, rest)
    return found


Key = tuple[str, str]  # name of a range, label of a hypothesis


def compare(
    measurement: Measurement,
    hypotheses: Sequence[Hypothesis],
    judging: Judging = AS_USUAL,
    *,
    whole: Measurement | None = None,
    progress: Tell = silent,
) -> Comparison:
    """ln Z of every hypothesis by nested and bridge sampling, with prior sensitivity and prediction beside it.

    Parameters
    ----------
    judging : seed, effective draws, and where runs are kept
    whole : the measurement that this one is the first part of; the rest is then predicted
    progress : is told (label of a hypothesis, what is being done)

    A hypothesis that cannot be fitted has a row that says why. Where the two estimators differ by two to four joint
    standard errors, which chance alone does to one hypothesis in twenty, nested sampling is repeated with another seed
    and both are averaged. Ctrl-C stores what there is and raises KeyboardInterrupt; the same call goes on from there.
    Raises `SettingsError` for no hypothesis or the same one twice, `StorageError` if runs cannot be written. Scripts
    that use more than one process need the usual ``if __name__ == "__main__"``.
    """
    return compare_ranges({"": Range(measurement, whole)}, hypotheses, judging, progress=progress)[""]


def compare_ranges(
    ranges: Mapping[str, Range],
    hypotheses: Sequence[Hypothesis],
    judging: Judging = AS_USUAL,
    *,
    progress: Tell = silent,
    submit: Submit | None = None,
) -> dict[str, Comparison]:
    """`compare` on several measurements, by name, in one queue of jobs: that of ``submit``, if there is one already."""
    first = next(iter(ranges.values())).measurement
    labels = _labels([h.with_frame(first) for h in hypotheses])
    jobs: dict[Key, Job] = {
        (name, label): Job(
            ", ".join(n for n in (label, name) if n), r.measurement, h.with_frame(r.measurement), judging, r.whole
        )
        for name, r in ranges.items()
        for label, h in zip(labels, hypotheses, strict=True)
    }
    own = workers(progress, min(judging.processes or cores(), len(jobs)))
    with own if submit is None else nullcontext(submit) as queue:
        rows = _judged(jobs, queue)
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


def _judged(jobs: Mapping[Key, Job], submit: Submit) -> dict[Key, Row]:
    """Every job judged, wherever a core is free; its row is called as the hypothesis is."""
    # The slow ones, with many parameters, first: the others fill the gaps of the second core.
    order = sorted(jobs, key=lambda k: -jobs[k].hypothesis.curve_size)
    waiting = {submit(judge, jobs[key]): key for key in order}
    done = {waiting[future]: future.result() for future in as_completed(waiting)}
    return {key: replace(done[key], label=key[1]) for key in jobs}
