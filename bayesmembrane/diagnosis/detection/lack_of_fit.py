"""Does the model leave more than the smooth reference? The overall test: it sees any smooth misfit, faintly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, fdtrc

from bayesmembrane.diagnosis.reference.noise import Whitened
from bayesmembrane.diagnosis.thresholds import NOISE, TINY


@dataclass(frozen=True)
class LackOfFit:
    """F = [(RSS - RSS_saturated) / (p - k)] / s^2 of a model, and what is its probability if nothing is missing.

    ratio : F; 1 is what an adequate model has
    p_value : P(F >= ratio)
    chi2 : RSS over the noise's own variance
    dof : N - k
    extra, rest : degrees of freedom above and below in F; ``rest`` is inf where the noise is stated
    """

    ratio: float
    p_value: float
    chi2: float
    dof: int
    extra: int = 1
    rest: float = np.inf

    @property
    def reduced_chi2(self) -> float:
        """chi^2 / (N - k), by the measurement's own noise."""
        return self.chi2 / max(self.dof, 1)


def lack_of_fit(model: Whitened) -> LackOfFit:
    """How much of the residual the reference, together with the model's slopes, explains.

    The saturated residual sets the scale where the noise is inferred; where it is stated, that does. A curve too short
    for the reference to leave enough degrees of freedom is judged by all that is left, if its noise is stated.
    """
    r, rest, k, noise = model.residual, model.rest, model.parameters, model.noise
    n, p = r.size, model.reference.shape[1]
    rss, rss_saturated = float(r @ r), float(np.sum(rest**2))
    extra = max(p - k, 1)
    if noise.stated:
        whole = noise.root is not None or n - p < NOISE.doubt_from_dof
        value, dof = (rss, max(n - k, 1)) if whole else (max(rss - rss_saturated, 0.0), extra)
        return LackOfFit(value / dof, float(chdtrc(dof, value)), rss, n - k, dof)
    scale = max(rss_saturated / max(n - p, 1), TINY)
    ratio = max(rss - rss_saturated, 0.0) / extra / scale
    rest_dof = max(n - p, 1)
    return LackOfFit(float(ratio), float(fdtrc(extra, rest_dof, ratio)), rss, n - k, extra, float(rest_dof))
