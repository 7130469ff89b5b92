"""What goes wrong in an experiment, in forms that no textbook prescribes, and the chain in which it acts.

One `Distortion` per kind: its unit, sign, bound, a small probing size, the forms it takes, and how its details are
drawn. `response` composes them: geometry, deflection, slip, history, convolution and rate, machine, sensor.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.special import expit

from tests.generator.energies import Array
from tests.generator.film import Film
from tests.generator.protocols import Path


@dataclass(frozen=True)
class Active:
    """One distortion at work: size in SI (what it means is the kind's), form, and details of that form."""

    size: float
    form: str
    details: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Scale:
    """Of a test against the usual one, in deflection and in force: what sizes in m and in N are measured by."""

    length: float = 1.0
    force: float = 1.0

    def of(self, unit: str) -> float:
        """By how much a size in ``unit`` is larger."""
        if unit.startswith("m/N"):
            return self.length / self.force
        return {"m": self.length, "N": self.force}.get(unit.partition(" ")[0], 1.0)


USUAL = Scale()


@dataclass(frozen=True)
class Distortion:
    """A kind: unit of its size in SI, whether the sign is free, largest size, probing size, draws per form.

    The sizes are those of the usual test; `Scale.of` says what they are elsewhere.
    """

    name: str
    unit: str
    two_sided: bool
    largest: float
    probe: float
    forms: Mapping[str, Mapping[str, tuple[float, float]]]
    library: bool = True

    def draw(self, rng: np.random.Generator) -> tuple[float, str, dict[str, float]]:
        """(sign, form, details), each detail uniform in its range."""
        sign = float(rng.choice([-1.0, 1.0])) if self.two_sided else 1.0
        form = str(rng.choice(sorted(self.forms)))
        return sign, form, {k: float(rng.uniform(*r)) for k, r in self.forms[form].items()}

    def middle(self, form: str) -> dict[str, float]:
        """Details in the middle of their ranges."""
        return {k: 0.5 * (a + b) for k, (a, b) in self.forms[form].items()}


_GROWTH = {
    "power": {"exponent": (1.3, 3.0)},
    "threshold": {"start": (0.2, 0.6)},
    "logarithm": {"steepness": (2.0, 8.0)},
    "cycles": {"exponent": (1.0, 2.5), "repeat": (0.1, 0.4)},
}

DISTORTIONS = {
    d.name: d
    for d in (
        Distortion("zero_offset", "m", True, 3e-3, 5e-5, {"shift": {}}),
        Distortion("prestretch", "-", False, 0.06, 2e-3, {"equibiaxial": {}}),
        Distortion("force_offset", "N", True, 0.5, 0.01, {"constant": {}}),
        Distortion(
            "force_drift",
            "N at the end",
            True,
            1.0,
            0.01,
            {"power": {"exponent": (0.6, 1.5)}, "saturating": {"time": (0.4, 2.0)}, "square_root": {}},
        ),
        Distortion(
            "machine_compliance",
            "m/N at the largest force",
            False,
            3e-3,
            5e-5,
            {"hardening": {"curvature": (-0.3, 0.3)}, "power": {"exponent": (0.85, 1.15)}},
        ),
        Distortion(
            "clamp_slip",
            "m at the end",
            False,
            2e-3,
            5e-5,
            {k: _GROWTH[k] for k in ("power", "threshold", "cycles")},
        ),
        Distortion(
            "mullins",
            "largest softening",
            False,
            0.6,
            0.01,
            {
                "tanh": {"width": (0.1, 0.4), "memory": (0.3, 1.0)},
                "exponential": {"width": (0.1, 0.4), "memory": (0.3, 1.0)},
                "rational": {"width": (0.1, 0.4), "memory": (0.3, 1.0)},
                "deflection": {"exponent": (1.0, 2.5), "growth": (0.3, 1.2)},
            },
        ),
        Distortion(
            "viscoelastic",
            "share that relaxes",
            False,
            0.7,
            0.01,
            {
                "stretched": {"time": (5.0, 60.0), "exponent": (0.45, 0.85)},
                "cole_cole": {"time": (5.0, 60.0), "exponent": (0.5, 0.9)},
                "two_times": {"time": (4.0, 12.0), "ratio": (6.0, 20.0), "share": (0.3, 0.7)},
            },
        ),
        Distortion(
            "permanent_set",
            "m at the end",
            False,
            5e-3,
            1e-4,
            {k: _GROWTH[k] for k in ("power", "logarithm", "cycles")},
        ),
        Distortion(
            "tearing",
            "lost share at the end",
            False,
            0.6,
            0.005,
            {
                "jumps": {"first": (0.35, 0.6), "second": (0.65, 0.95), "share": (0.3, 0.7)},
                "cycles": {"exponent": (1.0, 2.5), "repeat": (0.1, 0.4)},
            },
        ),
        Distortion(
            "friction",
            "N",
            False,
            0.5,
            0.005,
            {
                "presliding": {"length": (2e-4, 8e-4)},
                "stribeck": {"length": (2e-4, 8e-4), "excess": (0.2, 0.8), "speed": (5e-4, 3e-3)},
                "loaded": {"length": (2e-4, 8e-4), "share": (0.2, 1.0)},
            },
        ),
        Distortion("rate", "per e-fold of speed", False, 0.3, 0.003, {"logarithm": {}, "power": {}, "asinh": {}}),
        Distortion(
            "hysteresis",
            "share",
            False,
            0.7,
            0.01,
            {"proportional": {"length": (0.04, 0.25)}, "lead": {"width": (0.1, 0.5)}},
        ),
        # ---- what no library holds
        Distortion(
            "ripple", "N", False, 0.5, 0.005, {"pitch": {"length": (1.5e-3, 5e-3), "phase": (0.0, 6.28)}}, False
        ),
        Distortion("clipped", "share cut off", False, 0.7, 0.05, {"hard": {}, "soft": {"width": (0.01, 0.03)}}, False),
        Distortion(
            "temperature_step",
            "share of the force",
            True,
            0.5,
            0.01,
            {"step": {"when": (0.3, 0.7), "duration": (2e-3, 0.02)}},
            False,
        ),
        Distortion("backlash", "m", False, 2e-3, 5e-5, {"play": {}}, False),
        Distortion("gain", "share of the force", True, 0.5, 0.01, {"factor": {}}, False),
    )
}
LIBRARY = tuple(d.name for d in DISTORTIONS.values() if d.library)
OUTSIDE = ("ripple", "clipped", "temperature_step", "backlash")


# ---- growth of what the history leaves: 0 at rest, 1 where the protocol ends -----------------------------------------


def growth(active: Active, deflection: Array, path: Path) -> Array:
    """(N,) monotone in time, from the largest deflection so far, or by steps near the peaks."""
    most = np.clip(np.maximum.accumulate(deflection) / path.largest, 0.0, None)
    d = active.details
    if active.form == "power":
        return most ** d["exponent"]
    if active.form == "threshold":
        x = np.clip((most - d["start"]) / (1 - d["start"]), 0.0, None)
        return np.tanh(2 * x) ** 1.5 / np.tanh(2.0) ** 1.5
    if active.form == "logarithm":
        return np.log1p(d["steepness"] * most) / np.log1p(d["steepness"])
    if active.form == "jumps":
        first, second = (expit((most - d[k]) / 0.008) for k in ("first", "second"))
        return d["share"] * first + (1 - d["share"]) * second
    return _by_cycles(d["exponent"], d["repeat"], deflection, path)


def _by_cycles(exponent: float, repeat: float, deflection: Array, path: Path) -> Array:
    """A step in the last 15 % of each loading leg, smaller where the peak has been reached before."""
    total, sum_of_steps, highest = np.zeros_like(deflection), 0.0, 0.0
    for leg in np.unique(path.leg[path.loading]):
        peak = float(path.peak[path.leg == leg][0])
        step = (peak / path.largest) ** exponent * (1.0 if peak > highest else repeat)
        highest = max(highest, peak)
        near = np.where(path.leg == leg, deflection / peak, np.where(path.leg > leg, 2.0, 0.0))
        share = np.clip((np.maximum.accumulate(near) - 0.85) / 0.15, 0.0, 1.0)
        total += step * share**2 * (3 - 2 * share)
        sum_of_steps += step
    return total / sum_of_steps


# ---- material with a memory ------------------------------------------------------------------------------------------


def softening(active: Active, deflection: Array, film: Film, path: Path) -> Array:
    """(N,) factor of the force: 1 on the virgin curve, less below the largest load so far."""
    d = active.details
    if active.form == "deflection":
        most = np.maximum(np.maximum.accumulate(deflection), 1e-9)
        below = 1 - np.clip(deflection / most, 0.0, 1.0) ** d["exponent"]
        return 1 - active.size * below * (most / path.largest) ** d["growth"]
    work = film.stored(deflection)
    most = np.maximum.accumulate(work)
    whole = film.stored(np.array([path.largest]))[0]
    x = (most - work) / (whole * (d["width"] + d["memory"] * most / whole))
    shape: dict[str, Callable[[Array], Array]] = {
        "tanh": np.tanh,
        "exponential": lambda y: -np.expm1(-1.3 * y),
        "rational": lambda y: y / (0.5 + y),
    }
    return 1 - active.size * shape[active.form](x)


def relaxed_share(active: Active, lag: Array) -> Array:
    """1 - k(t) of the relaxing part at lags in s, 0 at first and towards 1 in the end."""
    d = active.details
    x = lag / d["time"]
    if active.form == "stretched":
        return -np.expm1(-(x ** d["exponent"]))
    if active.form == "cole_cole":
        return x ** d["exponent"] / (1 + x ** d["exponent"])
    return -d["share"] * np.expm1(-x) - (1 - d["share"]) * np.expm1(-x / d["ratio"])


def memory(active: Active, time: Array) -> Array:
    """(N, N - 1): what has relaxed at each time of what was added in each step, linear between the samples."""
    grid = (time[-1] - time[0]) * np.linspace(0, 1, 3000) ** 2
    share = relaxed_share(active, grid)
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (share[1:] + share[:-1]) * np.diff(grid))])
    lag = np.interp(np.maximum(time[:, None] - time[None, :], 0.0), grid, integral)
    return np.asarray((lag[:, :-1] - lag[:, 1:]) / np.diff(time))


