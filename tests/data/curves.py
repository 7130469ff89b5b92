"""Curves that the tests of data share."""

import numpy as np

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.physics.rigs.annulus import Annulus


def annulus_curve(deflection_mm: object, **more: object) -> Measurement:
    x = np.asarray(deflection_mm, dtype=float) * 1e-3
    return Measurement(x, 100 * x, Annulus(0.01, 0.035), Specimen("film", 5e-5), **more)  # type: ignore[arg-type]
