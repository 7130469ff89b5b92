"""What happens to the film and its clamp: set, slip, softening, and tears. All are functions of the path so far.

Every law is nothing at size 0. Deflections are in mm, forces in N.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import erf

from tests.generator_four.courses import DriveCourse
from tests.generator_four.faults import FaultAtWork


@dataclass(frozen=True)
class FilmScales:
    """free, peak : mm, free length and largest deflection of the test; top, whole : N and N mm, force and energy of the
    sound film there.
    """

    free: float
    peak: float
    top: float
    whole: float


@dataclass(frozen=True, eq=False)
class CarriedLoad:
    """The path of the film, x : (N,) mm, and the curve (N over mm) of one that nothing has happened to."""

    course: DriveCourse
    x: Any
    curve: CubicSpline
    scales: FilmScales

    @cached_property
    def part(self) -> Any:
        """(N,) F / top"""
        return np.maximum(self.curve(self.x), 0) / self.scales.top

    @cached_property
    def energy(self) -> Any:
        """(N,) W / whole"""
        stored = self.curve.antiderivative()
        return np.maximum(stored(self.x) - stored(0), 0) / self.scales.whole

    @cached_property
    def stretch(self) -> Any:
        """(N,) sqrt(L^2 + x^2) - L over that at the peak: how much longer straight meridians are."""
        L, peak = self.scales.free, self.scales.peak
        return (np.hypot(L, self.x) - L) / (np.hypot(L, peak) - L)

    @cached_property
    def sine(self) -> Any:
        """(N,) x / sqrt(L^2 + x^2) over that at the peak, of straight meridians."""
        L, peak = self.scales.free, self.scales.peak
        return self.x / np.hypot(L, self.x) * np.hypot(L, peak) / peak

    @cached_property
    def clock(self) -> Any:
        """(N,) t / duration"""
        return self.course.time / self.course.lasts

    @cached_property
    def spans(self) -> Any:
        """(N,) of the clock since the reading before."""
        return np.diff(self.clock, prepend=0)


def set_by_flow(fault: FaultAtWork, load: CarriedLoad) -> Any:
    """(N,) mm: w' = (size peak F/top - w) / delay while that is more than w; else part of w heals.

    A film that is let go keeps ``stays`` of the largest w, the rest heals in a time of its own.
    """
    d, size = fault.details, fault.size * load.scales.peak
    out, w, most = np.zeros(len(load.x)), 0.0, 0.0
    flows = 1 - np.exp(-load.spans / d["delay"])
    heals = 1 - np.exp(-load.spans / d["heals"])
    for i, target in enumerate(size * load.part):
        if target > w:
            w += flows[i] * (target - w)
            most = max(most, w)
        else:
            w -= heals[i] * max(w - max(d["stays"] * most, target), 0)
        out[i] = w
    return out


def residual_force(fault: FaultAtWork, load: CarriedLoad) -> Any:
    """(N,) N: size k F'(m) m/2 (1 - (x/m)^bend), m the largest x so far: the film is let go with this push in it.

    It rejoins at m; k = 1 - exp(-returns / cycles) saturates with the returns begun.
    """
    most = np.maximum.accumulate(np.maximum(load.x, 0))
    safe = np.maximum(most, 1e-9 * load.scales.peak)
    matured = 1 - np.exp(-load.course.returns / fault.details["cycles"])
    slope = np.maximum(load.curve(most, 1), 0)
    down = 1 - np.clip(load.x / safe, 0, 1) ** fault.details["bend"]
    return fault.size * matured * slope * most / 2 * down


def slipped(fault: FaultAtWork, load: CarriedLoad) -> Any:
    """(N,) from 0 on: how much of the slip has happened.

    pull_out : beyond a grip, at once with the largest <F/top - grip>^power, or in time by its integral; stick_slip : a
    share when the force passes each threshold, which falls a little with every return.
    """
    d = fault.details
    if fault.form == "pull_out":
        beyond = (np.maximum(load.part - d["grip"], 0) / (1 - d["grip"])) ** d["power"]
        at_once = np.maximum.accumulate(beyond)
        return (1 - d["creeps"]) * at_once + d["creeps"] * 2 * np.cumsum(beyond * load.spans)
    tired = load.part / (1 - d["tires"]) ** load.course.returns
    most = np.maximum.accumulate(tired)
    return sum(share * (most >= at) for at, share in zip(d["at"], d["shares"], strict=True))


class LengthenedCone:
    """F(x, s) = T(q) x / sqrt(L^2 + x^2): a film of free length L of which s mm more have come out of the clamp.

    Meridians are taken as straight: one of length sqrt(L^2 + x^2) that rests at L + s is stretched as one of length L
    that is lifted by sqrt(q), q = L^2 ((L^2 + x^2) / (L + s)^2 - 1). T, without the sine of the slope, goes on to q
    below 0 along its tangent and ends at 0, where the film is slack.
    """

    def __init__(self, curve: CubicSpline, length: float) -> None:
        at = curve.x[curve.x > 0]
        pulls = curve(at) * np.hypot(length, at) / at
        square = at * at
        start = pulls[0] - (pulls[1] - pulls[0]) / (square[1] - square[0]) * square[0]
        self.length = length
        self.pull = CubicSpline(np.concatenate([[0], square]), np.concatenate([[max(start, 0)], pulls]))

    def force(self, x: Any, s: Any) -> Any:
        """(N,) N"""
        L = self.length
        q = L**2 * ((L**2 + x**2) / (L + s) ** 2 - 1)
        tangent = self.pull(0) + self.pull(0, 1) * q
        pull = np.where(q > 0, self.pull(np.maximum(q, 0)), tangent)
        return np.maximum(pull, 0) * x / np.hypot(L, x)


def softened(fault: FaultAtWork, load: CarriedLoad) -> Any:
    """(N,) factor of the force, with E the energy, E_m its largest so far, both parts of the whole test's.

    roxburgh : 1 - size erf((E_m - E) / (m + beta E_m)); dorfmann : 1 - size tanh((E_m - E) / m (1 / (0.05 + E_m))^p);
    broken_chains : 1 - size P(x_m), P = 1 - exp(-(e_m / scale)^shape), e = x^2 of the largest; a little more each time.
    """
    d = fault.details
    most = np.maximum.accumulate(load.energy)
    if fault.form == "roxburgh":
        return 1 - fault.size * erf((most - load.energy) / (d["m"] + d["beta"] * most))
    if fault.form == "dorfmann":
        scale = d["m"] * (0.05 + most) ** (d["power"] - 0.5)
        return 1 - fault.size * np.tanh((most - load.energy) / scale)
    strain = (np.maximum.accumulate(np.maximum(load.x, 0)) / load.scales.peak) ** 2
    broken = 1 - np.exp(-((strain / d["scale"]) ** d["shape"]))
    return 1 - fault.size * broken * (1 + d["cycles"] * np.log1p(load.course.returns)) / (1 + d["cycles"])


def torn(fault: FaultAtWork, load: CarriedLoad) -> Any:
    """(N,) part of the film that still carries.

    cut : 1 - size c, c' = (W/whole)^power (1 + runs c) in the time under load, Thomas's tearing energy being W times
    the cut; pinholes : each opens when the energy first passes its threshold, and is at its full width soon after.
    """
    d = fault.details
    if fault.form == "cut":
        driven = np.cumsum(load.energy ** d["power"] * load.spans) * (1 + d["power"])
        grown = np.expm1(d["runs"] * driven) / d["runs"] if d["runs"] > 1e-3 else driven
        return np.exp(-fault.size * grown)
    open_ = np.zeros(len(load.x))
    for at, share in zip(d["at"], d["shares"], strict=True):
        passed = np.maximum.accumulate(load.energy) >= at
        if passed.any():
            since = np.maximum(load.clock - load.clock[np.argmax(passed)], 0)
            open_ += share * np.where(passed, 0.5 + 0.5 * (1 - np.exp(-since / d["takes"])), 0)
    return 1 - fault.size * open_
