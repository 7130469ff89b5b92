"""Families of traces that something foreign could leave, each with what its most probable member says of itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.detection.periodicity import most_waves
from bayesmembrane.diagnosis.explanation.foreign import PLAY, SUDDEN, WAVE, Foreign
from bayesmembrane.diagnosis.thresholds import DETECTION, FOREIGN
from bayesmembrane.ground.parameters import Array

PIECE = 2**18
"""Numbers of traces that are weighed at once."""


@dataclass(frozen=True, eq=False)
class Family:
    """Traces of one unit of their expected size, in groups of ``width`` that act together; in N.

    count : how many groups there are
    traces : (N, width m) those of the groups with the numbers (m,)
    told : what is found, with what its most probable member, of that number and coefficient, says of itself
    """

    kind: str
    count: int
    traces: Callable[[NDArray[np.intp]], Array]
    told: Callable[[Foreign, int, float], Foreign]
    width: int = 1

    def pieces(self, readings: int) -> Iterator[Array]:
        """All traces, some groups at a time: those of a long test fill the memory."""
        step = max(PIECE // readings // self.width, 1)
        for first in range(0, self.count, step):
            yield self.traces(np.arange(first, min(first + step, self.count)))


def families(m: Measurement, base: Candidate) -> list[Family]:
    out = [steps(m, base), _waves(m)]
    if np.any(m.leg < 0):
        out.append(_plays(m, base))
    return out


def _places(m: Measurement) -> Array:
    n = len(m)
    ends = (FOREIGN.margin * n, (1 - FOREIGN.margin) * n)
    return np.unique(np.linspace(*ends, min(FOREIGN.places, n)).astype(int))


def steps(m: Measurement, base: Candidate) -> Family:
    """Steps of the force that take several times, and what comes to rest in several: by a constant first, then by a
    factor.
    """
    clock, places = m.path.clock[m.on_path], _places(m)
    kinds = [partial(_stepping, width) for width in FOREIGN.widths] + [partial(_resting, t) for t in FOREIGN.rests]
    fitted = m.force - base.residual
    largest = float(np.max(np.abs(m.force)))
    each = len(kinds) * places.size

    def traces(numbers: NDArray[np.intp]) -> Array:
        since = (clock[:, None] - clock[places[numbers % places.size]]) / np.ptp(clock)
        for k, kind in enumerate(kinds):
            own = numbers % each // places.size == k
            since[:, own] = kind(since[:, own])
        return np.asarray(FOREIGN.size * (since * np.where(numbers < each, largest, fitted[:, None])))

    def told(found: Foreign, best: int, coefficient: float) -> Foreign:
        place = int(places[best % places.size])
        relative = best >= each
        size = coefficient * FOREIGN.size * (1.0 if relative else largest)
        moment = None if m.time is None else float(m.time[place])
        return replace(found, size=size, relative=relative, place=place, moment=moment, on_clock=float(clock[place]))

    return Family(SUDDEN, 2 * each, traces, told)


def _stepping(width: float, since: Array) -> Array:
    return np.asarray(expit(since / width))


def _resting(time: float, since: Array) -> Array:
    return -np.expm1(-np.maximum(since, 0.0) / time)


def _frequencies(most: float) -> Array:
    """Up to ``most`` waves over the range, near enough for none to be missed between two of them."""
    most = max(most, FOREIGN.least_waves + 1)
    count = min(int(np.ceil((most - FOREIGN.least_waves) / FOREIGN.wave_step)) + 1, FOREIGN.waves)
    return np.linspace(FOREIGN.least_waves, most, count)


def _waves(m: Measurement) -> Family:
    """Cosines and sines over the readings' time, then over the deflection where the disc moves."""
    size = FOREIGN.size / 3 * float(np.max(np.abs(m.force)))
    places = [("time", m.path.clock[m.on_path], _frequencies(len(m) / 2))]
    if np.count_nonzero(m.moving) >= DETECTION.fewest_moving:
        places.append(("deflection", m.deflection, _frequencies(most_waves(m))))
    phases = [(_phase(place), frequencies) for _, place, frequencies in places]

    def traces(numbers: NDArray[np.intp]) -> Array:
        along = np.concatenate([phase[:, None] * waves for phase, waves in _of_each(phases, numbers)], axis=1)
        return np.asarray(size * np.stack([np.cos(along), np.sin(along)], axis=-1).reshape(len(m), -1))

    periods = [(against, float(np.ptp(place)) / f) for against, place, waves in places for f in waves.tolist()]

    def told(found: Foreign, best: int, _: float) -> Foreign:
        assert found.trace is not None
        against, period = periods[best]
        return replace(found, size=float(np.max(np.abs(found.trace))), period=period, against=against)

    return Family(WAVE, len(periods), traces, told, 2)


def _of_each(phases: Sequence[tuple[Array, Array]], numbers: NDArray[np.intp]) -> Iterator[tuple[Array, Array]]:
    """The phases of one wave, and the frequencies with these ``numbers``, counted through all of them."""
    first = 0
    for phase, frequencies in phases:
        own = numbers - first
        yield phase, frequencies[own[(own >= 0) & (own < frequencies.size)]]
        first += frequencies.size


def _phase(place: Array) -> Array:
    """(N,) of one wave over all of the test."""
    span = float(np.ptp(place)) or 1.0  # where the disc stands still, nothing repeats with the deflection
    return np.asarray(2 * np.pi * ((place - place.min()) / span))


def _plays(m: Measurement, base: Candidate) -> Family:
    """-dF/d(deflection) times how far a play of the drive is taken up: 0 on loading, 1 on unloading."""
    path = m.path
    fitted = m.force - base.residual
    slope = _slope(m.deflection, fitted)
    unit = FOREIGN.play * path.full_range
    out = []
    for part in FOREIGN.plays:
        travel = part * path.full_range
        lag = np.zeros(path.deflection.size)
        for i in range(1, lag.size):
            kept = np.exp(-path.steps[i] / travel)
            lag[i] = lag[i - 1] * kept + (1 - kept) * (path.leg[i] < 0)
        out.append(slope * lag[m.on_path])
    lags = unit * np.column_stack(out)

    def told(found: Foreign, _: int, coefficient: float) -> Foreign:
        return replace(found, size=abs(coefficient) * unit)

    return Family(PLAY, lags.shape[1], lambda numbers: lags[:, numbers], told)


def _slope(deflection: Array, force: Array) -> Array:
    """(N,) N/m: slope of a smooth curve through the fitted forces against the deflection."""
    order = np.argsort(deflection, kind="stable")
    most = min(9, max(np.unique(deflection).size // 6, 1))
    fit, _ = np.polynomial.Chebyshev.fit(deflection[order], force[order], most, full=True)  # of few places: no warning
    return np.asarray(fit.deriv()(deflection))
