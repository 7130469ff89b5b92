"""Whether a test, or several, show anything at another speed."""

from __future__ import annotations

import numpy as np

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.thresholds import TWINS


def one_speed(*measurements: Measurement) -> bool:
    """True if the disc moved at one speed, within `TWINS.speeds`, and never stood still; also where nobody timed it.

    Of several tests with ranges of their own, the speed is how much of its range each goes through in a second.
    """
    timed = [m for m in measurements if m.time is not None]
    each = [v for m in timed for v in _speeds(m)]
    return not any(m.has_pauses for m in timed) and (len(each) < 2 or max(each) < TWINS.speeds * min(each))


def _speeds(measurement: Measurement) -> list[float]:
    """1/s, those of the parts of every leg over the largest deflection."""
    leg = np.cumsum(np.abs(np.diff(measurement.leg, prepend=measurement.leg[0])) > 0)
    speed = measurement.path.speed[measurement.on_path] / np.max(np.abs(measurement.deflection))
    legs = [speed[leg == n] for n in np.unique(leg)]
    parts = [p for own in legs for p in np.array_split(own, max(1, min(TWINS.parts, own.size // TWINS.readings)))]
    return [float(np.median(p)) for p in parts if p.size >= TWINS.readings]
