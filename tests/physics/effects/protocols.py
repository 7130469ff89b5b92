"""Protocols and films that the tests of effects share."""

import numpy as np

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.registry import materials
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import Hypothesis, hypothesis
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.physics.rigs.base import Rig

RIG = Annulus(0.010, 0.035)
CALIBRATED = {
    "neo_hookean": [7.5],
    "mooney_rivlin": [6.2, 0.4],
    "gent": [5.3, 40.0],
    "yeoh": [8.0, -0.2, 0.03],
    "ogden": [11.0, 0.2, -0.4, 1.5, 4.8, -1.2],
}
FILMS = {name: CALIBRATED.get(name, list(material.typical())) for name, material in materials().items()}


def staircase(peaks: tuple[float, ...] = (0.02, 0.04, 0.04, 0.06), points: int = 25) -> np.ndarray:
    """Deflections of cycles with rising peaks, up and down to 0.5 mm."""
    parts = []
    for peak in peaks:
        parts += [np.linspace(5e-4, peak, points), np.linspace(peak, 5e-4, points)[1:-1]]
    return np.concatenate(parts)


def two_speeds(d: np.ndarray) -> np.ndarray:
    """Times of a test whose second half runs five times as fast."""
    step = np.abs(np.diff(d, prepend=0.0)) / 1e-3
    step[d.size // 2 :] /= 5
    return np.cumsum(np.maximum(step, 1e-3))


def measured(d: np.ndarray | None = None, time: np.ndarray | None = None, rig: Rig = RIG) -> Measurement:
    d = staircase() if d is None else d
    time = two_speeds(d) if time is None else time
    return Measurement(d, 30 * d, rig, Specimen("film", 5e-5), time=time)


def timeless(m: Measurement) -> Measurement:
    return Measurement(m.deflection, m.force, m.rig, m.specimen)


def vector(h: Hypothesis, effects: str = "typical") -> np.ndarray:
    """Coordinates of the film of this name with every effect at its ``null`` or ``typical`` parameters."""
    name = h.material.name
    parts = [materials()[name].to_coordinates(FILMS[name]), *(getattr(e, effects) for e in h.effects)]
    return np.concatenate(parts)


def force(m: Measurement, *effects: str, x: np.ndarray | None = None, material: str = "yeoh") -> np.ndarray:
    """Force (N,) of the film with effects at typical parameters, or at effect parameters x."""
    h = hypothesis(material, effects)
    at = vector(h)
    if x is not None:
        at[h.material_size :] = x
    p = Forward(h, m, m.deflection)(at)
    assert np.all(p.ok)
    return p.force[0]


def path(d: np.ndarray, time: np.ndarray | None = None) -> Motion:
    return Motion(d, time, float(np.max(d)))
