"""What no effect of the library describes: steps, waves, play of the drive, a load cell at its limit, or nothing known.

Each kind is a family of traces; the evidence of the kind is the mean over its members, each with its size integrated
out beside all that the model can follow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.evidence import Block, Linear, extended, weighed
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.detection.periodicity import most_waves
from bayesmembrane.diagnosis.explanation.limit import Limit, limit_of
from bayesmembrane.diagnosis.reference.inferred import own_noise
from bayesmembrane.diagnosis.reference.smooth import smooth_reference
from bayesmembrane.diagnosis.thresholds import DETECTION, FOREIGN
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.form_error import LARGEST, LAW

SUDDEN, WAVE, PLAY, CLIPPED, UNNAMED = "sudden_change", "ripple", "play", "clipped", "unnamed"
KINDS = (SUDDEN, WAVE, PLAY, CLIPPED, UNNAMED)
PIECE = 2**18
"""Numbers of traces that are weighed at once."""


@dataclass(frozen=True, eq=False)
class Foreign:
    """Something foreign beside a model.

    kind : one of `KINDS`
    base : the model
    gain : ln of the Bayes factor over the model without it, its chance included
    chance : ln of the chance that the data find it where it was found, of all the places or waves where it could be
    size : of the most probable member, N, or part of the force if ``relative``; of a play m
    relative : see ``size``
    place : number of the reading at which a step comes, else 0
    moment : its time in s, or None
    on_clock : the same on the clock of the test (`Motion.clock`), s
    period : of a wave, s or m
    against : "time" or "deflection": what a wave repeats with
    share : part of the squares that the model leaves, which it takes away
    trace : (N,) N, what it changes
    soft : of a limit, over what part of it the reading yields; 0 where it is met at once
    limit : that limit
    """

    kind: str
    base: Candidate
    gain: float
    chance: float = 0.0
    size: float = 0.0
    relative: bool = False
    place: int = 0
    moment: float | None = None
    on_clock: float = 0.0
    period: float = 0.0
    against: str = ""
    share: float = 0.0
    trace: Array | None = None
    soft: float = 0.0
    limit: Limit | None = None

    @property
    def falls(self) -> bool:
        """True if the force falls at some moment, and stays lower."""
        return self.kind == SUDDEN and self.size < 0

    def counted(self, counts: float) -> float:
        """ln of the Bayes factor of which a part ``counts``: laws may be off, yet not where a thing could have been."""
        return counts * (self.gain - self.chance) + self.chance


def beside(search: Search, bases: Sequence[Candidate], others: Sequence[Candidate]) -> list[Foreign]:
    """What is foreign beside the ``bases``, and a step or a limit beside the ``others`` too; the most probable first.

    A film that is fitted through one of these takes another energy for it, so that the energy that is most probable
    without one says little: of a step of the load cell's zero 7 in ln of the Bayes factor were told beside that, and 36
    beside three others. Waves and plays leave traces that no energy has.
    """
    found = [f for base in bases for f in foreign(search, base)]
    if len(search.measurement) >= FOREIGN.least_points:
        smooth = smooth_reference(search.measurement)
        for base in others:
            both: tuple[Finder, ...] = (
                partial(_of_family, base, _steps(search.measurement, base)),
                partial(_clipped, base),
            )
            found += [f for f in (_with_its_own_noise(search, smooth, find) for find in both) if f is not None]
    return sorted(found, key=lambda f: -(f.gain + f.base.log_evidence))


@dataclass(frozen=True, eq=False)
class _Family:
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


def foreign(search: Search, base: Candidate) -> list[Foreign]:
    """Every kind that can be looked for beside ``base``."""
    m = search.measurement
    if len(m) < FOREIGN.least_points:
        return []
    smooth = smooth_reference(m)
    finders: list[Finder] = [partial(_of_family, base, f) for f in _families(m, base)]
    finders.append(partial(_clipped, base))
    found = [_with_its_own_noise(search, smooth, find) for find in finders]
    return [f for f in (*found, _unnamed(search, base)) if f is not None]


Finder = Callable[[Search, Foreign | None], Foreign | None]
"""Looks for one thing under the noise of a search; given what was found of it under another noise."""


def _with_its_own_noise(search: Search, smooth: Array, find: Finder) -> Foreign | None:
    """What is found under the noise as it is, or under the one that is left beside what was found, if that is likelier.

    What is foreign looks like noise, and like noise with a memory: it hides in the one that is inferred without it.
    Both models are weighed under both noises, each of which is as likely as it makes the readings.
    """
    found = find(search, None)
    if found is None or found.trace is None or found.gain - found.chance < FOREIGN.promise:
        return found
    base = found.base
    noise = own_noise(search.measurement, np.column_stack([smooth, base.slopes, found.trace]))
    other = replace(search, noise=noise)
    again = find(other, found)
    if again is None:
        return found
    apart = _plain_evidence(other, base) - _plain_evidence(search, base)
    gain = again.gain + min(apart, 0.0)
    return replace(again, gain=gain) if gain > found.gain else found


def _plain_evidence(search: Search, base: Candidate) -> float:
    """ln Z of the model alone, comparable between noises."""
    return weighed(search.linear(base), base.theta).log_evidence - search.noise.log_root


def _of_family(base: Candidate, family: _Family, search: Search, _before: Foreign | None) -> Foreign:
    """The most probable member of a family beside ``base``, and the evidence of them all."""
    model = search.linear(base)
    # Beside noise and form error as they are expected: what is foreign has driven the fitted ones up.
    plain = np.minimum(base.theta, model.priors[:, 0])
    pieces = family.pieces(len(search.measurement))
    gains = np.concatenate([_gains(search, model, plain, part, family.width) for part in pieces])
    best = int(np.argmax(gains))
    members = family.traces(np.array([best]))
    spread = float(np.logaddexp.reduce(gains) - np.log(gains.size) - gains[best])
    wider = extended(model, [Block(search.noise.white(members))])
    z = weighed(wider, base.theta)
    mean = wider.mean(z.theta)
    own = mean[-family.width :]
    trace = members @ own
    gain = z.log_evidence - weighed(model, base.theta).log_evidence + spread
    found = Foreign(family.kind, base, gain, spread, trace=trace, share=_share(search, base, trace))
    return family.told(found, best, float(own[0]))


def _gains(search: Search, model: Linear, theta: Array, traces: Array, width: int) -> Array:
    """(m,) ln K of each group of ``width`` columns s: r^T P s (1 + s^T P s)^-1 s^T P r / 2 - ln |1 + s^T P s| / 2."""
    n, count = traces.shape
    white = search.noise.white(traces)
    freed = model.freed(theta, white)
    a = (freed.T @ model.data).reshape(count // width, width)
    f, w = (v.reshape(n, count // width, width) for v in (freed, white))
    gram = np.einsum("nmi,nmj->mij", w, f) + np.eye(width)
    solved = np.linalg.solve(gram, a[:, :, None])[:, :, 0]
    return np.asarray(0.5 * np.sum(a * solved, axis=1) - 0.5 * np.linalg.slogdet(gram)[1])


# ---- families --------------------------------------------------------------------------------------------------------


def _families(m: Measurement, base: Candidate) -> list[_Family]:
    out = [_steps(m, base), _waves(m)]
    if np.any(m.leg < 0):
        out.append(_plays(m, base))
    return out


def _places(m: Measurement) -> Array:
    n = len(m)
    ends = (FOREIGN.margin * n, (1 - FOREIGN.margin) * n)
    return np.unique(np.linspace(*ends, min(FOREIGN.places, n)).astype(int))


def _steps(m: Measurement, base: Candidate) -> _Family:
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

    return _Family(SUDDEN, 2 * each, traces, told)


def _stepping(width: float, since: Array) -> Array:
    return np.asarray(expit(since / width))


def _resting(time: float, since: Array) -> Array:
    return -np.expm1(-np.maximum(since, 0.0) / time)


def _frequencies(most: float) -> Array:
    """Up to ``most`` waves over the range, near enough for none to be missed between two of them."""
    most = max(most, FOREIGN.least_waves + 1)
    count = min(int(np.ceil((most - FOREIGN.least_waves) / FOREIGN.wave_step)) + 1, FOREIGN.waves)
    return np.linspace(FOREIGN.least_waves, most, count)


def _waves(m: Measurement) -> _Family:
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

    return _Family(WAVE, len(periods), traces, told, 2)


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


def _plays(m: Measurement, base: Candidate) -> _Family:
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

    return _Family(PLAY, lags.shape[1], lambda numbers: lags[:, numbers], told)


def _slope(deflection: Array, force: Array) -> Array:
    """(N,) N/m: slope of a smooth curve through the fitted forces against the deflection."""
    order = np.argsort(deflection, kind="stable")
    most = min(9, max(np.unique(deflection).size // 6, 1))
    fit, _ = np.polynomial.Chebyshev.fit(deflection[order], force[order], most, full=True)  # of few places: no warning
    return np.asarray(fit.deriv()(deflection))


def _share(search: Search, base: Candidate, trace: Array) -> float:
    """Part of the squares, beside the model's own slopes, that a trace takes away."""
    white = search.noise.white(np.column_stack([base.slopes, trace, base.residual]))
    q, _ = np.linalg.qr(white[:, :-2])
    t, r = (white[:, i] - q @ (q.T @ white[:, i]) for i in (-2, -1))
    return float((t @ r) ** 2 / max(float(t @ t) * float(r @ r), 1e-300))


