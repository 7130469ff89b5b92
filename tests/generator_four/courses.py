"""Where the disc is driven to and when: legs at constant or sinusoidal speed, holds, and the readings taken of them.

Levels are parts of the largest deflection, speeds and holds multiples of those of one plain stroke.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tests.generator_four.rubbers import log_between

Leg = tuple[float, float, float]
"""(level to go to, speed, hold there)"""

ONE_WAY = ("ramp", "held_ramp")
BOTH_WAYS = (
    *("there_and_back", "cycles", "two_speeds", "rising", "dwells", "staircase", "sawtooth", "fast_then_slow"),
)
STROKE = (3.0, 400.0)  # s
READINGS, A_LEG, MOST = (60, 700), 14, 700
FINE = 300  # points of a leg
RETURNED = 0.02  # of the largest deflection: less is no turn


@dataclass(frozen=True, eq=False)
class DriveCourse:
    """time : (N,) s; at : (N,) mm as the drive says; text : what kind of test it is."""

    time: Any
    at: Any
    text: str

    @property
    def largest(self) -> float:
        """m"""
        return float(1e-3 * self.at.max())

    @property
    def lasts(self) -> float:
        """s"""
        return float(self.time[-1])

    @cached_property
    def speed(self) -> Any:
        """(N,) mm/s, with its sign."""
        return np.gradient(self.at, self.time)

    @cached_property
    def returns(self) -> Any:
        """(N,) number of returns begun so far."""
        out, top, low, down = np.zeros(len(self.at)), self.at[0], self.at[0], False
        least = RETURNED * self.at.max()
        for i, x in enumerate(self.at):
            top, low = max(top, x), min(low, x)
            if not down and x < top - least:
                down, low = True, x
                out[i:] += 1
            elif down and x > low + least:
                down, top = False, x
        return out


def draw_course(rng: np.random.Generator, kind: str, peak: float) -> DriveCourse:
    """A course to ``peak`` mm."""
    legs, stroke, smooth = _legs(rng, kind), log_between(rng, *STROKE), rng.uniform() < 0.25
    time, at = _driven(legs, stroke, smooth)
    count = int(np.clip(log_between(rng, *READINGS), A_LEG * len(legs), MOST))
    uneven = rng.uniform() < 0.3
    part = _sampled(rng, count, uneven)
    way = np.concatenate([[0], np.cumsum(abs(np.diff(at)))])
    share = rng.uniform(0.3, 1.0)  # of readings that are taken at equal times; others at equal ways
    clock = share * time / time[-1] + (1 - share) * way / way[-1]
    taken = np.interp(part, clock, time)
    text = f"{kind}, {len(legs)} legs, {count} readings{', sinusoidal' if smooth else ''}{', uneven' if uneven else ''}"
    return DriveCourse(np.round(taken, 6), np.round(peak * np.interp(taken, time, at), 6), text)


def _sampled(rng: np.random.Generator, count: int, uneven: bool) -> Any:
    """(count,) from 0 to 1."""
    steps = rng.uniform(0.3, 1.7, count - 1) if uneven else np.ones(count - 1)
    return np.concatenate([[0], np.cumsum(steps)]) / steps.sum()


def _driven(legs: list[Leg], stroke: float, smooth: bool) -> tuple[Any, Any]:
    """(time s, level) closely along the course."""
    u = np.linspace(0, 1, FINE + 1)[1:]
    shape = (1 - np.cos(np.pi * u)) / 2 if smooth else u
    times, levels = [np.zeros(1)], [np.zeros(1)]
    for level, speed, hold in legs:
        begun, came_from = times[-1][-1], levels[-1][-1]
        takes = stroke * abs(level - came_from) / speed
        times.append(begun + takes * u)
        levels.append(came_from + (level - came_from) * shape)
        if hold:
            times.append(begun + takes + hold * stroke * u)
            levels.append(np.full(FINE, level))
    return np.concatenate(times), np.concatenate(levels)


def _legs(rng: np.random.Generator, kind: str) -> list[Leg]:
    up, back = (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)
    if kind == "ramp":
        return [up]
    if kind == "held_ramp":
        return [(1.0, 1.0, rng.uniform(0.5, 3))]
    if kind == "there_and_back":
        return [up, back]
    if kind == "cycles":
        return [up, back] * int(rng.integers(2, 6))
    if kind == "two_speeds":
        quick = log_between(rng, 3, 30)
        slow, fast = [up, back] * int(rng.integers(1, 3)), [(1.0, quick, 0.0), (0.0, quick, 0.0)] * 2
        return slow + fast if rng.uniform() < 0.5 else fast + slow
    if kind == "fast_then_slow":
        quick = log_between(rng, 4, 40)
        return [(1.0, quick, 0.0), (0.0, quick, rng.uniform(0, 0.5)), up, back]
    return _stepped(rng, kind)


def _stepped(rng: np.random.Generator, kind: str) -> list[Leg]:
    """Courses of several levels."""
    count = int(rng.integers(3, 6))
    if kind == "rising":
        tops = [*np.sort(rng.uniform(0.25, 0.9, count - 1)), 1.0]
        return [leg for top in tops for leg in ((float(top), 1.0, 0.0), (0.0, 1.0, 0.0))]
    if kind == "dwells":
        hold, half = log_between(rng, 0.3, 4), rng.uniform(0.4, 0.75)
        return [(half, 1.0, hold), (1.0, 1.0, hold), (half, 1.0, hold), (0.0, 1.0, 0.5 * hold), (1.0, 1.0, 0.0)]
    if kind == "staircase":
        hold = log_between(rng, 0.1, 1)
        levels = np.linspace(0, 1, count + 2)[1:].tolist()
        return [(x, 1.0, hold) for x in [*levels, *levels[-2::-1]]] + [(0.0, 1.0, 0.0)]
    if kind == "sawtooth":
        climbing = np.linspace(rng.uniform(0.4, 0.7), 1, count)
        keeps = rng.uniform(0.3, 0.65)
        legs = [leg for top in climbing for leg in ((float(top), 1.0, 0.0), (float(keeps * top), 1.0, 0.0))]
        return [*legs[:-1], (0.0, 1.0, 0.0)] if rng.uniform() < 0.5 else legs
    raise ValueError(f"no course {kind!r}")
