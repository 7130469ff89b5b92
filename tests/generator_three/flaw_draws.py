"""A flaw drawn at random: a size to begin with, a sign, a form, and the details of its kind, always in this order."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from tests.generator_three.flaws import FLAWS, Flaw
from tests.generator_three.journey import Journey
from tests.generator_three.materials import log_uniform

Details = Mapping[str, Any]


def _relaxing(rng: np.random.Generator, form: str, journey: Journey, peak: float) -> Details:
    tau = journey.time[-1] * log_uniform(rng, 0.008, 0.3)
    times, weights = [tau], [1.0]
    if form == "prony3":
        times = [tau * x for x in (0.15, 1, log_uniform(rng, 4, 12))]
        weights = [float(w) for w in np.round(rng.dirichlet([3, 3, 3]), 3)]
    exponent = rng.uniform(0.15, 0.6) if form == "power" else rng.uniform(0.4, 0.8)
    return {"tau": [float(t) for t in times], "weights": weights, "exponent": exponent}


def _looping(rng: np.random.Generator, form: str, journey: Journey, peak: float) -> Details:
    y = rng.uniform(0.08, 0.35) if form == "slider" else rng.uniform(0.4, 0.9)
    return {"y": y, "dc": rng.uniform(0.05, 0.2)}


def _softening(rng: np.random.Generator, form: str, journey: Journey, peak: float) -> Details:
    u = rng.uniform
    return {"m": u(0.05, 0.4), "beta": u(0, 0.3), "q": u(0.5, 2), "ds": u(0.3, 1)}


def _rubbing(rng: np.random.Generator, form: str, journey: Journey, peak: float) -> Details:
    return {"dc": rng.uniform(0.01, 0.05) if form == "dahl" else 0.003, "mu": rng.uniform(1, 4)}


def _slipping(rng: np.random.Generator, form: str, journey: Journey, peak: float) -> Details:
    fc, count = rng.uniform(0.35, 0.75), int(rng.integers(1, 4))
    return {"fc": fc, "events": sorted(float(x) for x in rng.uniform(0.45, 0.95, count))}


def _quickening(rng: np.random.Generator, form: str, journey: Journey, peak: float) -> Details:
    slowest = journey.speeds[0]
    return {"v0": slowest, "v_star": slowest * rng.uniform(1, 5)}


def _tearing(rng: np.random.Generator, form: str, journey: Journey, peak: float) -> Details:
    """It begins under load, and neither at the start nor at the end."""
    tau, whole = rng.uniform(0.02, 0.2), journey.time[-1]
    loaded = (journey.at > 0.6 * peak) & (journey.time > 0.15 * whole) & (journey.time < 0.85 * whole)
    return {"tau": tau, "t0": float(journey.time[int(rng.choice(np.nonzero(loaded)[0]))])}


def _rippling(rng: np.random.Generator, form: str, journey: Journey, peak: float) -> Details:
    return {"period": rng.uniform(0.04, 0.15) if form == "screw" else rng.uniform(0.02, 0.08)}


_DETAILS: dict[str, Callable[[np.random.Generator, str, Journey, float], Details]] = {
    "viscoelastic": _relaxing,
    "hysteresis": _looping,
    "mullins": _softening,
    "permanent_set": lambda rng, *_: {"dy": rng.uniform(0.1, 0.4)},
    "friction": _rubbing,
    "machine_compliance": lambda rng, *_: {"h": rng.uniform(0.3, 1.5), "q": rng.uniform(0.6, 0.85)},
    "clamp_slip": _slipping,
    "force_drift": lambda rng, *_: {"tau": rng.uniform(0.1, 0.6)},
    "rate": _quickening,
    "tearing": _tearing,
    "ripple": _rippling,
    "temperature_step": lambda rng, *_: {"t0": rng.uniform(0.2, 0.8), "rise": rng.uniform(0.0, 0.03)},
}


def draw_flaw(rng: np.random.Generator, name: str, journey: Journey, peak: float) -> Flaw:
    """Size to begin with, sign, form and details of one kind, for a test up to ``peak`` (mm)."""
    kind = FLAWS[name]
    size = log_uniform(rng, *kind.limits) ** 0.5 * kind.limits[1] ** 0.5 * 0.5
    sign = float(rng.choice([-1, 1]))
    form = str(rng.choice(list(kind.forms))) if len(kind.forms) > 1 else next(iter(kind.forms))
    details = _DETAILS[name](rng, form, journey, peak) if name in _DETAILS else {}
    if name == "prestretch":
        size = rng.uniform(0.01, 0.08)
    return Flaw(name, size * sign if kind.signed else size, form, details)