def convolved(active: Active, force: Array, weight: Array) -> Array:
    """F(t) = F_e(t) - size int (1 - k(t - s)) dF_e(s), ``weight`` from `memory`; slack where that would push."""
    return np.maximum(force - active.size * (weight @ np.diff(force)), 0.0)


def rubbed(length: float, path: Path) -> Array:
    """(N,) what relaxes towards +1 while loading and -1 while unloading, over ``length`` (m)."""
    state = np.zeros(path.deflection.size)
    for i in range(1, state.size):
        way = path.deflection[i] - path.deflection[i - 1]
        goal = np.sign(way)
        state[i] = goal + (state[i - 1] - goal) * np.exp(-abs(way) / length)
    return state


def lead(active: Active, deflection: Array, path: Path) -> Array:
    """(N,) m that friction within the material is ahead on loading and behind on unloading, at any speed: the mean of
    stops that slide at 1/8 to 8/8 of the widest.
    """
    widest = active.details["width"] * path.largest
    total = np.zeros(deflection.size)
    for part in range(1, 9):
        at, last = 0.0, 0.0
        for i, x in enumerate(deflection):
            at = min(max(at + x - last, -widest * part / 8), widest * part / 8)
            last = x
            total[i] += at / 8
    return active.size * total


def rate_factor(active: Active, path: Path) -> Array:
    """(N,) factor of the force against the slowest leg."""
    x = path.speed / np.min(path.speed)
    if active.form == "power":
        return x**active.size
    law = np.log(x) if active.form == "logarithm" else np.arcsinh(2 * x) - np.arcsinh(2.0)
    return 1 + active.size * law


