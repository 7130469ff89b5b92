"""Does the residual repeat? It sees waves that no smooth reference follows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.reference.noise import Whitened, orthonormal
from bayesmembrane.diagnosis.reference.smooth import spline_count
from bayesmembrane.diagnosis.thresholds import DETECTION, TINY
from bayesmembrane.ground.parameters import Array


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


def most_waves(measurement: Measurement) -> float:
    """Waves over the range of the deflection that readings tell from slower ones: half as many as these, or as steps.

    Two legs are often read half a step apart: what is smooth on each, and differs between them, repeats from step to
    step there. In a hold a wave stands still like the disc, and without a path there are no steps.
    """
    moving, d = measurement.moving, measurement.deflection
    steps = np.abs(np.diff(d))[moving[1:] & moving[:-1]]
    most = np.count_nonzero(moving) / 2
    if not measurement.rig.has_path or not np.any(steps > 0):
        return most
    return min(most, float(np.ptp(d) / (2 * np.median(steps[steps > 0]))))


def periodicity(measurement: Measurement, model: Whitened) -> Periodicity | None:
    """The wave that explains most of what a model leaves beside the reference, against time or against deflection.

    A wave of a frequency chosen beforehand takes the part g ~ Beta(1, (nu - 2) / 2) of the squares of white noise with
    nu = N - p degrees of freedom; of m frequencies the largest has P(g) <= m (1 - g)^((nu - 2) / 2), in the manner of
    R. A. Fisher, Proc. R. Soc. A 125 (1929) 54. None for a curve too short to show waves.
    """
    n = model.residual.size
    if n < DETECTION.fewest_points:
        return None
    t = np.arange(n, dtype=float) if measurement.time is None else measurement.time
    found = [_strongest(t, model, "time", (DETECTION.slowest_part * n / 2, n / 2))]
    if np.count_nonzero(measurement.moving) >= DETECTION.fewest_moving:
        ends = spline_count(measurement) / 2, most_waves(measurement)
        found.append(_strongest(measurement.deflection, model, "deflection", ends))
    best = min(found, key=lambda f: f.p_value)
    return replace(best, p_value=min(1.0, len(found) * best.p_value))


def _strongest(place: Array, model: Whitened, against: str, ends: tuple[float, float]) -> Periodicity:
    """The strongest of so many waves over the range: of slower ones the smooth reference has taken the evidence."""
    rest, q = model.rest, model.reference
    span, freedom = float(np.ptp(place)), rest.size - q.shape[1]
    waves = np.arange(max(DETECTION.least_waves, ends[0]), ends[1], DETECTION.wave_step)
    if span == 0 or waves.size < 2 or freedom < 4:
        return Periodicity(against, np.inf, 0.0, 1.0)
    from scipy.signal import lombscargle  # on demand: most of a second, and most residuals are not tested

    power = np.asarray(lombscargle(place - place.min(), rest, 2 * np.pi * waves / span))
    highest = np.argsort(power)[-DETECTION.exact_peaks :]
    share, count = max((_share(2 * np.pi * waves[i] / span * place, rest, q), waves[i]) for i in highest)
    p = min(1.0, waves.size * (1 - share) ** ((freedom - 2) / 2))
    return Periodicity(against, span / float(count), share, float(p), share * float(rest @ rest))


def _share(phase: Array, rest: Array, q: Array) -> float:
    """Part of the squares of ``rest`` (N,) that a wave of ``phase`` (N,) takes, beside q (N, p)."""
    wave = np.column_stack([np.cos(phase), np.sin(phase)])
    own = orthonormal(wave - q @ (q.T @ wave))
    return float(np.sum((own.T @ rest) ** 2) / max(float(rest @ rest), TINY))
