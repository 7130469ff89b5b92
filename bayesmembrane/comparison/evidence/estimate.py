"""ln Z by two estimators that share nothing but the posterior, and whether they agree."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

import numpy as np

from bayesmembrane.calibration.prior import Mass
from bayesmembrane.comparison.evidence.target import EvidenceEstimate

NESTED, BRIDGE = "nested", "bridge"
SIGMAS, WIDEST = 2.0, 0.3


class Disagreement(Enum):
    """Why ln Z is not known well enough."""

    NOT_FINITE = "not finite"
    WIDE = "joint standard error too large"
    APART = "estimators too far apart"


@dataclass(frozen=True)
class Evidence:
    """ln Z of one target.

    Attributes
    ----------
    log_evidence, log_evidence_sd : by estimator, ``nested`` and ``bridge``; divided by the prior's mass, whose error is
        in the standard errors
    difference, joint_sd : of the two, and its standard error; the mass, which both share, has no part in it
    disagreement : None if they differ by at most two joint standard errors, and that of both, with the mass, is at most
        0.3; or why they do not agree
    evaluations, seconds : by estimator
    """

    log_evidence: Mapping[str, float]
    log_evidence_sd: Mapping[str, float]
    difference: float
    joint_sd: float
    disagreement: Disagreement | None
    evaluations: Mapping[str, int]
    seconds: Mapping[str, float]

    @property
    def agreed(self) -> bool:
        """Whether the two estimators agree."""
        return self.disagreement is None

    @property
    def total_sd(self) -> float:
        """Joint standard error of both, that of the mass included."""
        return float(np.hypot(self.log_evidence_sd[NESTED], self.log_evidence_sd[BRIDGE]))

    @property
    def best(self) -> tuple[float, float]:
        """(ln Z, its standard error): the mean with weights 1 / sd^2, its error no less than the smaller one.

        The errors share that of the mass, so that two estimates are not worth twice one.
        """
        z = np.array([self.log_evidence[e] for e in self.log_evidence])
        sd = np.maximum([self.log_evidence_sd[e] for e in self.log_evidence], 1e-6)
        w = sd**-2 / np.sum(sd**-2)
        return float(w @ z), float(np.min(sd))


def together(found: Mapping[str, EvidenceEstimate], mass: Mass | None = None) -> Evidence:
    """The estimates of one target, divided by the mass of its prior, and whether they agree."""
    mass = mass or Mass(1.0, 0.0)
    log_mass, log_mass_sd = float(np.log(mass.value)), mass.sd / mass.value
    z = {name: e.log_evidence - log_mass for name, e in found.items()}
    sd = {name: float(np.hypot(e.sd, log_mass_sd)) for name, e in found.items()}
    a, b = found[NESTED], found[BRIDGE]
    difference, joint = abs(a.log_evidence - b.log_evidence), float(np.hypot(a.sd, b.sd))
    return Evidence(
        z,
        sd,
        difference,
        joint,
        _disagreement(difference, joint, float(np.hypot(sd[NESTED], sd[BRIDGE]))),
        {n: e.evaluations for n, e in found.items()},
        {n: e.seconds for n, e in found.items()},
    )


def _disagreement(difference: float, joint: float, total: float) -> Disagreement | None:
    """What is wrong with two estimates; the mass of the prior is in ``total`` and cancels in the others."""
    if not np.isfinite(difference) or not np.isfinite(total):
        return Disagreement.NOT_FINITE
    if total > WIDEST:
        return Disagreement.WIDE
    return Disagreement.APART if difference > SIGMAS * joint else None
