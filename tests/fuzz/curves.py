"""Synthetic curves for the fuzz: a path, the film of tests/generator on it, a fault or none, and noise.

Nothing here knows the package under test.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tests.generator.energies import FAMILIES, Array, InadmissibleStateError
from tests.generator.film import NoSolutionError, film

SOFT = 50e-6  # m: the thickness for which tests/generator draws its films
PROTOCOLS = ("single", "single", "cycles", "cycles", "staircase", "speeds", "repeated", "jitter")
FAULTS = ("none", "none", "none", "shift", "offset", "drift", "softening", "relaxation", "gain", "jump")
RIGS = ("annulus", "annulus", "annulus", "uniaxial", "equibiaxial", "planar", "biaxial")


@dataclass(frozen=True)
class Motion:
    """How far the disc or the clamps went: time (N,) s, and the way (N,) as a part of the largest, 0 to 1."""

    time: Array
    way: Array


@dataclass(frozen=True)
class Bench:
    """The rig and the film in it: kind; R1 and R2 in m (annulus); thickness in m; energy's name."""

    kind: str
    inner: float
    outer: float
    thickness: float
    family: str


# ---- the path --------------------------------------------------------------------------------------------------------


def motion(protocol: str, points: int, rng: np.random.Generator) -> Motion:
    """About ``points`` readings of a protocol, evenly spaced along the path and, at one speed each leg, in time."""
    way, time = {
        "cycles": _cycles,
        "staircase": _staircase,
        "speeds": _speeds,
        "repeated": _repeated,
        "jitter": _jitter,
    }.get(protocol, _single)(points, rng)
    if rng.random() < 0.3:  # the record begins under load
        start = rng.uniform(0.02, 0.6)
        way = start + (1 - start) * way
    return Motion(time, way)


def _single(points: int, rng: np.random.Generator) -> tuple[Array, Array]:
    way = np.linspace(0, 1, points + 1)[1:] if rng.random() < 0.5 else np.linspace(0, 1, points)
    return way, np.linspace(0, rng.uniform(1, 200), points)


def _cycles(points: int, rng: np.random.Generator) -> tuple[Array, Array]:
    count = int(rng.integers(1, 6))
    peaks = np.sort(rng.uniform(0.2, 1, count))
    peaks[-1] = 1.0
    turns = np.concatenate([[0.0], np.stack([peaks, rng.uniform(0, 0.1) * peaks], axis=1).ravel()])
    return _along(turns, np.ones(turns.size - 1), points, rng)


def _speeds(points: int, rng: np.random.Generator) -> tuple[Array, Array]:
    turns = np.array([0.0, 0.5, 0.0, 1.0, 0.0, 1.0][: int(rng.integers(3, 7))])
    return _along(turns / turns.max(), 10.0 ** rng.uniform(-1, 1, turns.size - 1), points, rng)


