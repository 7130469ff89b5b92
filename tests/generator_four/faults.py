"""The faults: their forms, what their size is a part of, what is plausible, and what of their shape is drawn.

Times are parts of the test, deflections of the largest, forces of the sound film's largest, unless said otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.generator_four.rubbers import log_between

DEFLECTION, FORCE, LENGTH, PLAIN = "deflection", "force", "free length", "number"


@dataclass(frozen=True)
class FaultKind:
    """forms : of its law; unit : of its size; limits : of its size; signed : it may be negative; upwards : a single
    ramp can show it.
    """

    forms: tuple[str, ...]
    unit: str
    limits: tuple[float, float]
    signed: bool = False
    upwards: bool = False


@dataclass(frozen=True, eq=False)
class FaultAtWork:
    """A fault with its form, its size (a part) and the details of its shape."""

    name: str
    form: str
    size: float
    details: Mapping[str, Any]


FAULTS: dict[str, FaultKind] = {
    "prestretch": FaultKind(("even", "drawn_by_ring"), PLAIN, (5e-4, 0.25), upwards=True),
    "zero_offset": FaultKind(("hook", "seating"), DEFLECTION, (5e-4, 0.09), True, True),
    "permanent_set": FaultKind(("flow", "residual"), DEFLECTION, (1e-3, 0.25)),
    "clamp_slip": FaultKind(("pull_out", "stick_slip"), LENGTH, (3e-4, 0.15), upwards=True),
    "mullins": FaultKind(("roxburgh", "dorfmann", "broken_chains"), PLAIN, (2e-3, 0.7)),
    "hysteresis": FaultKind(("iwan", "bouc_wen"), PLAIN, (1e-3, 0.4)),
    "tearing": FaultKind(("cut", "pinholes"), PLAIN, (1e-3, 0.5), upwards=True),
    "viscoelastic": FaultKind(("prony", "stretched", "logarithmic", "flow"), PLAIN, (3e-3, 0.7), upwards=True),
    "machine_compliance": FaultKind(("linear", "contact", "take_up"), DEFLECTION, (5e-4, 0.4), upwards=True),
    "force_offset": FaultKind(("tare",), FORCE, (2e-4, 0.25), True, True),
    "friction": FaultKind(("stribeck", "side_load", "maxwell_slip"), FORCE, (2e-4, 0.2)),
    "force_drift": FaultKind(("linear", "warm_up", "wander"), FORCE, (3e-4, 0.3), True, True),
    # None of the library's.
    "screw_ripple": FaultKind(("one_start", "two_start"), DEFLECTION, (2e-4, 0.03), upwards=True),
    "lost_motion": FaultKind(("nut",), DEFLECTION, (5e-4, 0.08)),
    "overload": FaultKind(("hard", "soft"), FORCE, (0.01, 0.4), upwards=True),
    "zero_jump": FaultKind(("knock", "lasting_knock"), FORCE, (5e-4, 0.2), True, True),
    "draught": FaultKind(("step", "gust"), FORCE, (5e-4, 0.2), True, True),
}
FOREIGN_FAULTS = ("screw_ripple", "lost_motion", "overload", "zero_jump", "draught")
KNOWN_FAULTS = tuple(name for name in FAULTS if name not in FOREIGN_FAULTS)


def draw_fault(rng: np.random.Generator, name: str) -> FaultAtWork:
    """A fault of a size to begin with."""
    kind = FAULTS[name]
    form = str(rng.choice(kind.forms))
    low, high = kind.limits
    size = log_between(rng, (low * high) ** 0.5, 0.5 * high)
    seated = form == "seating"  # nothing is seated before it is there
    sign = float(rng.choice([-1, 1])) if kind.signed and not seated else 1.0
    return FaultAtWork(name, form, sign * size, _DETAILS.get(name, _nothing)(rng, form))


def _nothing(rng: np.random.Generator, form: str) -> dict[str, Any]:
    return {}


def _set(rng: np.random.Generator, form: str) -> dict[str, Any]:
    flow = {"delay": log_between(rng, 0.02, 0.4), "stays": rng.uniform(0.5, 1), "heals": log_between(rng, 0.1, 2)}
    residual = {"bend": rng.uniform(1, 3), "cycles": rng.uniform(0.4, 1.5)}
    return flow if form == "flow" else residual


def _slip(rng: np.random.Generator, form: str) -> dict[str, Any]:
    if form == "pull_out":
        return {"grip": rng.uniform(0, 0.5), "power": rng.uniform(1, 3), "creeps": rng.uniform(0, 1)}
    events = int(rng.integers(2, 6))
    shares = rng.uniform(0.3, 1, events)
    return {
        "at": np.sort(rng.uniform(0.15, 0.97, events)).tolist(),
        "shares": (shares / shares.sum()).tolist(),
        "tires": rng.uniform(0, 0.12),
    }


def _mullins(rng: np.random.Generator, form: str) -> dict[str, Any]:
    if form == "roxburgh":
        return {"m": rng.uniform(0.02, 0.4), "beta": rng.uniform(0, 0.5)}
    if form == "dorfmann":
        return {"m": rng.uniform(0.05, 0.5), "power": rng.uniform(0.8, 1.5)}
    return {"scale": rng.uniform(0.3, 1.5), "shape": rng.uniform(1, 2.5), "cycles": rng.uniform(0, 0.25)}


def _hysteresis(rng: np.random.Generator, form: str) -> dict[str, Any]:
    if form == "iwan":
        yields = np.geomspace(log_between(rng, 0.005, 0.04), rng.uniform(0.15, 0.6), 6)
        return {"yields": yields.tolist(), "slope": rng.uniform(-0.6, 0.6)}
    return {"length": log_between(rng, 0.01, 0.15), "n": rng.uniform(0.8, 2), "beta": rng.uniform(0.5, 0.9)}


def _tearing(rng: np.random.Generator, form: str) -> dict[str, Any]:
    if form == "cut":
        return {"power": rng.uniform(1, 4), "runs": rng.uniform(0, 2)}
    holes = int(rng.integers(1, 5))
    shares = rng.uniform(0.2, 1, holes)
    return {
        "at": np.sort(rng.uniform(0.2, 0.98, holes)).tolist(),
        "shares": (shares / shares.sum()).tolist(),
        "takes": log_between(rng, 0.002, 0.08),
    }


def _viscoelastic(rng: np.random.Generator, form: str) -> dict[str, Any]:
    if form == "prony":
        terms = int(rng.integers(1, 4))
        shares = rng.uniform(0.3, 1, terms)
        times = np.sort([log_between(rng, 0.005, 2) for _ in range(terms)])
        return {"times": times.tolist(), "shares": (shares / shares.sum()).tolist()}
    if form == "stretched":
        return {"time": log_between(rng, 0.02, 1), "beta": rng.uniform(0.3, 0.8)}
    if form == "logarithmic":
        return {"shortest": log_between(rng, 1e-4, 1e-2)}
    return {"time": log_between(rng, 0.03, 1), "power": rng.uniform(1.5, 4), "stress": rng.uniform(0.1, 0.5)}


def _compliance(rng: np.random.Generator, form: str) -> dict[str, Any]:
    return {
        "linear": {},
        "contact": {"share": rng.uniform(0.2, 0.8)},
        "take_up": {"share": rng.uniform(0.2, 0.7), "force": rng.uniform(0.03, 0.2)},
    }[form]


def _friction(rng: np.random.Generator, form: str) -> dict[str, Any]:
    first = log_between(rng, 5e-4, 0.01)
    return {
        "stribeck": {"length": first, "static": rng.uniform(0.05, 0.6), "speed": log_between(rng, 0.1, 1)},
        "side_load": {"length": first, "grows": rng.uniform(0.3, 3)},
        "maxwell_slip": {"lengths": np.geomspace(first, rng.uniform(0.02, 0.08), 4).tolist()},
    }[form]


def _drift(rng: np.random.Generator, form: str) -> dict[str, Any]:
    return {
        "linear": {},
        "warm_up": {"time": log_between(rng, 0.1, 1)},
        "wander": {"knots": (0.6 + rng.standard_normal(4)).tolist()},
    }[form]


_DETAILS: dict[str, Callable[[np.random.Generator, str], dict[str, Any]]] = {
    "zero_offset": lambda rng, form: {"rounding": rng.uniform(0.15, 0.5)} if form == "seating" else {},
    "permanent_set": _set,
    "clamp_slip": _slip,
    "mullins": _mullins,
    "hysteresis": _hysteresis,
    "tearing": _tearing,
    "viscoelastic": _viscoelastic,
    "machine_compliance": _compliance,
    "friction": _friction,
    "force_drift": _drift,
    "screw_ripple": lambda rng, form: {"pitch": rng.uniform(0.04, 0.3), "phase": rng.uniform(0, 6.28)},
    "zero_jump": lambda rng, form: {"at": rng.uniform(0.1, 0.9), "until": rng.uniform(0.15, 0.5)},
    "draught": lambda rng, form: {"at": rng.uniform(0.05, 0.8), "time": log_between(rng, 0.01, 0.1)},
}
