"""What the rig adds: play and ripple of the drive, slack in the hook, a frame that yields, rubbing, and the load cell.

Lengths of the drive are in mm; forces at the load cell are in parts of the sound film's largest.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from tests.generator_four.courses import DriveCourse
from tests.generator_four.faults import FaultAtWork
from tests.generator_four.loss_laws import stopped

SHARPNESS = 40.0  # of a load cell that goes into its stop softly


def rippled(fault: FaultAtWork, at: Any, peak: float) -> Any:
    """(N,) mm of the disc: at + a sin(2 pi at / pitch), or with half a wave of twice the pitch beside it."""
    angle = 2 * np.pi * at / (fault.details["pitch"] * peak)
    phase = fault.details["phase"]
    wave = np.sin(angle + phase) - np.sin(phase)
    if fault.form == "two_start":
        wave = 0.6 * wave + 0.5 * np.sin(angle / 2)
    return at + fault.size * peak * wave


def lost_motion(fault: FaultAtWork, at: Any, peak: float) -> Any:
    """(N,) mm of the disc: where it is read on the way up; on the way back it waits until the nut's gap is gone."""
    gap = fault.size * peak
    out, x = np.zeros(len(at)), at[0]
    for i, read in enumerate(at.tolist()):
        x = min(max(x, read), read + gap)
        out[i] = x
    return out


def hooked(fault: FaultAtWork, at: Any, peak: float) -> Any:
    """(N,) mm of the film: at - s; seated gradually: w ln((1 + exp((at - s) / w)) / (1 + exp(-s / w)))."""
    s = fault.size * peak
    if fault.form == "hook" or s == 0:
        return at - s
    w = fault.details["rounding"] * s
    return w * (np.logaddexp(0, (at - s) / w) - np.logaddexp(0, -s / w))


def yielding(fault: FaultAtWork, part: Any) -> Any:
    """(N,) what the frame yields at F/top, over what it yields at 1.

    linear : f; contact : (1 - c) f + c f^(2/3), of rounded seats; take_up : (1 - c) f + c (1 - exp(-f / f0)), of
    threads and pins that are pulled to one side first.
    """
    d = fault.details
    if fault.form == "contact":
        # The power is bent over below a hundredth, where its slope has no bound.
        return (1 - d["share"]) * part + d["share"] * part / np.cbrt(abs(part) + 0.01)
    if fault.form == "take_up":
        held = np.maximum(part, 0)
        return (1 - d["share"]) * part + d["share"] * -np.expm1(-held / d["force"])
    return part


def rubbing(fault: FaultAtWork, course: DriveCourse, part: Any) -> Any:
    """(N,) F/top that the guide takes, against the motion.

    stribeck : one bristle of a length, and more where it is slow, 1 + static exp(-|v| / v_s); side_load : it grows with
    the force; maxwell_slip : four bristles in parallel, of different lengths.
    """
    d, peak = fault.details, course.at.max()
    way = course.at / peak
    if fault.form == "maxwell_slip":
        return fault.size * np.mean([stopped(way, x) / x for x in d["lengths"]], axis=0)
    bent = fault.size * stopped(way, d["length"]) / d["length"]
    if fault.form == "side_load":
        return bent * (1 + d["grows"] * np.maximum(part, 0))
    mean = abs(np.diff(course.at)).sum() / course.lasts
    return bent * (1 + d["static"] * np.exp(-abs(course.speed) / (d["speed"] * mean)))


def drifted(fault: FaultAtWork, clock: Any) -> Any:
    """(N,) F/top: in proportion to time; 1 - exp(-t / T), warming up; or a smooth random walk of four steps.

    Each is scaled so that it goes as far as the size says.
    """
    d = fault.details
    if fault.form == "linear":
        return fault.size * clock
    if fault.form == "warm_up":
        return fault.size * np.expm1(-clock / d["time"]) / np.expm1(-1 / d["time"])
    walk = CubicSpline(np.linspace(0, 1, 5), np.concatenate([[0], np.cumsum(d["knots"])]))(clock)
    return fault.size * walk / abs(walk).max()


def jumped(fault: FaultAtWork, clock: Any) -> Any:
    """(N,) F/top: the zero is another one from a moment on, for good (knock) or for a while (lasting_knock)."""
    begun = clock >= fault.details["at"]
    if fault.form == "lasting_knock":
        begun = begun & (clock < fault.details["at"] + fault.details["until"])
    return fault.size * begun


def draughty(fault: FaultAtWork, clock: Any) -> Any:
    """(N,) F/top: the load cell is warmed from a moment on, to a new rest (step) or back again (gust)."""
    since = np.maximum(clock - fault.details["at"], 0) / fault.details["time"]
    return fault.size * (since * np.exp(1 - since) if fault.form == "gust" else -np.expm1(-since))


def stopped_short(fault: FaultAtWork, part: Any) -> Any:
    """(N,) F/top: nothing beyond 1 - size; soft : the stop is felt before.

    At size 0 nothing is cut off.
    """
    if fault.size == 0:
        return part
    limit = 1 - fault.size
    if fault.form == "hard":
        return np.minimum(part, limit)
    return part - np.logaddexp(0, SHARPNESS * (part - limit)) / SHARPNESS
