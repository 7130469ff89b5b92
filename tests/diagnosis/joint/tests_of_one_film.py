"""The same film in two tests, made by a generator that the inference does not use; the second one without a fault."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.reading import read_measurement
from tests.generator.datasets import generate
from tests.generator.distortions import response
from tests.generator.protocols import Protocol

SHORT = Protocol("short", (0.020, 0.040), (1e-3, 1e-3), 150)


def two_tests(
    folder: Path, kind: str, material: str, ratio: float, seed: int, factor: float = 1.0
) -> tuple[Measurement, Measurement]:
    """A test with what is wrong, and one of the bare film, whose forces are ``factor`` times as large."""
    data = generate(kind, material, SHORT, "white", ratio, seed)
    first = read_measurement(*data.write(folder))
    force = factor * response(data.film, data.path, {})
    noise = data.truth["noise"]["sd"] * np.random.default_rng([seed, 5]).standard_normal(force.size)
    return first, Measurement(first.deflection, force + noise, first.rig, first.specimen, time=first.time)
