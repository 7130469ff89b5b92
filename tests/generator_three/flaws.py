"""What can go wrong: one size each, between two limits, in one of several forms whose details are drawn once.

Sizes are parts: of the largest deflection for lengths, of the sound film's largest force for forces, of their ratio for
a compliance, of the free length for a slip; `SizeUnit.si` makes metres and newtons of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class SizeUnit:
    """A unit of sizes and, of a test's free length, largest deflection (mm) and largest force (N), what 1 is in it."""

    name: str
    si: Callable[[float, float, float], float]


NUMBER = SizeUnit("-", lambda free, peak, force: 1.0)
NEWTON = SizeUnit("N", lambda free, peak, force: force)
METRE = SizeUnit("m", lambda free, peak, force: 1e-3 * peak)
COMPLIANCE = SizeUnit("m/N", lambda free, peak, force: 1e-3 * peak / force)
SLIP = SizeUnit("m", lambda free, peak, force: 1e-3 * free)


@dataclass(frozen=True)
class FlawKind:
    """unit, limits of the size, whether it may be negative, and the forms with their formulas."""

    unit: SizeUnit
    limits: tuple[float, float]
    signed: bool
    forms: Mapping[str, str]


@dataclass(frozen=True)
class Flaw:
    """One of them at work."""

    name: str
    size: float
    form: str
    details: Mapping[str, Any]


SLID = "; the film's outer radius at rest is greater by s, to first order, and a slack film carries nothing"
FLAWS: dict[str, FlawKind] = {
    "viscoelastic": FlawKind(
        NUMBER,
        (0.004, 0.7),
        False,
        {
            "prony1": "quasi-linear on the elastic force, G = 1 - g + g exp(-t/tau)",
            "prony3": "quasi-linear, three terms of Prony's series",
            "power": "quasi-linear, G = 1 - g + g (1 + t/tau)^-n",
            "colecole": "quasi-linear, G = 1 - g + g/(1 + (t/tau)^n)",
        },
    ),
    "hysteresis": FlawKind(
        NUMBER,
        (0.001, 1.2),
        False,
        {
            "slider": "F = Fe + h stop(Fe), stop of threshold y/2 of the largest force",
            "iwan": "F = Fe + h mean of five stops with thresholds up to y/2",
            "direction": "F = Fe (1 + h chi), chi follows the direction of motion over a length dc of the peak",
        },
    ),
    "mullins": FlawKind(
        NUMBER,
        (0.004, 0.7),
        False,
        {
            "ogden_roxburgh": "F = Fe (1 - a erf((Wm - W)/(m W0 + beta Wm))), W the energy of the whole film",
            "reload_factor": "F = Fe (1 - a (1 - (d/dm)^q)) below the largest deflection so far",
            "damage": "F = Fe (1 - a (1 - exp(-dm/ds))/(1 - exp(-1/ds))), dm the largest so far in peaks",
        },
    ),
    "permanent_set": FlawKind(
        NUMBER,
        (0.001, 0.25),
        False,
        {
            "remap": "slack s = k dm once the film comes back; d_eff = (d - s) dm/(dm - s), none at the peak",
            "flow": "d_eff = d - k (dm - dy)+, the slack grows while loading goes on beyond dy",
            "length": "d_eff = sqrt(d^2 - s^2)+, s^2 = k dm (dm - dy)+",
        },
    ),
    "friction": FlawKind(
        NEWTON,
        (2e-4, 0.2),
        False,
        {
            "coulomb": "Fc against motion",
            "dahl": "Fc against motion, reached over a length dc of the peak",
            "load": "Fc (1 + mu |F|/Fpeak) against motion",
        },
    ),
    "machine_compliance": FlawKind(
        COMPLIANCE,
        (3e-4, 0.12),
        False,
        {
            "linear": "read = true + C F",
            "hardening": "read = true + C F/(1 + h F/Fpeak)",
            "power": "read = true + C F^q, in parts of the largest",
        },
    ),
    "clamp_slip": FlawKind(
        SLIP,
        (1e-4, 0.1),
        False,
        {
            "ratchet": "s = k (largest force so far - fc)+" + SLID,
            "creep": "ds/dt in proportion to (F - fc)+" + SLID,
            "events": "sudden slips when the force exceeds a level for the first time" + SLID,
        },
    ),
    "force_drift": FlawKind(
        NEWTON,
        (3e-4, 0.3),
        True,
        {
            "linear": "a t/T",
            "saturating": "a (1 - exp(-t/(tau T)))/(1 - exp(-1/tau))",
            "sqrt": "a sqrt(t/T)",
        },
    ),
    "force_offset": FlawKind(NEWTON, (3e-4, 0.3), True, {"constant": "a"}),
    "zero_offset": FlawKind(METRE, (2e-4, 0.06), True, {"constant": "true deflection = read - z"}),
    "prestretch": FlawKind(
        NUMBER, (0.01, 0.1), False, {"equibiaxial": "radii at rest R/(1 + size); the thickness is that at rest"}
    ),
    "rate": FlawKind(
        NUMBER,
        (0.002, 0.35),
        False,
        {
            "log": "F (1 + b log10(v/v0))",
            "power": "F (v/v0)^(b/ln 10)",
            "asinh": "F (1 + b (asinh(v/v*) - asinh(v0/v*))/ln 10)",
        },
    ),
    "tearing": FlawKind(
        NUMBER,
        (0.003, 0.4),
        False,
        {
            "sudden": "F (1 - a) from t0 on",
            "progressive": "F (1 - a (1 - exp(-(t - t0)/(tau T))))",
            "under_load": "the loss grows to a with the time after t0 spent beyond 0.6 of the peak",
        },
    ),
    # What no library of effects holds.
    "ripple": FlawKind(
        METRE,
        (1e-4, 0.03),
        False,
        {"screw": "the drive errs periodically with its position", "time": "the drive errs periodically with time"},
    ),
    "clipped": FlawKind(NUMBER, (0.005, 0.5), False, {"clip": "the load cell ends at 1 - a of the largest force"}),
    "temperature_step": FlawKind(
        NEWTON, (5e-4, 0.25), True, {"step": "a (1 - exp(-(t/T - t0)/rise)) from t0 on: the load cell's zero moves"}
    ),
    "backlash": FlawKind(METRE, (3e-4, 0.08), False, {"play": "the film follows once the play is used up"}),
}
FOREIGN = ("ripple", "clipped", "temperature_step", "backlash")
EFFECTS = tuple(k for k in FLAWS if k not in FOREIGN)
LOADING = (
    *("viscoelastic", "machine_compliance", "clamp_slip", "force_drift"),
    *("force_offset", "zero_offset", "prestretch", "tearing"),
)
"""What loading alone can show."""


def clash(flaws: list[Flaw]) -> bool:
    """Whether two of them are one and the same thing in these forms."""
    forms = {f.name: f.form for f in flaws}

    def both(**asked: str) -> bool:
        return all(forms.get(name) == form for name, form in asked.items())

    return (
        both(friction="load", hysteresis="direction")
        or both(mullins="damage", tearing="under_load")
        or both(permanent_set="flow", clamp_slip="ratchet")
        or {"force_drift", "temperature_step"} <= forms.keys()
    )
