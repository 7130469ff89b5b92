"""Tests at random: rig, film, protocol and noise of a measurement, drawn from a seed so that its faults can show."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from tests.generator.datasets import Bench
from tests.generator.noise import Noise
from tests.generator.protocols import Protocol

NEED_SPEEDS = frozenset({"rate"})
NEED_CYCLES = frozenset(
    {
        *("mullins", "permanent_set", "clamp_slip", "tearing", "friction", "hysteresis", "viscoelastic"),
        *("force_drift", "backlash", "temperature_step", "ripple", "clipped"),
    }
)
"""Without unloading the material absorbs most of these, or they cannot be told from each other."""


@dataclass(frozen=True)
class Setup:
    """What a film is measured with."""

    bench: Bench
    protocol: Protocol
    noise: Noise


def setup(faults: Collection[str], seed: int, shrink: float = 1.0) -> Setup:
    """The setup of a seed for these faults: R1 5 to 15 mm, R2 30 to 60 mm, 20 to 200 um, up to 0.9 to 1.7 free lengths.

    ``shrink`` makes every deflection smaller, for films that lock before. Protocols are a single loading, rising peaks,
    rising peaks each twice, equal triangles and two speeds; two in five dwell at peaks or at valleys, unless a fault
    follows the speed. Noise is 0.05 to 0.4 % of the largest force.
    """
    rng = np.random.default_rng([seed, 77])
    radii = float(rng.uniform(0.005, 0.015)), float(rng.uniform(0.030, 0.060))
    bench = Bench(*radii, 1e-6 * float(np.exp(rng.uniform(*np.log([20, 200])))))
    top = shrink * rng.uniform(0.9, 1.7) * (bench.outer - bench.inner)
    return Setup(bench, _protocol(faults, top, rng), _noise(rng))


def _protocol(faults: Collection[str], top: float, rng: np.random.Generator) -> Protocol:
    """Of a kind that suits the faults, with ``top`` (m) the largest deflection."""
    kinds = ["staircase", "twice", "triangles", "two_speeds"]
    if NEED_SPEEDS & set(faults):
        kinds = ["two_speeds"]
    elif not NEED_CYCLES & set(faults):
        kinds.append("single")
    kind = str(rng.choice(kinds))
    count = int(rng.integers(3, 6))
    slow = float(np.exp(rng.uniform(*np.log([3e-4, 2e-3]))))
    rising = np.linspace(rng.uniform(0.2, 0.4), 1.0, count)
    shape, speeds = {
        "single": (np.ones(1), np.ones(1)),
        "staircase": (np.append(rising, 1.0), np.ones(count + 1)),
        "twice": (np.repeat(rising, 2), np.ones(2 * count)),
        "triangles": (np.ones(count), np.ones(count)),
        "two_speeds": (np.tile([rng.uniform(0.4, 0.7), 1.0], 2), np.repeat([1.0, rng.uniform(5, 20)], 2)),
    }[kind]
    points = int(rng.integers(200, 360) if kind == "single" else rng.integers(320, 620))
    dwells, long = (0.0, 0.0), float(np.exp(rng.uniform(*np.log([10, 120]))))
    if not NEED_SPEEDS & set(faults) and rng.random() < 0.4:
        dwells = ((long, 0.0), (0.0, long), (long, long))[int(rng.integers(3))]
    return Protocol(
        f"{kind}{'_dwells' if max(dwells) else ''}",
        tuple(float(top * x) for x in shape),
        tuple(float(slow * v) for v in speeds),
        points,
        unload=kind != "single",
        dwells=dwells,
    )


def _noise(rng: np.random.Generator) -> Noise:
    sd = float(np.exp(rng.uniform(*np.log([5e-4, 4e-3]))))
    kind = int(rng.integers(4))  # white, correlated, growing with the load, rounded and uneven
    return Noise(
        sd,
        rho=float(rng.uniform(0.2, 0.6)) if kind == 1 else 0.0,
        quantum=float(rng.uniform(0.5, 2.0)) * sd if kind == 3 else 0.0,
        uneven=kind == 3,
        relative=True,
        grows=float(rng.uniform(0.5, 3.0)) if kind == 2 else 0.0,
    )
