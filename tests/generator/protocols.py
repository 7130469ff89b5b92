"""What the machine does: deflection against time, legs, peaks, speeds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.generator.energies import Array


@dataclass(frozen=True)
class Protocol:
    """A path of straight legs 0 -> peak -> valley -> peak ..., at one speed each; sampled ``points`` times along it.

    peaks : m; speeds : m/s, one per peak (its loading and its unloading); points : samples; unload : False ends at the
    last peak; dwells : s for which the disc stands still at each peak and at each valley; readings : samples of each
    dwell, beside ``points``
    """

    name: str
    peaks: tuple[float, ...]
    speeds: tuple[float, ...]
    points: int
    unload: bool = True
    dwells: tuple[float, float] = (0.0, 0.0)
    readings: int = 16


PROTOCOLS = {
    p.name: p
    for p in (
        Protocol("single", (0.040,), (5e-4,), 366, unload=False),
        Protocol("single_wide", (0.0915,), (5e-4,), 366, unload=False),
        Protocol("staircase", (0.010, 0.020, 0.030, 0.040, 0.040), (1e-3,) * 5, 700),
        Protocol("staircase_twice", (0.010, 0.010, 0.020, 0.020, 0.030, 0.030, 0.040, 0.040), (1e-3,) * 8, 700),
        Protocol("two_speeds", (0.020, 0.040, 0.020, 0.040), (5e-4, 5e-4, 5e-3, 5e-3), 700),
    )
}


@dataclass(frozen=True)
class Path:
    """A sampled protocol; arrays (N,): time s, deflection m, leg (0, 1, ...; even ones load), speed m/s, peak m.

    A dwell belongs to the leg before it, and has its speed.
    """

    time: Array
    deflection: Array
    leg: NDArray[np.int64]
    speed: Array
    peak: Array

    @property
    def largest(self) -> float:
        """Largest deflection (m)."""
        return float(np.max(self.peak))

    @property
    def loading(self) -> NDArray[np.bool_]:
        """(N,) True on loading legs."""
        return self.leg % 2 == 0


def sample(protocol: Protocol, rng: np.random.Generator, uneven: bool = False) -> Path:
    """The protocol's samples: evenly along the path, or with a jitter of 40 % of a step and a tenth of them lost."""
    turns = np.array([x for peak in protocol.peaks for x in (peak, 0.0)])
    speeds = np.repeat(protocol.speeds, 2)
    if not protocol.unload:
        turns, speeds = turns[:-1], speeds[:-1]
    starts = np.concatenate([[0.0], turns[:-1]])
    lengths = np.abs(turns - starts)
    ends = np.cumsum(lengths)
    count = protocol.points
    if uneven:
        extra = round(count / 0.9)
        step = ends[-1] / (extra - 1)
        along = np.arange(extra) * step + rng.uniform(-0.4, 0.4, extra) * step
        kept = np.sort(rng.choice(extra, count, replace=False))
        along = np.clip(along[kept], 0.0, ends[-1])
        along[0] = 0.0
    else:
        along = np.linspace(0.0, ends[-1], count)
    leg = np.minimum(np.searchsorted(ends, along, side="left"), ends.size - 1)
    done = along - (ends[leg] - lengths[leg])
    deflection = starts[leg] + np.sign(turns[leg] - starts[leg]) * done
    begun = np.concatenate([[0.0], np.cumsum(lengths / speeds)])
    time = begun[leg] + done / speeds[leg]
    peak = np.maximum(turns, starts)[leg]
    path = Path(time, np.maximum(deflection, 0.0), leg, speeds[leg], peak)
    return _with_dwells(path, protocol, turns, begun[1:]) if max(protocol.dwells) > 0 else path


def _with_dwells(path: Path, protocol: Protocol, turns: Array, ends: Array) -> Path:
    """``path`` with the readings of the dwells put in at its ``turns``, reached at ``ends`` (s) without dwells."""
    parts, counts, waited = [], [], 0.0
    for leg, (turn, end) in enumerate(zip(turns, ends, strict=True)):
        on = path.leg == leg
        parts.append(np.stack([path.time[on] + waited, path.deflection[on]]))
        counts.append(np.count_nonzero(on))
        dwell = protocol.dwells[leg % 2]
        if dwell > 0:
            at = end + waited + dwell * np.arange(1, protocol.readings + 1) / (protocol.readings + 1)
            parts.append(np.stack([at, np.full(at.size, turn)]))
            counts[-1] += at.size
            waited += dwell
    time, deflection = np.concatenate(parts, axis=1)
    leg = np.repeat(np.arange(turns.size), counts)
    first = np.searchsorted(path.leg, leg)
    return Path(time, deflection, leg, path.speed[first], path.peak[first])
