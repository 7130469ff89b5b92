"""Films that the tests of the mechanics share."""

from __future__ import annotations

import numpy as np
import pytest

from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import materials
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.mechanics.request import Request, request

INNER, OUTER = 0.010, 0.035
RADII = {"inner_radius": INNER, "outer_radius": OUTER}
MM = 1e-3
FIFTEEN = np.linspace(6.1, 91.5, 15) * MM
WIDE = np.array([0.05, 0.5, 2.0, 5.0, 10.0, 20.0, 35.1, 60.0, 91.5, 100.0]) * MM

# Calibrated to silicone of 50 um: N/m, exponents and Gent's limit dimensionless.
SILICONE = {
    "neo_hookean": (7.5,),
    "mooney_rivlin": (6.21436, 1.4703426),
    "gent": (5.312, 17.42),
    "yeoh": (8.840838, -0.6303258, 0.05632747),
    "ogden": (11.060008, 0.1959017, -0.3679535, 1.5196142, 5.805068, -1.1529809),
}
every_material = pytest.mark.parametrize(
    "material",
    [pytest.param(m, marks=() if m.ordinary else pytest.mark.study) for m in materials().values()],
    ids=materials().keys(),
)
"""Those that are there by name alone in `make study`: what is solved here knows a material by its contract only, which
is tested for all of them (`tests/physics/materials`), and one curve of each is (`tests/physics/test_forward.py`)."""


def silicone(material: type[Material]) -> Array:
    """Calibrated parameters where they are known, else those of a usual film."""
    return np.array(SILICONE.get(material.name, material.typical()))


def prior_draws(material: type[Material], count: int, seed: int, wide: float = 1.0) -> Array:
    """(count, n) parameters from the prior, with the modulus fixed: it only scales the forces.

    ``wide`` times as far from the prior's mean, within the bounds of the coordinates.
    """
    rng = np.random.default_rng(seed)
    x = np.stack([c.prior.draw(rng, count) for c in material.coordinates])
    if wide != 1.0:
        middle = np.mean(x, axis=1, keepdims=True)
        low, high = np.array([c.bounds for c in material.coordinates]).T
        x = np.clip(middle + wide * (x - middle), low[:, None], high[:, None])
    x[0] = np.log(15.0)
    return material.from_coordinates(x).T


def asked(material: type[Material], parameters, deflection, prestretch=1.0, ratio=3.5) -> Request:
    return request(material, parameters, deflection, INNER, ratio * INNER, prestretch=prestretch)
