"""What the film does to its own force, in this order: set, slip, softening, tearing, loops, relaxation, speed.

Each of these takes the size and the flaw, and returns a deflection or a force, (N,) mm or N.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import erf

from tests.generator_three.flaws import Flaw
from tests.generator_three.journey import Journey
from tests.generator_three.memory import direction_followed, stop_operator

IWAN = np.array([0.05, 0.15, 0.3, 0.6, 1])
LOADED = 0.6  # of the peak: where a tear grows


@dataclass(frozen=True)
class Scales:
    """Of the sound film: free length and largest deflection (mm), force (N) and energy (N mm) there."""

    free: float
    peak: float
    force: float
    work: float


@dataclass(frozen=True, eq=False)
class Carrying:
    """A film at work: force and energy over deflection, slope by the length, and kernel of relaxation if it relaxes."""

    journey: Journey
    scales: Scales
    flaws: Mapping[str, Flaw]
    sizes: Mapping[str, float]
    curve: Callable[[Any], Any]
    energy: Callable[[Any], Any]
    by_length: Callable[[Any], Any] | None
    kernel: Any
    tight: bool

    def force(self, x: Any) -> Any:
        """(N,) N with the disc at (N,) mm."""
        laws = (
            ("clamp_slip", lambda f: self._slipped(f, u)),
            ("mullins", lambda f: self._softened(f, u)),
            ("tearing", self._torn),
            ("hysteresis", lambda f: self._looped(f, x)),
            ("viscoelastic", self._relaxed),
            ("rate", self._quicker),
        )
        u = self._set(x) if self.sizes.get("permanent_set") else x
        force = self.curve(u)
        for name, law in laws:
            if self.sizes.get(name):
                force = law(force)
        return force if self.tight else np.where(x >= 0, np.maximum(force, 0), force)

    def _set(self, x: Any) -> Any:
        flaw, k = self.flaws["permanent_set"], self.sizes["permanent_set"]
        most = np.maximum.accumulate(np.maximum(x, 0))
        if flaw.form == "remap":
            return np.where(x < most, np.maximum(x - k * most, 0) / (1 - k), x)
        beyond = np.maximum(most - flaw.details["dy"] * self.scales.peak, 0)
        if flaw.form == "flow":
            return np.where(x > 0, np.maximum(x - k * beyond, 0), x)
        return np.where(x > 0, np.sqrt(np.maximum(x * x - k * most * beyond, 0)), x)

    def _slipped(self, force: Any, u: Any) -> Any:
        assert self.by_length is not None
        flaw, time = self.flaws["clamp_slip"], self.journey.time
        part, holds = force / self.scales.force, flaw.details["fc"]
        beyond = np.maximum(part - holds, 0)
        if flaw.form == "ratchet":
            slid = np.maximum.accumulate(beyond) / (1 - holds)
        elif flaw.form == "creep":
            slid = np.concatenate([[0], np.cumsum((beyond[1:] + beyond[:-1]) / 2 * np.diff(time))]) / time[-1] * 8
        else:
            most, levels = np.maximum.accumulate(part), flaw.details["events"]
            slid = sum((most > level) * 1.0 for level in levels) / len(levels)
        out = force + self.sizes["clamp_slip"] * self.scales.free * slid * self.by_length(u)
        return out if self.tight else np.where(u > 0, np.maximum(out, 0), out)

    def _softened(self, force: Any, u: Any) -> Any:
        flaw, a = self.flaws["mullins"], self.sizes["mullins"]
        d, most = flaw.details, np.maximum.accumulate(np.maximum(u, 0))
        if flaw.form == "ogden_roxburgh":
            w = self.energy(u) - self.energy(0.0)
            w_most = np.maximum.accumulate(w)
            return force * (1 - a * erf((w_most - w) / (d["m"] * self.scales.work + d["beta"] * w_most)))
        if flaw.form == "reload_factor":
            part = np.where(most > 0, np.clip(abs(u) / np.maximum(most, 1e-12), 0, 1), 1)
            return force * (1 - a * (1 - part ** d["q"]))
        grown, whole = (1 - np.exp(-part / d["ds"]) for part in (most / self.scales.peak, 1))
        return force * (1 - a * grown / whole)

    def _torn(self, force: Any) -> Any:
        flaw, a, time = self.flaws["tearing"], self.sizes["tearing"], self.journey.time
        t0 = flaw.details["t0"]
        if flaw.form == "sudden":
            return force * (1 - a * (time > t0))
        if flaw.form == "progressive":
            since = np.maximum(time - t0, 0) / time[-1]
            return force * (1 - a * (1 - np.exp(-since / flaw.details["tau"])))
        loaded = (self.journey.at > LOADED * self.scales.peak) & (time > t0)
        grown = np.cumsum(loaded * np.diff(time, prepend=0))
        return force * (1 - a * grown / max(grown[-1], 1e-9))

    def _looped(self, force: Any, x: Any) -> Any:
        flaw, h = self.flaws["hysteresis"], self.sizes["hysteresis"]
        y, top = flaw.details["y"], self.scales.force
        if flaw.form == "slider":
            return force + h * stop_operator(force, y * top / 2)
        if flaw.form == "iwan":
            return force + h * sum(stop_operator(force, each * top / 2) for each in y * IWAN) / 5
        return force * (1 + h * direction_followed(x, flaw.details["dc"] * self.scales.peak))

    def _relaxed(self, force: Any) -> Any:
        g = self.sizes["viscoelastic"]
        return (1 - g) * force + g * (force[0] + self.kernel @ np.diff(force))

    def _quicker(self, force: Any) -> Any:
        flaw, b = self.flaws["rate"], self.sizes["rate"]
        v0, v_star = flaw.details["v0"], flaw.details["v_star"]
        v = np.where(self.journey.speed > 0, self.journey.speed, v0)
        if flaw.form == "log":
            return force * (1 + b * np.log10(v / v0))
        if flaw.form == "power":
            return force * (v / v0) ** (b / np.log(10))
        return force * (1 + b * (np.arcsinh(v / v_star) - np.arcsinh(v0 / v_star)) / np.log(10))
