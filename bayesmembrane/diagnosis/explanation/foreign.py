"""What no effect of the library describes: steps, waves, play of the drive, a load cell at its limit, or nothing known.

Each kind is a family of traces; the evidence of the kind is the mean over its members, each with its size integrated
out beside all that the model can follow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.evidence import Block, extended, weighed
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.explanation.limit import limit_of
from bayesmembrane.diagnosis.thresholds import FOREIGN
from bayesmembrane.ground.parameters import Array

SUDDEN, WAVE, PLAY, CLIPPED, UNNAMED = "sudden_change", "ripple", "play", "clipped", "unnamed"
KINDS = (SUDDEN, WAVE, PLAY, CLIPPED, UNNAMED)


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
    period : of a wave, s or m
    against : "time" or "deflection": what a wave repeats with
    share : part of the squares that the model leaves, which it takes away
    trace : (N,) N, what it changes
    """

    kind: str
    base: Candidate
    gain: float
    chance: float = 0.0
    size: float = 0.0
    relative: bool = False
    place: int = 0
    moment: float | None = None
    period: float = 0.0
    against: str = ""
    share: float = 0.0
    trace: Array | None = None

    def counted(self, counts: float) -> float:
        """ln of the Bayes factor of which a part ``counts``: laws may be off, yet not where a thing could have been."""
        return counts * (self.gain - self.chance) + self.chance


@dataclass(frozen=True, eq=False)
class _Family:
    """Traces (N, m) of one unit of their expected size, in groups of ``width`` that act together; in N."""

    kind: str
    traces: Array
    width: int = 1


def foreign(search: Search, base: Candidate) -> list[Foreign]:
    """Every kind that can be looked for beside ``base``."""
    m = search.measurement
    if len(m) < FOREIGN.least_points:
        return []
    model = search.linear(base)
    # Beside noise and form error as they are expected: what is foreign has driven the fitted ones up.
    plain = np.minimum(base.theta, model.priors[:, 0])
    data = model.data[:, None]
    out = []
    for family in _families(m, base):
        white = search.noise.white(family.traces)
        freed = model.freed(plain, white)
        gains = _gains(freed, white, freed.T @ data[:, 0], family.width)
        best = int(np.argmax(gains))
        columns = white[:, best * family.width : (best + 1) * family.width]
        spread = float(np.logaddexp.reduce(gains) - np.log(gains.size) - gains[best])
        wider = extended(model, [Block(columns)])
        z = weighed(wider, base.theta)
        mean, _ = wider.coefficients(z.theta)
        trace = family.traces[:, best * family.width : (best + 1) * family.width] @ mean[-family.width :]
        gain = z.log_evidence - weighed(model, base.theta).log_evidence + spread
        found = Foreign(family.kind, base, gain, spread, trace=trace, share=_share(search, base, trace))
        out.append(_with_size(m, found, best, float(mean[-family.width])))
    out += [f for f in (_unnamed(search, base), _clipped(search, base)) if f is not None]
    return out


