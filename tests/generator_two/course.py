"""How the disc is driven: straight ways and rests, each read a number of times."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True, eq=False)
class Course:
    """What was read where; arrays (N,): time s, at m, way +1 up, -1 down and 0 at rest, speed m/s (0 at rest).

    turns : numbers of the readings at which a way ends
    """

    name: str
    time: Any
    at: Any
    way: Any
    speed: Any
    turns: tuple[int, ...]

    @property
    def largest(self) -> float:
        """m"""
        return float(np.max(self.at))

    @property
    def steps(self) -> Any:
        """(N,) m from the reading before."""
        return np.diff(self.at, prepend=0.0)

    @property
    def gaps(self) -> Any:
        """(N,) s from the reading before."""
        return np.diff(self.time, prepend=self.time[0])


@dataclass(frozen=True)
class Way:
    """To a deflection (m) at a speed (m/s), then a rest (s)."""

    to: float
    speed: float
    rest: float = 0.0


def course(name: str, ways: list[Way], readings: int, rng: np.random.Generator) -> Course:
    """So many readings, given to the ways and rests by the square root of what they last; their clock jitters."""
    lasting: list[tuple[float, float, float]] = []  # s, from, to
    last = 0.0
    for way in ways:
        lasting.append((abs(way.to - last) / way.speed, last, way.to))
        if way.rest > 0:
            lasting.append((way.rest, way.to, way.to))
        last = way.to
    share = np.sqrt([s for s, _, _ in lasting])
    counts = np.maximum(14, np.round(readings * share / share.sum())).astype(int)
    time, at, direction, speed, turns, begun = [np.zeros(1)], [np.zeros(1)], [np.ones(1)], [np.zeros(1)], [], 0.0
    for (seconds, start, end), count in zip(lasting, counts, strict=True):
        part = (np.arange(1, count + 1) + np.append(rng.uniform(-0.2, 0.2, count - 1), 0.0)) / count
        time.append(begun + seconds * part)
        at.append(start + (end - start) * part)
        direction.append(np.full(count, np.sign(end - start)))
        speed.append(np.full(count, abs(end - start) / seconds))
        begun += seconds
        turns.append(sum(map(len, at)) - 1)
    return Course(name, *(np.concatenate(x) for x in (time, at, direction, speed)), tuple(turns))


ONE_WAY = ("ramp_and_hold",)


def drawn(top: float, faults: Collection[str], readings: int, rng: np.random.Generator) -> Course:
    """A course up to ``top`` (m) on which the faults can show.

    Triangles of unequal height in any order, a ramp with a rest and the way back, stairs with a rest on every step
    (and down again), and triangles at two speeds.
    """
    kinds = ["triangles", "ramp_and_hold", "stairs", "two_speeds"]
    if "rate" in faults:
        kinds = ["two_speeds"]
    elif {"mullins", "tearing", "permanent_set", "clamp_slip", "hysteresis"} & set(faults):
        kinds.remove("ramp_and_hold")
    kind = str(rng.choice(kinds))
    v = float(np.exp(rng.uniform(np.log(2e-4), np.log(2e-3))))
    rest = float(np.exp(rng.uniform(np.log(15.0), np.log(200.0))))
    if kind == "triangles":
        heights = rng.uniform(0.3, 1.0, int(rng.integers(3, 7)))
        heights[rng.integers(heights.size)] = 1.0
        valleys = rng.uniform(0.0, 0.15, heights.size) * (rng.random() < 0.5)
        ways = [w for h, low in zip(heights, valleys, strict=True) for w in (Way(top * h, v), Way(top * low, v))]
    elif kind == "ramp_and_hold":
        ways = [Way(top, 3 * v, 2 * rest), Way(0.0, 3 * v, rest), Way(top, 3 * v)]
    elif kind == "stairs":
        steps = np.linspace(0, 1, int(rng.integers(4, 7)))[1:]
        ways = [Way(top * float(x), v, rest / 3) for x in (*steps, *steps[-2::-1], 0.0)]
    else:
        h, quick = float(rng.uniform(0.5, 0.9)), float(rng.uniform(4.0, 15.0))
        ways = [w for s in (v, quick * v) for x in (1.0, h, 1.0) for w in (Way(top * x, s), Way(0.0, s))]
    return course(kind, ways, readings, rng)
