"""Families of traces that something foreign could leave, each with what its most probable member says of itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.detection.periodicity import most_waves
from bayesmembrane.diagnosis.explanation.foreign import LOST, PASSING, PLAY, RANGE, STOP, SUDDEN, WAVE, Foreign
from bayesmembrane.diagnosis.thresholds import DETECTION, FOREIGN, TINY
from bayesmembrane.ground.parameters import Array

PIECE = 2**18
"""Numbers of traces that are weighed at once."""


@dataclass(frozen=True, eq=False)
class Family:
    """Traces of one unit of their expected size, in groups of ``width`` that act together; in N.

    count : how many groups there are
    traces : (N, width m) those of the groups with the numbers (m,)
    told : what is found, with what its most probable member, of that number and coefficient, says of itself
    upward : whether a negative coefficient is none of these
    """

    kind: str
    count: int
    traces: Callable[[NDArray[np.intp]], Array]
    told: Callable[[Foreign, int, float], Foreign]
    width: int = 1
    upward: bool = False

    def pieces(self, readings: int) -> Iterator[Array]:
        """All traces, some groups at a time: those of a long test fill the memory."""
        step = max(PIECE // readings // self.width, 1)
        for first in range(0, self.count, step):
            yield self.traces(np.arange(first, min(first + step, self.count)))


def families(m: Measurement, fitted: Array) -> list[Family]:
    """Every family that can be looked for beside a model with these ``fitted`` forces (N,), N.

    Where readings have no order nothing comes at a moment.
    """
    out = bending(m, fitted)
    if m.rig.has_path:
        out += [_passing(m, fitted), _waves(m)]
    if m.rig.has_path and np.any(m.leg < 0):
        out.append(_plays(m, fitted))
    return out


def bending(m: Measurement, fitted: Array) -> list[Family]:
    """Those for which a film that is fitted through them takes another energy."""
    out = [_ranges(m, fitted)]
    if m.rig.has_path:
        out += [_steps(m, fitted), _lost(m, fitted), _stops(m)]
    return out


def _places(m: Measurement) -> Array:
    n = len(m)
    ends = (FOREIGN.margin * n, (1 - FOREIGN.margin) * n)
    return np.unique(np.linspace(*ends, min(FOREIGN.places, n)).astype(int))


def _steps(m: Measurement, fitted: Array) -> Family:
    """Steps of the force that take several times, and what comes to rest in several."""
    kinds = [partial(_stepping, width) for width in FOREIGN.widths] + [partial(_resting, t) for t in FOREIGN.rests]
    return _changes(m, fitted, SUDDEN, kinds)


def _passing(m: Measurement, fitted: Array) -> Family:
    """What comes and goes, as a draught or a lamp makes it."""
    return _changes(m, fitted, PASSING, [partial(_coming_and_going, t) for t in FOREIGN.passes])


def _changes(m: Measurement, fitted: Array, kind: str, courses: Sequence[Callable[[Array], Array]]) -> Family:
    """Changes of the force by a constant first, then by a factor."""
    largest = float(np.max(np.abs(m.force)))

    def told(found: Foreign, scale: int, coefficient: float) -> Foreign:
        size = coefficient * FOREIGN.size * (1.0 if scale else largest)
        return replace(found, size=size, relative=bool(scale))

    return _at_moments(m, kind, courses, [FOREIGN.size * largest, FOREIGN.size * fitted], told)


def _lost(m: Measurement, fitted: Array) -> Family:
    """-dF/d(deflection) from some moment on: the drive lost steps, or the counter its zero."""
    unit = FOREIGN.lost * m.path.full_range
    slope = unit * _slope(m.deflection, fitted)

    def told(found: Foreign, _: int, coefficient: float) -> Foreign:
        return replace(found, size=coefficient * unit)

    return _at_moments(m, LOST, [partial(_stepping, FOREIGN.widths[0])], [-slope], told)


def _at_moments(
    m: Measurement,
    kind: str,
    courses: Sequence[Callable[[Array], Array]],
    scales: Sequence[Array | float],
    told: Callable[[Foreign, int, float], Foreign],
) -> Family:
    """Every course after every moment, by every scale (N,) N in turn; ``told`` is given the number of the scale."""
    clock, places = m.path.clock[m.on_path], _places(m)
    each = len(courses) * places.size
    by = np.stack([np.broadcast_to(np.asarray(s, dtype=float), clock.shape) for s in scales], axis=1)

    def traces(numbers: NDArray[np.intp]) -> Array:
        since = (clock[:, None] - clock[places[numbers % places.size]]) / np.ptp(clock)
        for k, course in enumerate(courses):
            own = numbers % each // places.size == k
            since[:, own] = course(since[:, own])
        return np.asarray(since * by[:, numbers // each])

    def placed(found: Foreign, best: int, coefficient: float) -> Foreign:
        place = int(places[best % places.size])
        moment = None if m.time is None else float(m.time[place])
        found = replace(found, place=place, moment=moment, on_clock=float(clock[place]))
        return told(found, best // each, coefficient)

    return Family(kind, len(scales) * each, traces, placed)


def _stepping(width: float, since: Array) -> Array:
    return np.asarray(expit(since / width))


def _resting(time: float, since: Array) -> Array:
    return -np.expm1(-np.maximum(since, 0.0) / time)


def _coming_and_going(time: float, since: Array) -> Array:
    """x exp(1 - x) of the time x since, in units of the one at which it is largest."""
    x = np.maximum(since, 0.0) / time
    return np.asarray(x * np.exp(1 - x))


def _ranges(m: Measurement, fitted: Array) -> Family:
    """The force times a factor, where it is larger than some force: an amplifier that changes its range."""
    largest = float(np.max(np.abs(m.force)))
    levels = largest * np.linspace(*FOREIGN.within, FOREIGN.levels)

    def traces(numbers: NDArray[np.intp]) -> Array:
        return np.asarray(FOREIGN.size * fitted[:, None] * (np.abs(fitted)[:, None] > levels[numbers]))

    def told(found: Foreign, best: int, coefficient: float) -> Foreign:
        return replace(found, size=coefficient * FOREIGN.size, relative=True, level=float(levels[best]))

    return Family(RANGE, levels.size, traces, told)


def _stops(m: Measurement) -> Family:
    """What is met at some deflection, and pushes back from there on."""
    most, largest = float(np.max(m.deflection)), float(np.max(np.abs(m.force)))
    levels = most * np.linspace(*FOREIGN.met_at, FOREIGN.levels)

    def traces(numbers: NDArray[np.intp]) -> Array:
        at = levels[numbers]
        beyond = np.maximum(m.deflection[:, None] - at, 0.0) / np.maximum(most - at, TINY)
        return np.asarray(FOREIGN.size * largest * beyond)

    def told(found: Foreign, best: int, coefficient: float) -> Foreign:
        return replace(found, size=coefficient * FOREIGN.size * largest, level=float(levels[best]))

    return Family(STOP, levels.size, traces, told, upward=True)


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


def _plays(m: Measurement, fitted: Array) -> Family:
    """dF/d(deflection) times how far a play of the drive is taken up: 0 on loading, 1 on unloading."""
    path = m.path
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
        return replace(found, size=coefficient * unit)

    return Family(PLAY, lags.shape[1], lambda numbers: lags[:, numbers], told, upward=True)


def _slope(deflection: Array, force: Array) -> Array:
    """(N,) N/m: slope of a smooth curve through the fitted forces against the deflection."""
    order = np.argsort(deflection, kind="stable")
    most = min(9, max(np.unique(deflection).size // 6, 1))
    fit, _ = np.polynomial.Chebyshev.fit(deflection[order], force[order], most, full=True)  # of few places: no warning
    return np.asarray(fit.deriv()(deflection))
