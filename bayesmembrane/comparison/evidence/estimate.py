"""ln Z by two estimators that share nothing but the posterior, and whether they agree."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

import numpy as np

from bayesmembrane.calibration.prior import Mass
from bayesmembrane.comparison.evidence.bridge import bridge
from bayesmembrane.comparison.evidence.nested import nested
from bayesmembrane.comparison.evidence.target import Coverage, EvidenceEstimate, Target, covered
from bayesmembrane.ground.parameters import Array

NESTED, BRIDGE = "nested", "bridge"
SIGMAS, WIDEST = 2.0, 0.3
IMMATERIAL = 0.1
"""Two estimates that differ by less agree, whatever errors they state: it changes odds by a tenth at most, and among
fifteen hypotheses chance alone puts one pair two standard errors apart in half of all comparisons."""


class Disagreement(Enum):
    """Why ln Z is not known well enough."""

    NOT_FINITE = "not finite"
    WIDE = "joint standard error too large"
    APART = "estimators too far apart"
    MISSED = "the draws have missed a mode"


@dataclass(frozen=True)
class Evidence:
    """ln Z of one target.

    Attributes
    ----------
    log_evidence, log_evidence_sd : by estimator, ``nested`` and ``bridge``; divided by the prior's mass, whose error is
        in the standard errors
    difference, joint_sd : of the two, and its standard error; the mass, which both share, has no part in it
    disagreement : None if they differ by at most two joint standard errors, or 0.1, that of both, with the mass, is at
        most 0.3, and no mode is known that the draws have missed; or why they do not agree
    evaluations, seconds : by estimator
    coverage : what the searches for modes of both have covered together
    missed : by how much ln Z is larger at least, by modes that the draws have missed; 0 if none is known
    """

    log_evidence: Mapping[str, float]
    log_evidence_sd: Mapping[str, float]
    difference: float
    joint_sd: float
    disagreement: Disagreement | None
    evaluations: Mapping[str, int]
    seconds: Mapping[str, float]
    coverage: Coverage | None = None
    missed: float = 0.0

    @property
    def agreed(self) -> bool:
        """Whether the two estimators agree."""
        return self.disagreement is None

    @property
    def total_sd(self) -> float:
        """Joint standard error of both, that of the mass included."""
        return float(np.hypot(self.log_evidence_sd[NESTED], self.log_evidence_sd[BRIDGE]))

    @property
    def most(self) -> float:
        """The largest ln Z that either estimator leaves open, by five standard errors and the modes missed."""
        return max(z + 5 * self.log_evidence_sd[name] for name, z in self.log_evidence.items()) + self.missed

    @property
    def best(self) -> tuple[float, float]:
        """(ln Z, its standard error): the mean with weights 1 / sd^2, its error no less than the smaller one.

        The errors share that of the mass, so that two estimates are not worth twice one; of two that differ by more
        than their errors allow it is half of the difference at least.
        """
        z = np.array([self.log_evidence[e] for e in self.log_evidence])
        sd = np.maximum([self.log_evidence_sd[e] for e in self.log_evidence], 1e-6)
        w = sd**-2 / np.sum(sd**-2)
        apart = self.difference / 2 if self.difference > SIGMAS * self.joint_sd else 0.0
        return float(w @ z), max(float(np.min(sd)), apart)


def evidence(
    target: Target,
    seed: int = 0,
    *,
    mass: Mass | None = None,
    draws: Array | None = None,
    effective: float | None = None,
    log_posterior: Array | None = None,
) -> Evidence:
    """ln Z = ln of the integral of likelihood x prior, by nested sampling and by bridge sampling.

    Parameters
    ----------
    target : anything with the four members of `Target`
    mass : the part of the normalised prior that its cut leaves: Z is divided by it, for a prior that is cut integrates
        to its mass and not to one
    draws, effective, log_posterior : what `bridge` stands on; without draws it makes its own

    Raises what `nested` and `bridge` raise.
    """
    bridged = bridge(target, draws, seed=seed, effective=effective, log_posterior=log_posterior)
    return together({NESTED: nested(target, seed), BRIDGE: bridged}, mass)


def together(found: Mapping[str, EvidenceEstimate], mass: Mass | None = None) -> Evidence:
    """The estimates of one target, divided by the mass of its prior, and whether they agree."""
    mass = mass or Mass(1.0, 0.0)
    log_mass, log_mass_sd = float(np.log(mass.value)), mass.sd / mass.value
    z = {name: e.log_evidence - log_mass for name, e in found.items()}
    sd = {name: float(np.hypot(e.sd, log_mass_sd)) for name, e in found.items()}
    a, b = found[NESTED], found[BRIDGE]
    difference, joint = abs(a.log_evidence - b.log_evidence), float(np.hypot(a.sd, b.sd))
    missed = max(a.missed, b.missed)
    wrong = _disagreement(difference, joint, float(np.hypot(sd[NESTED], sd[BRIDGE])))
    return Evidence(
        z,
        sd,
        difference,
        joint,
        Disagreement.MISSED if missed and wrong is not Disagreement.NOT_FINITE else wrong,
        {n: e.evaluations for n, e in found.items()},
        {n: e.seconds for n, e in found.items()},
        covered([a.coverage, b.coverage]),
        missed,
    )


def _disagreement(difference: float, joint: float, total: float) -> Disagreement | None:
    """What is wrong with two estimates; the mass of the prior is in ``total`` and cancels in the others."""
    if not np.isfinite(difference) or not np.isfinite(total):
        return Disagreement.NOT_FINITE
    if total > WIDEST:
        return Disagreement.WIDE
    return Disagreement.APART if difference > max(SIGMAS * joint, IMMATERIAL) else None