# ---- machine and sensor ----------------------------------------------------------------------------------------------


def give(active: Active, force: Array) -> Array:
    """(N,) m by which the frame yields; ``size`` is the compliance at the largest force."""
    top = max(float(np.max(np.abs(force))), 1e-9)
    x = force / top
    if active.form == "power":
        return active.size * top * np.sign(x) * np.abs(x) ** active.details["exponent"]
    c = active.details["curvature"]
    return active.size * force * (1 + c * x) / (1 + c)


def rubbing(active: Active, force: Array, path: Path) -> Array:
    """(N,) N: towards +1 while loading and -1 while unloading, over a length of presliding."""
    d = active.details
    state = rubbed(d["length"], path)
    if active.form == "stribeck":
        state = state * (1 + d["excess"] * np.exp(-path.speed / d["speed"]))
    if active.form == "loaded":
        state = state * (1 + d["share"] * np.abs(force) / np.max(np.abs(force)))
    return active.size * state


def drift(active: Active, time: Array) -> Array:
    """(N,) N, 0 at the start and ``size`` at the end."""
    x = (time - time[0]) / (time[-1] - time[0])
    if active.form == "saturating":
        return active.size * np.expm1(-x / active.details["time"]) / np.expm1(-1 / active.details["time"])
    return active.size * x ** active.details.get("exponent", 0.5)


