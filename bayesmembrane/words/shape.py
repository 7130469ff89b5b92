"""The shape of a residual in words: where it is, on which legs and cycles, and whether it repeats."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bayesmembrane.data.fixture import Fixture
from bayesmembrane.diagnosis.detection.periodicity import Periodicity
from bayesmembrane.diagnosis.left.shape import ResidualShape
from bayesmembrane.diagnosis.thresholds import WORDS

PARTS = ("lower", "middle", "upper")


def shape_in_words(
    shape: ResidualShape, waves: Periodicity | None, rig: Fixture, shown: Mapping[str, tuple[float, str]]
) -> str:
    """Sentences on a residual against deflection, leg, cycle and time, in the units ``shown`` of the rig."""
    factor, unit = shown["N"]
    words = [
        f"The residual has a root mean square of {factor * shape.rms:.3g} {unit} and reaches "
        f"{factor * shape.largest:.3g} {unit} at {rig.place(shape.worst_deflection)}."
    ]
    worst = int(np.argmax(shape.thirds))
    least = min((s for s in shape.thirds if s > 0), default=np.inf)
    if shape.thirds[worst] > WORDS.uneven * least:
        words.append(f"It is largest in the {PARTS[worst]} third of the deflections.")
    words += _legs(shape, factor, unit)
    sizes = [size for _, size in shape.cycles]
    if len(sizes) > 1 and max(sizes) > WORDS.uneven * np.median(sizes):
        words.append(f"Cycle {shape.cycles[int(np.argmax(sizes))][0]} has most of it.")
    if abs(shape.trend) > WORDS.trend:
        words.append(f"It {'rises' if shape.trend > 0 else 'falls'} with time.")
    if waves is not None and waves.p_value < WORDS.periodic:
        words.append(
            f"It repeats every {_period(shape, waves, shown)}, as a drive, a gear or a vibration would make it."
        )
    if shape.plateau is not None:
        side = "largest" if shape.plateau.largest else "smallest"
        words.append(
            f"{shape.plateau.readings} readings equal the {side} force, {shape.plateau.force:.4g} N: the load cell may "
            "be at its limit."
        )
    return " ".join(words)


def _legs(shape: ResidualShape, factor: float, unit: str) -> list[str]:
    """How loading and unloading differ."""
    a, b = shape.loading, shape.unloading
    if a is None or b is None:
        return []
    words = []
    if max(a, b) > WORDS.uneven * min(a, b):
        words.append(f"It is larger on {'loading' if a > b else 'unloading'} legs.")
    if abs(shape.gap) > shape.rms:
        side = "above" if shape.gap > 0 else "below"
        words.append(f"Loading legs lie {factor * abs(shape.gap):.3g} {unit} {side} unloading legs.")
    return words


def _period(shape: ResidualShape, waves: Periodicity, shown: Mapping[str, tuple[float, str]]) -> str:
    if waves.against == "deflection":
        length, name = shown["m"]
        return f"{length * waves.period:.3g} {name}"
    return f"{waves.period:.3g} " + ("s" if shape.timed else "points")
