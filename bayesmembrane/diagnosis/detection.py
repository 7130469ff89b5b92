"""Is anything missing? Three tests, since each is blind where another sees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lombscargle

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates import Candidate
from bayesmembrane.diagnosis.saturated import SPLINE, LackOfFit, lack_of_fit
from bayesmembrane.diagnosis.scores import ScoreTest, Signature, score_test
from bayesmembrane.diagnosis.whitening import OwnNoise, orthonormal
from bayesmembrane.ground.parameters import Array

LEVEL = 0.01
"""A curve is adequate unless the smallest p-value, times the number of tests, lies below this."""
LEAST_WAVES, FEWEST = 4.0, 60  # waves over the range, and points, for a periodicity to be looked for
TOP = 5  # of the periodogram's peaks: how many are judged exactly
SLOWEST_PART = 0.06  # of the frequencies against time: legs have smooth references of their own


@dataclass(frozen=True)
class Periodicity:
    """The strongest wave in what no smooth curve explains, and the probability of one as strong in noise.

    against : "time" or "deflection"
    period : s or m (points, where there are no times)
    share : part of the variance in that wave
    squares : its squares over the variance of the noise
    """

    against: str
    period: float
    share: float
    p_value: float
    squares: float = 0.0


@dataclass(frozen=True)
class Detection:
    """What the tests say of one model. ``p_value`` is the smallest, corrected for their number."""

    lack_of_fit: LackOfFit
    score: ScoreTest
    periodicity: Periodicity | None

    @property
    def p_value(self) -> float:
        every = [self.lack_of_fit.p_value, self.score.p_value]
        if self.periodicity is not None:
            every.append(self.periodicity.p_value)
        return float(min(1.0, len(every) * min(every)))

    @property
    def adequate(self) -> bool:
        """True if nothing is seen to be missing."""
        return self.p_value > LEVEL


def detect(
    measurement: Measurement,
    model: Candidate,
    basis: Array,
    found: Sequence[Signature],
    noise: OwnNoise,
    rng: np.random.Generator,
) -> Detection:
    """Lack of fit, largest score and periodicity of one model, with a correlation that allows for its error."""
    careful = noise.cautious()
    return Detection(
        lack_of_fit(model.residual, model.slopes, basis, careful),
        score_test(model.residual, found, careful, rng),
        periodicity(measurement, model.residual, np.column_stack([basis, model.slopes]), careful),
    )


def periodicity(measurement: Measurement, residual: Array, basis: Array, noise: OwnNoise) -> Periodicity | None:
    """The wave that explains most of what is left beside ``basis`` (N, p), against time or against deflection.

    A wave of a frequency chosen beforehand takes the part g ~ Beta(1, (nu - 2) / 2) of the squares of white noise with
    nu = N - p degrees of freedom; of m frequencies the largest has P(g) <= m (1 - g)^((nu - 2) / 2), in the manner of
    R. A. Fisher, Proc. R. Soc. A 125 (1929) 54. None for a curve too short to show waves.
    """
    n = residual.size
    if n < FEWEST:
        return None
    white, q = noise.white(residual), orthonormal(noise.white(basis))
    rest = white - q @ (q.T @ white)
    t = np.arange(n, dtype=float) if measurement.time is None else measurement.time
    found = [_peak(t, rest, q, "time", SLOWEST_PART * n / 2)]
    # Where the disc stands still, all times have one deflection.
    if not measurement.holds:
        found.append(_peak(measurement.deflection, rest, q, "deflection", SPLINE / 2))
    best = min(found, key=lambda f: f.p_value)
    return replace(best, p_value=min(1.0, len(found) * best.p_value))


def _peak(place: Array, rest: Array, q: Array, against: str, least: float) -> Periodicity:
    """The strongest of at least ``least`` waves: what the smooth reference q (N, p) has removed is no evidence."""
    span, freedom = float(np.ptp(place)), rest.size - q.shape[1]
    # As many frequencies as half the points could tell apart, were they evenly spaced.
    waves = np.arange(max(LEAST_WAVES, least), rest.size / 2)
    if span == 0 or waves.size < 2 or freedom < 4:
        return Periodicity(against, np.inf, 0.0, 1.0)
    power = np.asarray(lombscargle(place - place.min(), rest, 2 * np.pi * waves / span))
    share, count = max(
        (_share(2 * np.pi * waves[i] / span * place, rest, q), waves[i]) for i in np.argsort(power)[-TOP:]
    )
    p = min(1.0, waves.size * (1 - share) ** ((freedom - 2) / 2))
    return Periodicity(against, span / float(count), share, float(p), share * float(rest @ rest))


def _share(phase: Array, rest: Array, q: Array) -> float:
    """Part of the squares of ``rest`` (N,) that a wave of ``phase`` (N,) takes, beside q (N, p)."""
    wave = np.column_stack([np.cos(phase), np.sin(phase)])
    own = orthonormal(wave - q @ (q.T @ wave))
    return float(np.sum((own.T @ rest) ** 2) / max(float(rest @ rest), 1e-300))
