"""How well a curve fits, judged by the measurement's own noise and never by the noise that was inferred.

A form error is no noise: where one is inferred, what it allows beside the stated noise counts as fitting.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.special import chdtrc

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.parameters import Array


@dataclass(frozen=True)
class Goodness:
    """Residuals of one curve with k parameters on N points.

    Attributes
    ----------
    rmse_N, max_N : root mean square and largest size of y - F, N
    loss_N : |y - F|_2, N
    reduced_chi2 : r^T Sigma^-1 r / (N - k) with the noise the measurement states, and the form error if there is one;
        None if it states none, or N <= k
    p_value : probability of a chi-square at least as large if the model were right; None likewise
    own_noise_N : root mean square of the stated standard deviation, N; None likewise
    """

    rmse_N: float  # noqa: N815 - the unit is part of the name that users read
    max_N: float  # noqa: N815
    loss_N: float  # noqa: N815
    reduced_chi2: float | None
    p_value: float | None
    own_noise_N: float | None  # noqa: N815

    def summary(self) -> dict[str, Any]:
        return asdict(self)


def goodness(measurement: Measurement, force: Array, parameters: int, square: float | None = None) -> Goodness:
    """The fit of ``force`` (N,) in N, a curve with ``parameters`` free parameters.

    ``square`` is r^T Sigma^-1 r where Sigma is more than the stated noise (`NoiseLikelihood.stated`).
    """
    r = measurement.force - force
    sd, dof = measurement.force_sd, len(measurement) - parameters
    reduced, p_value, own = None, None, None
    if sd is not None:
        own = float(np.sqrt(np.mean(sd**2)))
        if dof > 0:
            total = _own_square(measurement, sd, r) if square is None else square
            reduced, p_value = total / dof, float(chdtrc(dof, total))
    size = float(np.linalg.norm(r))
    return Goodness(size / float(np.sqrt(len(r))), float(np.max(np.abs(r))), size, reduced, p_value, own)


def _own_square(measurement: Measurement, sd: Array, r: Array) -> float:
    """r^T Sigma^-1 r by the measurement's own noise alone."""
    if measurement.covariance is None:
        return float(np.sum((r / sd) ** 2))
    return float(r @ np.linalg.solve(measurement.covariance, r))


def dominates(own_noise: float | None, extra_sd: Array) -> bool:
    """True if the posterior puts more than half its weight on an inferred noise (B,) above the stated one, both N."""
    return own_noise is not None and bool(np.mean(extra_sd > own_noise) > 0.5)
