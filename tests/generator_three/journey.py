"""How the disc is driven: ramps and rests, and the readings along them; mm, mm/s and s."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.generator_three.materials import log_uniform

FASTEST, LONGEST_RAMP, SHORTEST_RAMP = 10.0, 1500.0, 1.0
FEWEST = 4  # readings of a piece
RESTING = 0.5  # of the readings at most


@dataclass(frozen=True, eq=False)
class Journey:
    """What was read where; arrays (N,): time s, at mm, speed mm/s and 0 at rest, except for the first reading.

    turns : numbers of the readings at which a piece ends; speeds : those that occur, rising.
    """

    text: str
    time: Any
    at: Any
    speed: Any
    turns: tuple[int, ...]
    speeds: tuple[float, ...]

    @property
    def largest(self) -> float:
        """m"""
        return 1e-3 * float(np.max(self.at))


@dataclass(frozen=True)
class Ramp:
    """To a deflection (mm) at a speed (mm/s)."""

    to: float
    speed: float


@dataclass(frozen=True)
class Rest:
    """For so many seconds, with a share of the readings."""

    seconds: float
    share: float


Pieces = list[Ramp | Rest]
KINDS = ("single", "cycles", "rising", "speeds", "holds", "stairs")
MONOTONE = "monotone"


def draw_journey(rng: np.random.Generator, kind: str, peak: float) -> Journey:
    """A test of a kind up to ``peak`` (mm), its speed such that a ramp lasts between a second and 25 minutes."""
    readings = int(rng.integers(150, 601))
    if kind == "speeds":
        low = _valley(rng, peak)
        pieces, text = _at_speeds(rng, peak, low)
        return read_along(pieces, readings, text)
    v = float(np.clip(log_uniform(rng, 0.05, 10), peak / LONGEST_RAMP, min(FASTEST, peak / SHORTEST_RAMP)))
    low = _valley(rng, peak)
    pieces, text = {
        "single": _single,
        MONOTONE: _monotone,
        "cycles": _cycles,
        "rising": _rising,
        "holds": _holds,
        "stairs": _stairs,
    }[kind](rng, peak, low, v)
    return read_along(pieces, readings, text)


def _valley(rng: np.random.Generator, peak: float) -> float:
    return 0.0 if rng.uniform() < 0.7 else rng.uniform(0.01, 0.06) * peak


def _single(rng: np.random.Generator, peak: float, low: float, v: float) -> tuple[Pieces, str]:
    return [Ramp(peak, v), Ramp(low if rng.uniform() < 0.3 else 0.0, v)], "single ramp up and down"


def _monotone(rng: np.random.Generator, peak: float, low: float, v: float) -> tuple[Pieces, str]:
    return [Ramp(peak, v)], "monotone loading only"


def _cycles(rng: np.random.Generator, peak: float, low: float, v: float) -> tuple[Pieces, str]:
    count = int(rng.integers(2, 5))
    return [Ramp(peak, v), Ramp(low, v)] * count, f"{count} cycles to the same peak"


def _rising(rng: np.random.Generator, peak: float, low: float, v: float) -> tuple[Pieces, str]:
    count = int(rng.integers(2, 5))
    each = 1 if rng.uniform() < 0.6 else 2
    pieces: Pieces = []
    for part in np.linspace(rng.uniform(0.35, 0.6), 1, count):
        pieces += [Ramp(peak * part, v), Ramp(low, v)] * each
    return pieces, f"{count} rising peaks, {each} cycle(s) each"


def _at_speeds(rng: np.random.Generator, peak: float, low: float) -> tuple[Pieces, str]:
    count = int(rng.integers(2, 4))
    slowest = log_uniform(rng, max(0.05, peak / LONGEST_RAMP), 0.5 if count == 3 else 1.0)
    speeds = slowest * np.array([log_uniform(rng, 4, 20) ** i for i in range(count)])
    speeds = np.minimum(speeds, FASTEST)
    if rng.uniform() < 0.4:
        speeds = speeds[::-1]
    each = 1 if rng.uniform() < 0.6 else 2
    pieces: Pieces = []
    for v in speeds:
        pieces += [Ramp(peak, float(v)), Ramp(low, float(v))] * each
    return pieces, f"{each} cycle(s) at each of the speeds {', '.join(f'{v:.3g}' for v in speeds)} mm/s"


def _holds(rng: np.random.Generator, peak: float, low: float, v: float) -> tuple[Pieces, str]:
    count = int(rng.integers(1, 4))
    seconds = peak / v * log_uniform(rng, 0.5, 5)
    below = rng.uniform() < 0.4
    pieces: Pieces = []
    for i in range(count):
        pieces += [Ramp(peak, v), Rest(seconds, 0.15), Ramp(low, v)]
        if below and i < count - 1:
            pieces.append(Rest(seconds * rng.uniform(0.3, 2), 0.1))
    also = " and holds at rest" if below else ""
    return pieces, f"{count} ramp(s) with hold of {seconds:.3g} s at the top{also}"


def _stairs(rng: np.random.Generator, peak: float, low: float, v: float) -> tuple[Pieces, str]:
    count = int(rng.integers(5, 11))
    seconds = peak / v / count * log_uniform(rng, 0.3, 2)
    down = rng.uniform() < 0.75
    rest = Rest(seconds, 0.035)
    pieces: Pieces = []
    for i in range(1, count + 1):
        pieces += [Ramp(peak * i / count, v), rest]
    if down and rng.uniform() < 0.5:
        pieces.append(Ramp(0.0, v))
    elif down:
        for i in range(count - 1, -1, -1):
            pieces += [Ramp(peak * i / count, v), *([rest] if i else [])]
    return pieces, f"staircase of {count} steps with dwells of {seconds:.3g} s{', and back' if down else ''}"


def read_along(pieces: Pieces, readings: int, text: str) -> Journey:
    """Readings of the pieces: rests have theirs by share, and ramps the others by length."""
    shares = sum(p.share for p in pieces if isinstance(p, Rest))
    resting = min(1, RESTING / shares) if shares else 1
    whole, last = 0.0, 0.0
    for p in pieces:
        if isinstance(p, Ramp):
            whole, last = whole + abs(p.to - last), p.to
    time, at, speed, turns, last = [np.zeros(1)], [np.zeros(1)], [np.zeros(1)], [], 0.0
    for p in pieces:
        if isinstance(p, Rest):
            count = max(FEWEST, int(readings * p.share * resting))
            step, v, to = p.seconds * np.arange(1, count + 1) / count, 0.0, last
            way = np.full(count, last)
        else:
            length = abs(p.to - last)
            count = max(FEWEST, round(readings * (1 - shares * resting) * length / whole))
            part = np.arange(1, count + 1) / count
            step, v, to = part * length / p.speed, p.speed, p.to
            way = last + (p.to - last) * part
        time.append(time[-1][-1] + step)
        at.append(way)
        speed.append(np.full(count, v))
        turns.append(sum(map(len, time)) - 1)
        last = to
    v_all = np.concatenate(speed)
    v_all[0] = v_all[1]
    return Journey(
        text,
        np.round(np.concatenate(time), 6),
        np.round(np.concatenate(at), 6),
        v_all,
        tuple(turns[:-1] or turns),
        tuple(sorted({round(float(v), 9) for v in v_all if v > 0})),
    )
