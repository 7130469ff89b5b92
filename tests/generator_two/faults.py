"""What goes wrong between the film and the file. Each fault has a size in SI and one of several forms.

Sizes of lengths and forces are kept as parts of the test's largest (`Trial.lengths`), so that one list serves all rigs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import exp1, expit

from tests.generator_two.course import Course
from tests.generator_two.membrane import LockedError, Membrane

Details = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Fault:
    """A kind: unit ("m" and "N" are of the test's largest), the largest size, whether negative too, details by form."""

    unit: str
    most: float
    signed: bool
    forms: Mapping[str, Details]


@dataclass(frozen=True)
class Done:
    """One fault at work; ``size`` in parts of the test's largest, see `Trial.si`."""

    size: float
    form: str
    details: Mapping[str, float]


LENGTH = {"length": (0.004, 0.03)}
FAULTS: dict[str, Fault] = {
    "zero_offset": Fault("m", 0.1, True, {"shift": {}, "seating": {"length": (0.005, 0.03)}}),
    "prestretch": Fault("-", 0.08, False, {"alike": {}}),
    "force_offset": Fault("N", 0.2, True, {"constant": {}}),
    "force_drift": Fault(
        "N", 0.4, True, {"exponential": {"time": (0.15, 0.8)}, "logarithmic": {"k": (3.0, 30.0)}, "slow_then_fast": {}}
    ),
    "machine_compliance": Fault(
        "m/N", 0.25, False, {"seating": {"force": (0.4, 1.5)}, "stiffening": {"k": (0.5, 3.0)}, "linear": {}}
    ),
    "clamp_slip": Fault("m", 0.06, False, {"creep": {"power": (2.0, 5.0)}, "grip": {"holds": (0.2, 0.7)}}),
    "permanent_set": Fault("m", 0.12, False, {"work": {"power": (0.4, 1.0)}, "travel": {"length": (0.5, 3.0)}}),
    "mullins": Fault(
        "-",
        0.6,
        False,
        {
            "tanh": {"m": (0.1, 0.5), "b": (0.1, 0.6)},
            "stretch": {"power": (0.5, 1.0)},
            "power": {"q": (0.3, 1.2), "r": (0.2, 1.0)},
        },
    ),
    "viscoelastic": Fault(
        "-",
        0.8,
        False,
        {
            "power_law": {"time": (0.005, 0.1), "power": (0.15, 0.6)},
            "box": {"first": (0.003, 0.02), "decades": (1.0, 2.5)},
            "eyring": {"time": (0.02, 0.3), "yield_": (0.05, 0.5)},
        },
    ),
    "tearing": Fault(
        "-",
        0.5,
        False,
        {
            "ligament": {"at": (0.5, 0.9), "power": (3.0, 8.0)},
            "fatigue": {"power": (3.0, 8.0)},
            "sudden": {"at": (0.4, 0.95)},
        },
    ),
    "friction": Fault(
        "N",
        0.3,
        False,
        {
            "bristle": {**LENGTH, "excess": (0.1, 0.6), "viscous": (0.0, 0.3)},
            "worn": {**LENGTH, "slope": (-0.6, 0.6)},
            "static": {**LENGTH, "peak": (0.1, 0.5)},
        },
    ),
    "rate": Fault("-", 0.25, False, {"plateau": {"speed": (0.2, 1.0)}, "overstress": {"power": (0.15, 0.5)}}),
    "hysteresis": Fault(
        "-", 0.5, False, {"bouc_wen": {"length": (0.05, 0.3), "n": (1.0, 2.0)}, "strain": {"length": (0.05, 0.3)}}
    ),
    # What no library of effects holds.
    "ripple": Fault("N", 0.2, False, {"two_tones": {"pitch": (0.03, 0.15), "phase": (0.0, 6.28)}}),
    "clipped": Fault("-", 0.5, False, {"knee": {"width": (0.005, 0.04)}}),
    "temperature_step": Fault("-", 0.3, True, {"warming": {"at": (0.25, 0.7), "time": (0.002, 0.05)}}),
    "backlash": Fault("m", 0.05, False, {"gap": {}}),
    "knock": Fault("N", 0.3, True, {"step": {"at": (0.25, 0.75)}}),
}
FOREIGN = ("ripple", "clipped", "temperature_step", "backlash", "knock")
EFFECTS = tuple(k for k in FAULTS if k not in FOREIGN)


def drawn(name: str, rng: np.random.Generator) -> Done:
    """Form, details and sign at random; of size 1 or -1."""
    fault = FAULTS[name]
    form = str(rng.choice(list(fault.forms)))
    details = {k: float(rng.uniform(*r)) for k, r in fault.forms[form].items()}
    return Done(float(rng.choice([-1.0, 1.0])) if fault.signed else 1.0, form, details)


@dataclass(frozen=True, eq=False)
class Trial:
    """A film on a course, and what it would read with faults at work."""

    film: Membrane
    course: Course

    @property
    def lengths(self) -> tuple[float, float]:
        """Largest deflection (m) and force (N) of the film."""
        return self.course.largest, float(self.film.force(np.array([self.course.largest]))[0])

    def si(self, name: str, size: float) -> float:
        """A size in SI."""
        length, force = self.lengths
        return size * {"m": length, "N": force, "m/N": length / force}.get(FAULTS[name].unit, 1.0)

    def reading(self, faults: Mapping[str, Done]) -> Any:
        """(N,) N, with all faults and without noise."""
        length, top = self.lengths
        film = self.film
        if (drawn_tight := faults.get("prestretch")) is not None:
            film = _tight(film, 1 + drawn_tight.size)
        at = self.course.at
        if (gap := faults.get("backlash")) is not None:
            at = _followed(at, gap.size * length)
        carried = _carried(film, self.course, faults, at, length)
        if (soft := faults.get("machine_compliance")) is not None:
            for _ in range(60):
                new = _carried(film, self.course, faults, at - _yields(soft, carried / top) * length, length)
                change, carried = np.max(np.abs(new - carried)), 0.5 * (new + carried)
                if change < 1e-9 * top:
                    break
            else:
                raise LockedError("the frame and the film do not settle")
        return _cell(carried, self.course, faults, top)


def _tight(film: Membrane, stretch: float) -> Membrane:
    return Membrane(film.family, film.constants, film.inner, film.outer, film.reach, stretch)


def _followed(at: Any, gap: float) -> Any:
    """What a drive with lost motion moves: nothing, until the gap is closed."""
    out, last = np.empty_like(at), 0.0
    for i, x in enumerate(at):
        last = float(np.clip(last, x - gap, x))
        out[i] = last
    return out


def _so_far(values: Any, course: Course) -> Any:
    """Cumulative sum, 1 at the end."""
    total = np.cumsum(values)
    return total / total[-1] if total[-1] > 0 else total


def _carried(film: Membrane, course: Course, faults: Mapping[str, Done], at: Any, length: float) -> Any:
    """(N,) N of the film whose disc is at ``at`` (N,) m, its memory included."""
    get = faults.get
    up = at
    if (zero := get("zero_offset")) is not None:
        late = 1.0 if zero.form == "shift" else -np.expm1(-np.maximum(at, 0) / (zero.details["length"] * length))
        up = up - zero.size * length * late
    if (left := get("permanent_set")) is not None:
        up = up - left.size * length * _set(left, film, course, length)
    longer: Any = 0.0
    if (slid := get("clamp_slip")) is not None:
        longer = slid.size * length * _slid(slid, film, course)
    force = film.force(up, longer)
    if (soft := get("mullins")) is not None:
        force = force * (1 - soft.size * _softened(soft, film, up, length))
    if (torn := get("tearing")) is not None:
        force = force * (1 - torn.size * _torn(torn, course, length))
    if (inner := get("hysteresis")) is not None:
        z = _bouc_wen(course, inner.details["length"] * length, inner.details.get("n", 1.0))
        grows = 1.0 if inner.form == "bouc_wen" else np.sqrt(np.clip(up / length, 0, 1))
        force = force * (1 + inner.size * z * grows)
    if (warm := get("temperature_step")) is not None:
        after = course.time / course.time[-1] - warm.details["at"]
        force = force * (1 - warm.size * np.expm1(-np.maximum(after, 0) / warm.details["time"]))
    if (lazy := get("viscoelastic")) is not None:
        force = np.maximum(force - lazy.size * (force - _relaxing(lazy, force, course)), 0.0)
    if (fast := get("rate")) is not None:
        force = force * (1 + fast.size * _quicker(fast, course))
    return force


def _set(done: Done, film: Membrane, course: Course, length: float) -> Any:
    if done.form == "work":
        work = np.maximum.accumulate(film.work(course.at))
        return (work / work[-1]) ** done.details["power"]
    loading = np.maximum(course.steps, 0) * (course.at / length) ** 2
    grown = -np.expm1(-np.cumsum(loading) / (done.details["length"] * length))
    return grown / grown[-1]


def _slid(done: Done, film: Membrane, course: Course) -> Any:
    chord = np.hypot(film.length, course.at)
    pull = np.maximum(film.pull(chord - film.length), 0.0)
    part = pull / np.max(pull)
    if done.form == "creep":
        return _so_far(part ** done.details["power"] * course.gaps, course)
    beyond = np.clip(np.maximum.accumulate(part) - done.details["holds"], 0, None) / (1 - done.details["holds"])
    jerks = 6 * beyond
    return (0.7 * jerks + 0.3 * (np.floor(jerks) + expit((jerks % 1 - 0.5) / 0.05))) / 6


def _softened(done: Done, film: Membrane, up: Any, length: float) -> Any:
    """(N,) part that is lost, 1 at most."""
    d = done.details
    if done.form == "stretch":
        chord = np.hypot(film.length, np.maximum(up, 0)) - film.length
        gone = (np.maximum.accumulate(chord) - chord) / np.max(chord)
        return -np.expm1(-3 * gone ** d["power"]) / -np.expm1(-3.0)
    work = film.work(up)
    most, whole = np.maximum.accumulate(work), float(np.max(work))
    if done.form == "tanh":
        return np.tanh((most - work) / (d["m"] * whole + d["b"] * most))
    return (1 - (work / np.maximum(most, 1e-15)) ** d["q"]) * (most / whole) ** d["r"]


def _torn(done: Done, course: Course, length: float) -> Any:
    most, d = np.maximum.accumulate(course.at) / length, done.details
    if done.form == "ligament":
        return np.expm1(-((most / d["at"]) ** d["power"])) / np.expm1(-(d["at"] ** -d["power"]))
    if done.form == "fatigue":
        return _so_far(np.maximum(course.steps, 0) * (course.at / length) ** d["power"], course)
    return expit((most - d["at"]) / 0.004)


def _bouc_wen(course: Course, length: float, n: float) -> Any:
    out, z = np.empty(course.at.size), 0.0
    for i, step in enumerate(course.steps):
        parts = max(1, int(np.ceil(4 * abs(step) / length)))
        for _ in range(parts):
            x = step / parts / length
            z += x * (1 - abs(z) ** n * (0.3 + 0.7 * np.sign(x * z)))
        out[i] = z
    return out


def _relaxing(done: Done, force: Any, course: Course) -> Any:
    """(N,) N: what would be left of ``force``, were all of it of the part that relaxes."""
    d, whole = done.details, course.time[-1]
    if done.form == "eyring":
        yields, out, q = d["yield_"] * float(np.max(force)), np.empty_like(force), 0.0
        for i, (dt, change) in enumerate(zip(course.gaps, np.diff(force, prepend=force[0]), strict=True)):
            x = min(abs(q) / yields, 30.0)
            rate = (np.sinh(x) / x if x > 1e-6 else 1.0) / (d["time"] * whole)
            part = np.exp(-rate * dt)
            q = q * part + change * ((1 - part) / (rate * dt) if rate * dt > 1e-9 else 1.0)
            out[i] = q
        return out
    lag = np.maximum(course.time[:, None] - 0.5 * (course.time[1:] + course.time[:-1]), 0.0)
    if done.form == "power_law":
        kernel = (1 + lag / (d["time"] * whole)) ** -d["power"]
    else:
        first, last = d["first"] * whole, d["first"] * whole * 10 ** d["decades"]
        lag = np.maximum(lag, 1e-6 * first)
        kernel = (exp1(lag / last) - exp1(lag / first)) / np.log(last / first)
    past = np.tri(course.time.size, course.time.size - 1, -1)
    return force[0] + (kernel * past) @ np.diff(force)


def _quicker(done: Done, course: Course) -> Any:
    slow = float(np.min(course.speed[course.speed > 0]))
    v = np.maximum(course.speed, slow) / slow
    if done.form == "plateau":
        return np.log((v + done.details["speed"]) / (1 + done.details["speed"]))
    return (v ** done.details["power"] - 1) / done.details["power"]


def _yields(done: Done, part: Any) -> Any:
    """(N,) of the largest deflection, at these parts of the largest force."""
    x = np.maximum(part, 0.0)
    if done.form == "seating":
        f = done.details["force"]
        return done.size * np.expm1(-x / f) / np.expm1(-1 / f)
    if done.form == "stiffening":
        k = done.details["k"]
        return done.size * (np.sqrt(1 + k * x) - 1) / (np.sqrt(1 + k) - 1)
    return done.size * x


def _cell(force: Any, course: Course, faults: Mapping[str, Done], top: float) -> Any:
    get, out, length = faults.get, force, course.largest
    if (rub := get("friction")) is not None:
        out = out + rub.size * top * _rubs(rub, course)
    if (wave := get("ripple")) is not None:
        phase = 2 * np.pi * course.at / (wave.details["pitch"] * length) + wave.details["phase"]
        out = out + wave.size * top * (np.sin(phase) + 0.4 * np.sin(2 * phase + 1))
    if (constant := get("force_offset")) is not None:
        out = out + constant.size * top
    if (moving := get("force_drift")) is not None:
        out = out + moving.size * top * _drifts(moving, course.time / course.time[-1])
    if (hit := get("knock")) is not None:
        out = out + hit.size * top * (course.time > hit.details["at"] * course.time[-1])
    if (full := get("clipped")) is not None:
        end, width = (1 - full.size) * top, full.details["width"] * top * min(1.0, 20 * full.size + 1e-9)
        out = end - width * np.logaddexp(0.0, (end - out) / width)
    return out


def _rubs(done: Done, course: Course) -> Any:
    d, out, z, since = done.details, np.empty(course.at.size), 0.0, 0.0
    quickest, last, v = float(np.max(course.speed)), 0.0, 0.0
    for i, (step, now, way) in enumerate(zip(course.steps, course.speed, course.way, strict=True)):
        if step:
            v = now  # at rest it keeps what it had
            since = 0.0 if way != last else since
            since, last = since + abs(step) / course.largest, way
            z = way + (z - way) * np.exp(-abs(step) / (d["length"] * course.largest))
        level = z
        if done.form == "bristle":
            level = z * (1 + d["excess"] * np.exp(-((v / (0.3 * quickest)) ** 2))) + d["viscous"] * way * v / quickest
        elif done.form == "worn":
            level = z * (1 + d["slope"] * (2 * course.at[i] / course.largest - 1))
        else:
            level = z * (1 + d["peak"] * np.exp(-since / 0.05))
        out[i] = level
    return out


def _drifts(done: Done, x: Any) -> Any:
    if done.form == "exponential":
        return np.expm1(-x / done.details["time"]) / np.expm1(-1 / done.details["time"])
    if done.form == "logarithmic":
        return np.log1p(done.details["k"] * x) / np.log1p(done.details["k"])
    return 0.5 * (x + x**2)
