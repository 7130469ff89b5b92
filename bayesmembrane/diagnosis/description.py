"""The shape of a residual in words: where it is, on which legs and cycles, and whether it repeats."""

from __future__ import annotations

import numpy as np

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.detection import Periodicity
from bayesmembrane.ground.parameters import Array

UNEVEN = 1.5  # times the root mean square of the rest: then it is said
PERIODIC = 0.01
TREND = 0.5
PARTS = ("lower", "middle", "upper")


def describe(measurement: Measurement, residual: Array, periodicity: Periodicity | None) -> str:
    """Sentences on a residual (N,) N: against deflection, leg, cycle and time."""
    d, r = measurement.deflection, residual
    third = np.clip((3 * (d - d.min()) / max(np.ptp(d), 1e-12)).astype(int), 0, 2)
    factor, unit = measurement.rig.shown(measurement.specimen.thickness)["N"]
    words = [f"The residual has a root mean square of {factor * _rms(r):.3g} {unit} and reaches {factor * _top(r):.3g}"]
    words[0] += f" {unit} at {measurement.rig.place(float(d[int(np.argmax(np.abs(r)))]))}."
    sizes = [_rms(r[third == i]) for i in range(3)]
    worst = int(np.argmax(sizes))
    if sizes[worst] > UNEVEN * min(s for s in sizes if s > 0) if any(s > 0 for s in sizes) else False:
        words.append(f"It is largest in the {PARTS[worst]} third of the deflections.")
    up, down = r[measurement.leg > 0], r[measurement.leg < 0]
    if up.size and down.size:
        a, b = (_rms(v) for v in (up, down))
        if max(a, b) > UNEVEN * min(a, b):
            words.append(f"It is larger on {'loading' if a > b else 'unloading'} legs.")
        gap = float(np.mean(up) - np.mean(down))
        if abs(gap) > _rms(r):
            side = "above" if gap > 0 else "below"
            words.append(f"Loading legs lie {factor * abs(gap):.3g} {unit} {side} unloading legs.")
    cycles = np.unique(measurement.cycle)
    if cycles.size > 1:
        by = np.array([_rms(r[measurement.cycle == c]) for c in cycles])
        if by.max() > UNEVEN * np.median(by):
            words.append(f"Cycle {cycles[int(np.argmax(by))]} has most of it.")
    place = np.arange(r.size) if measurement.time is None else measurement.time
    if r.size > 3 and np.std(r) > 0:
        trend = float(np.corrcoef(place, r)[0, 1])
        if abs(trend) > TREND:
            words.append(f"It {'rises' if trend > 0 else 'falls'} with time.")
    if periodicity is not None and periodicity.p_value < PERIODIC:
        if periodicity.against == "deflection":
            length, name = measurement.rig.shown(measurement.specimen.thickness)["m"]
            wave = f"{length * periodicity.period:.3g} {name}"
        else:
            wave = f"{periodicity.period:.3g} " + ("points" if measurement.time is None else "s")
        words.append(f"It repeats every {wave}, as a drive, a gear or a vibration would make it.")
    words += _plateau(measurement)
    return " ".join(words)


def _plateau(measurement: Measurement) -> list[str]:
    """A sentence if many readings share the largest or the smallest value: a load cell at its limit."""
    y = measurement.force
    quantum = np.min(np.diff(np.unique(y))) if np.unique(y).size > 1 else 0.0
    for value, side in ((y.max(), "largest"), (y.min(), "smallest")):
        same = int(np.count_nonzero(np.abs(y - value) <= 0.01 * quantum))
        if same >= max(5, 0.01 * y.size) and value != 0:
            return [f"{same} readings equal the {side} force, {value:.4g} N: the load cell may be at its limit."]
    return []


def _rms(r: Array) -> float:
    return float(np.sqrt(np.mean(r**2))) if r.size else 0.0


def _top(r: Array) -> float:
    return float(np.max(np.abs(r))) if r.size else 0.0
