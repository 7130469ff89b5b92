"""The forces of a hypothesis at deflections, in one call."""

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.physics.forward import Forward, Prediction
from bayesmembrane.physics.hypothesis import Hypothesis


def predict(
    hypothesis: Hypothesis,
    coordinates: ArrayLike,
    measurement: Measurement,
    deflection: ArrayLike | None = None,
    sensitivities: bool = False,
) -> Prediction:
    """Force curves F(delta; x) of coordinates x (B, k) at ``deflection`` (N,) m, or at those of the measurement."""
    at = measurement.deflection if deflection is None else np.atleast_1d(np.asarray(deflection, dtype=float))
    return Forward(hypothesis, measurement, at)(coordinates, sensitivities)