def play(width: float, deflection: Array) -> Array:
    """(N,) m: what follows the drive with ``width`` of lost motion, taken up at the start."""
    out = np.empty_like(deflection)
    last = deflection[0]
    for i, x in enumerate(deflection):
        last = min(max(last, x), x + width)
        out[i] = last
    return out


def cut(active: Active, force: Array) -> Array:
    """(N,) N of a load cell that ends at (1 - size) of the largest force."""
    top = (1 - active.size) * float(np.max(force))
    if active.form == "hard" or active.size == 0:
        return np.minimum(force, top)
    width = active.details["width"] * top * min(1.0, active.size / 0.02)
    return top - width * np.logaddexp(0.0, (top - force) / width)


# ---- the chain -------------------------------------------------------------------------------------------------------


def response(film: Film, path: Path, at_work: Mapping[str, Active]) -> Array:
    """(N,) N: the force that a noiseless instrument would write, all distortions composed in the physical order."""
    reading = path.deflection
    lazy = at_work.get("viscoelastic")
    weight = None if lazy is None else memory(lazy, path.time)
    force = _film_force(film, path, at_work, reading, weight)
    if "machine_compliance" in at_work:
        for _ in range(30):
            before = force
            force = _film_force(film, path, at_work, reading - give(at_work["machine_compliance"], force), weight)
            if np.max(np.abs(force - before)) < 1e-10:
                break
    return _sensed(force, path, at_work)


def _film_force(
    film: Film, path: Path, at_work: Mapping[str, Active], deflection: Array, weight: Array | None
) -> Array:
    """(N,) N on the film whose disc is at ``deflection`` (N,) m, memory and rate included."""
    get = at_work.get
    if lost := get("backlash"):
        deflection = play(lost.size, deflection)
    if shift := get("zero_offset"):
        deflection = deflection - shift.size
    if left := get("permanent_set"):
        # A film left longer hangs slack below its set.
        taut = np.maximum(deflection - left.size * growth(left, deflection, path), 0.0)
        deflection = np.where(deflection > 0, taut, deflection)
    inner = get("hysteresis")
    if inner and inner.form == "lead":
        deflection = np.maximum(deflection + lead(inner, deflection, path), np.minimum(deflection, 0.0))
    slip = None
    if gone := get("clamp_slip"):
        slip = gone.size * growth(gone, deflection, path)
    stretched = get("prestretch")
    force = film.force(deflection, 1 + stretched.size if stretched else 1.0, slip)
    if soft := get("mullins"):
        force = force * softening(soft, deflection, film, path)
    if torn := get("tearing"):
        force = force * (1 - torn.size * growth(torn, deflection, path))
    if inner and inner.form == "proportional":
        force = force * (1 + inner.size * rubbed(inner.details["length"] * path.largest, path))
    if warm := get("temperature_step"):
        when, duration = (warm.details[k] * path.time[-1] for k in ("when", "duration"))
        force = force * (1 + warm.size * expit((path.time - when) / duration))
    if weight is not None:
        force = convolved(at_work["viscoelastic"], force, weight)
    if fast := get("rate"):
        force = force * rate_factor(fast, path)
    return force


def _sensed(force: Array, path: Path, at_work: Mapping[str, Active]) -> Array:
    get = at_work.get
    out = force
    if rub := get("friction"):
        out = out + rubbing(rub, force, path)
    if wave := get("ripple"):
        d = wave.details
        out = out + wave.size * np.sin(2 * np.pi * path.deflection / d["length"] + d["phase"])
    if constant := get("force_offset"):
        out = out + constant.size
    if moving := get("force_drift"):
        out = out + drift(moving, path.time)
    if factor := get("gain"):
        out = out * (1 + factor.size)
    return cut(full, out) if (full := get("clipped")) else out