def _gains(freed: Array, white: Array, along: Array, width: int) -> Array:
    """(m,) ln K of each group of ``width`` columns s: r^T P s (1 + s^T P s)^-1 s^T P r / 2 - ln |1 + s^T P s| / 2."""
    n, count = white.shape
    a = along.reshape(count // width, width)
    f, w = (v.reshape(n, count // width, width) for v in (freed, white))
    gram = np.einsum("nmi,nmj->mij", w, f) + np.eye(width)
    solved = np.linalg.solve(gram, a[:, :, None])[:, :, 0]
    return np.asarray(0.5 * np.sum(a * solved, axis=1) - 0.5 * np.linalg.slogdet(gram)[1])


# ---- families --------------------------------------------------------------------------------------------------------


def _families(m: Measurement, base: Candidate) -> list[_Family]:
    out = [_Family(SUDDEN, _steps(m, base)), _Family(WAVE, _waves(m), 2)]
    if np.any(m.leg < 0):
        out.append(_Family(PLAY, _plays(m, base)))
    return out


def _places(m: Measurement) -> Array:
    n = len(m)
    ends = (FOREIGN.margin * n, (1 - FOREIGN.margin) * n)
    return np.unique(np.linspace(*ends, min(FOREIGN.places, n)).astype(int))


def _steps(m: Measurement, base: Candidate) -> Array:
    """Steps of the force that take several times: by a constant first, then by a factor."""
    clock = m.path.clock[m.on_path]
    since = (clock[:, None] - clock[_places(m)]) / np.ptp(clock)
    after = np.concatenate([expit(since / width) for width in FOREIGN.widths], axis=1)
    fitted = m.force - base.residual
    largest = float(np.max(np.abs(m.force)))
    return FOREIGN.size * np.concatenate([after * largest, after * fitted[:, None]], axis=1)


def _frequencies(m: Measurement) -> Array:
    most = len(m) / 2
    return np.linspace(FOREIGN.least_waves, max(most, FOREIGN.least_waves + 1), FOREIGN.waves)


def _waves(m: Measurement) -> Array:
    """Cosines and sines over the readings' time, then over the deflection where the disc does not stand still."""
    size = FOREIGN.size / 3 * float(np.max(np.abs(m.force)))
    places = [m.path.clock[m.on_path]] + ([] if m.holds else [m.deflection])
    phase = np.concatenate([_phase(p, _frequencies(m)) for p in places], axis=1)
    both = np.stack([np.cos(phase), np.sin(phase)], axis=2)
    return np.asarray(size * both.reshape(len(m), -1))


def _phase(place: Array, frequencies: Array) -> Array:
    span = float(np.ptp(place)) or 1.0  # where the disc stands still, nothing repeats with the deflection
    return np.asarray(2 * np.pi * ((place - place.min()) / span)[:, None] * frequencies)


def _plays(m: Measurement, base: Candidate) -> Array:
    """-dF/d(deflection) times how far a play of the drive is taken up: 0 on loading, 1 on unloading."""
    path = m.path
    fitted = m.force - base.residual
    slope = _slope(m.deflection, fitted)
    out = []
    for part in FOREIGN.plays:
        travel = part * path.full_range
        lag = np.zeros(path.deflection.size)
        for i in range(1, lag.size):
            kept = np.exp(-path.steps[i] / travel)
            lag[i] = lag[i - 1] * kept + (1 - kept) * (path.leg[i] < 0)
        out.append(slope * lag[m.on_path])
    return FOREIGN.play * path.full_range * np.column_stack(out)


def _slope(deflection: Array, force: Array) -> Array:
    """(N,) N/m: slope of a smooth curve through the fitted forces against the deflection."""
    order = np.argsort(deflection, kind="stable")
    most = min(9, max(np.unique(deflection).size // 6, 1))
    fit, _ = np.polynomial.Chebyshev.fit(deflection[order], force[order], most, full=True)  # of few places: no warning
    return np.asarray(fit.deriv()(deflection))


def _with_size(m: Measurement, found: Foreign, best: int, coefficient: float) -> Foreign:
    """With what the most probable member says of itself."""
    if found.kind == PLAY:
        return replace(found, size=abs(coefficient) * FOREIGN.play * m.path.full_range)
    if found.kind == WAVE:
        number, count = best, FOREIGN.waves
        against = "time" if number < count else "deflection"
        span = float(np.ptp(m.path.clock[m.on_path] if against == "time" else m.deflection))
        period = span / float(_frequencies(m)[number % count])
        assert found.trace is not None
        return replace(found, size=float(np.max(np.abs(found.trace))), period=period, against=against)
    places = _places(m)
    place = int(places[best % places.size])
    relative = best >= len(FOREIGN.widths) * places.size
    scale = 1.0 if relative else float(np.max(np.abs(m.force)))
    moment = None if m.time is None else float(m.time[place])
    return replace(found, size=coefficient * FOREIGN.size * scale, relative=relative, place=place, moment=moment)


def _share(search: Search, base: Candidate, trace: Array) -> float:
    """Part of the squares, beside the model's own slopes, that a trace takes away."""
    white = search.noise.white(np.column_stack([base.slopes, trace, base.residual]))
    q, _ = np.linalg.qr(white[:, :-2])
    t, r = (white[:, i] - q @ (q.T @ white[:, i]) for i in (-2, -1))
    return float((t @ r) ** 2 / max(float(t @ t) * float(r @ r), 1e-300))


# ---- kinds of their own ----------------------------------------------------------------------------------------------


def _unnamed(search: Search, base: Candidate) -> Foreign | None:
    """A smooth relative error of the whole curve along the test: memory of a kind that is not in the library."""
    fitted = search.measurement.force - base.residual
    columns = search.noise.white(fitted[:, None] * search.factors.progress)
    model = search.linear(base)
    wider = extended(model, [Block(columns, FOREIGN.ln_unnamed)])
    z = weighed(wider)
    mean, _ = wider.coefficients(z.theta)
    trace = fitted * (search.factors.progress @ mean[-columns.shape[1] :])
    gain = z.log_evidence - weighed(model, base.theta).log_evidence
    share = _share(search, base, trace)
    return Foreign(UNNAMED, base, gain, size=float(np.exp(z.theta[-1])), relative=True, share=share, trace=trace)


def _clipped(search: Search, base: Candidate) -> Foreign | None:
    """A load cell at its limit."""
    found = limit_of(search, base)
    return None if found is None else Foreign(CLIPPED, base, found.gain, size=found.force, place=found.first)


def kinds_of(found: Sequence[Foreign]) -> int:
    """How many kinds were looked for."""
    return len({f.kind for f in found})