# ---- kinds of their own ----------------------------------------------------------------------------------------------


def _unnamed(search: Search, base: Candidate) -> Foreign | None:
    """A smooth relative error of the whole curve along the test: memory of a kind that is not in the library.

    No larger than the error of a law may be: what is as large as the force itself would be any curve.
    """
    fitted = search.measurement.force - base.residual
    columns = search.noise.white(fitted[:, None] * search.factors.progress)
    model = search.linear(base)
    wider = extended(model, [Block(columns, FOREIGN.ln_unnamed, float(np.log(LARGEST[LAW.name])))])
    z = weighed(wider)
    mean = wider.mean(z.theta)
    trace = fitted * (search.factors.progress @ mean[-columns.shape[1] :])
    gain = z.log_evidence - weighed(model, base.theta).log_evidence
    share = _share(search, base, trace)
    return Foreign(UNNAMED, base, gain, size=float(np.exp(z.theta[-1])), relative=True, share=share, trace=trace)


def _clipped(base: Candidate, search: Search, before: Foreign | None) -> Foreign | None:
    """A load cell at its limit."""
    found = limit_of(search, base, None if before is None else before.limit)
    if found is None:
        return None
    share = _share(search, base, found.trace)
    return Foreign(
        CLIPPED,
        base,
        found.gain,
        size=found.force,
        place=found.first,
        share=share,
        trace=found.trace,
        soft=found.width,
        limit=found,
    )


def kinds_of(found: Sequence[Foreign]) -> int:
    """How many kinds were looked for."""
    return len({f.kind for f in found})