def _staircase(points: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Steps up with holds between them, and down again or not."""
    steps = int(rng.integers(2, 6))
    level = np.arange(1, steps + 1) / steps
    if rng.random() < 0.5:
        level = np.concatenate([level, level[-2::-1]])
    each = max(points // (2 * level.size), 1)
    before = np.concatenate([[0.0], level[:-1]])
    way = np.concatenate([part for a, b in zip(before, level, strict=True) for part in _step(a, b, each)])
    return way, np.arange(way.size) * rng.uniform(0.1, 2)


def _step(a: float, b: float, each: int) -> tuple[Array, Array]:
    return np.linspace(a, b, each + 1)[1:], np.full(each, b)


def _repeated(points: int, rng: np.random.Generator) -> tuple[Array, Array]:
    way, time = _single(points, rng)
    return np.sort(way[rng.integers(0, points, points)]), time


def _jitter(points: int, rng: np.random.Generator) -> tuple[Array, Array]:
    way, time = _single(points, rng)
    return np.clip(way + rng.uniform(0, 0.02) * rng.standard_normal(points), 0, 1), time


def _along(turns: Array, speeds: Array, points: int, rng: np.random.Generator) -> tuple[Array, Array]:
    lengths = np.abs(np.diff(turns))
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    begun = np.concatenate([[0.0], np.cumsum(lengths / speeds)])
    at = np.linspace(0, ends[-1], points)
    return np.interp(at, ends, turns), np.interp(at, ends, begun) * rng.uniform(5, 100)


# ---- the reading -----------------------------------------------------------------------------------------------------


def columns(bench: Bench, path: Motion, largest: float, rng: np.random.Generator) -> dict[str, Array]:
    """The clean curve under the headers that the package reads; ``largest`` in m for the annulus, else a stretch."""
    scale = bench.thickness / SOFT * 10.0 ** rng.uniform(-1, 1)
    p = FAMILIES[bench.family].draw(rng)
    if bench.kind == "annulus":
        way = largest * path.way
        return {"deflection_mm": 1e3 * way, "force_N": scale * _annulus(bench, p, way, largest)}
    l1 = 1 + (largest - 1) * path.way
    if bench.kind == "biaxial":
        l2 = 1 + rng.uniform(0, 1) * (l1 - 1)
        p1, p2 = (scale * _tension(bench.family, p, l1, l2, k) / bench.thickness for k in (1, 2))
        return {"stretch_1": l1, "stretch_2": l2, "nominal_stress_1_MPa": 1e-6 * p1, "nominal_stress_2_MPa": 1e-6 * p2}
    l2 = {"uniaxial": l1**-0.5, "equibiaxial": l1, "planar": np.ones_like(l1)}[bench.kind]
    stress = scale * _tension(bench.family, p, l1, l2, 1) / bench.thickness
    return {"stretch": l1, "nominal_stress_MPa": 1e-6 * stress}


def _annulus(bench: Bench, p: Array, way: Array, largest: float) -> Array:
    """(N,) N; a film that locks or buckles on the way gives its place to the softest there is."""
    for family, q in ((bench.family, p), ("neo_hookean", p[:1])):
        try:
            law = film(family, tuple(map(float, q)), bench.inner, bench.outer, largest, True)
            return np.asarray(law.force(way))
        except (NoSolutionError, InadmissibleStateError):
            continue
    return 10 * way


def _tension(family: str, p: Array, l1: Array, l2: Array, which: int) -> Array:
    """(N,) N/m: dW/dl1 or dW/dl2."""
    for name, q in ((family, p), ("neo_hookean", p[:1])):
        try:
            with np.errstate(all="ignore"):
                found = np.asarray(FAMILIES[name].derivatives(q, l1, l2)[which])
        except InadmissibleStateError:
            continue
        if np.all(np.isfinite(found)):
            return found
    raise InadmissibleStateError("a neo-Hookean film exists at every stretch")


def spoilt(fault: str, path: Motion, force: Array, rng: np.random.Generator) -> Array:
    """``force`` (N,) with a fault of up to a fifth of its largest value."""
    size, top = rng.uniform(0.005, 0.2), float(np.max(np.abs(force)))
    share = (path.time - path.time[0]) / max(float(np.ptp(path.time)), 1e-9)
    falling = np.concatenate([[0.0], np.diff(path.way)]) < 0
    changes = {
        "shift": lambda: np.interp(path.way - 0.3 * size, np.sort(path.way), force[np.argsort(path.way)]),
        "offset": lambda: force + size * top,
        "drift": lambda: force + size * top * share,
        "softening": lambda: np.where(falling, (1 - size) * force, force),
        "relaxation": lambda: force * (1 - size * (1 - np.exp(-5 * share))),
        "gain": lambda: (1 + size) * force,
        "jump": lambda: np.where(share > 0.6, (1 - size) * force, force),
    }
    return np.asarray(changes[fault]()) if fault in changes else force


def noisy(force: Array, sd: float, rng: np.random.Generator) -> Array:
    """``force`` (N,) with white, correlated or rounded noise of ``sd``."""
    kind = rng.choice(["white", "ar1", "rounded"])
    noise = sd * rng.standard_normal(force.size)
    if kind == "ar1":
        for i in range(1, noise.size):
            noise[i] = 0.7 * noise[i - 1] + 0.71 * noise[i]
    out = force + noise
    return np.round(out / sd) * sd if kind == "rounded" and sd > 0 else out
