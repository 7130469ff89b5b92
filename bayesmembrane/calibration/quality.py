"""What a reader must know of a run before trusting its numbers, in values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bayesmembrane.calibration.posterior import FAILURES
from bayesmembrane.calibration.sampling.convergence import LEAST_TAUS, R_HAT
from bayesmembrane.ground.parameters import Array

NOTEWORTHY = 1e-3
"""A part of numerical failures above this is reported."""
SMOOTH = 0.01
"""A p-value of neighbouring residuals below this is reported."""
RULED_OUT = 3.0
"""A gain in ln of the posterior density beyond the convexity prior above this is reported."""


@dataclass(frozen=True)
class Quality:
    """How far the draws of a run can be trusted.

    Attributes
    ----------
    ended : "converged", "step limit" or "interrupted"
    steps : that each ensemble walked
    ess, wanted : effective draws of the worst coordinate, and how many were asked for
    lengths : autocorrelation times that were walked after burn-in
    r_hat : of the worst coordinate
    failed, evaluated : draws that could not be solved, and all
    alike, alike_p : lag-1 correlation of the residuals along the path, and how often the noise model by itself gives
        one as large; None if nobody looked
    noise : name of the noise model, "" if nobody looked
    ruled_out : by how much ln of the posterior density is larger at a film that the convexity prior rules out; None if
        nobody looked
    own_noise, extra_noise : N, stated by the measurement, and the median of the inferred one; None unless it dominates
    """

    ended: str
    steps: int
    ess: float
    wanted: float
    lengths: float
    r_hat: float
    failed: int
    evaluated: int
    own_noise: float | None = None
    extra_noise: float | None = None
    alike: float | None = None
    alike_p: float | None = None
    noise: str = ""
    ruled_out: float | None = None

    @property
    def converged(self) -> bool:
        """Whether tau can be believed, ESS is what was wanted and R-hat is at most 1.01."""
        return self.lengths >= LEAST_TAUS and self.ess >= self.wanted and self.r_hat <= R_HAT

    @property
    def smooth(self) -> bool:
        """Whether neighbouring residuals are more alike than the noise model can explain."""
        return self.alike_p is not None and self.alike_p < SMOOTH

    @property
    def noteworthy_failures(self) -> bool:
        """Whether more than `NOTEWORTHY` of all draws could not be solved."""
        return self.failed > NOTEWORTHY * self.evaluated


def quality_of(status: Mapping[str, Any], noise_sd: Array) -> Quality:
    """The quality of a run from its ``status``, as it is stored, and its draws of the inferred noise in N, if any."""
    checks = status.get("checks", {})
    alike = checks.get("alike", {})
    taus = [np.inf if tau is None else float(tau) for tau in status["tau"].values()]
    tally, dominated = status["tally"], bool(status["extra_noise_dominates"])
    return Quality(
        ended=str(status["status"]),
        steps=int(status["steps"]),
        ess=_number(status["ess_bulk"], 0.0),
        wanted=float(status["ess_wanted"]),
        lengths=(status["steps"] - status["burn"]) / max(taus),
        r_hat=_number(status["r_hat"], np.inf),
        failed=sum(tally.get(o.label, 0) for o in FAILURES),
        evaluated=sum(tally.values()),
        own_noise=status["goodness"]["own_noise_N"] if dominated else None,
        extra_noise=float(np.median(noise_sd)) if dominated else None,
        alike=alike.get("lag_1"),
        alike_p=alike.get("p_value"),
        noise=alike.get("noise", ""),
        ruled_out=checks.get("ruled_out"),
    )


def _number(value: float | None, missing: float) -> float:
    return missing if value is None else float(value)
