"""ln Z by two estimators that share nothing but the posterior, and whether they agree."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from bayesmembrane.calibration.prior import Mass
from bayesmembrane.comparison.evidence.bridge import bridge
from bayesmembrane.comparison.evidence.nested import nested
from bayesmembrane.comparison.evidence.target import Estimate, Target
from bayesmembrane.ground.parameters import Array

NESTED, BRIDGE = "nested", "bridge"
SIGMAS, WIDEST = 2.0, 0.3

Tell = Callable[[str], None]


@dataclass(frozen=True)
class Evidence:
    """ln Z of one target.

    Attributes
    ----------
    log_evidence, log_evidence_sd : by estimator, ``nested`` and ``bridge``; divided by the prior's mass, whose error is
        in the standard errors
    agreed : they differ by at most two joint standard errors, and the joint standard error is at most 0.3
    reason : "" if they agree, or why they do not, as a sentence
    evaluations, seconds : by estimator
    """

    log_evidence: Mapping[str, float]
    log_evidence_sd: Mapping[str, float]
    agreed: bool
    reason: str
    evaluations: Mapping[str, int]
    seconds: Mapping[str, float]

    @property
    def best(self) -> tuple[float, float]:
        """(ln Z, its standard error): the mean with weights 1 / sd^2, its error no less than the smaller one.

        The errors share that of the mass, so that two estimates are not worth twice one.
        """
        z = np.array([self.log_evidence[e] for e in self.log_evidence])
        sd = np.maximum([self.log_evidence_sd[e] for e in self.log_evidence], 1e-6)
        w = sd**-2 / np.sum(sd**-2)
        return float(w @ z), float(np.min(sd))


def evidence(
    target: Target,
    seed: int = 0,
    *,
    mass: Mass | None = None,
    draws: Array | None = None,
    effective: float | None = None,
    log_posterior: Array | None = None,
    tell: Tell | None = None,
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
    found = {NESTED: nested(target, seed, tell=tell)}
    if tell is not None:
        tell("bridge sampling")
    found[BRIDGE] = bridge(target, draws, seed=seed, effective=effective, log_posterior=log_posterior)
    return together(found, mass)


def together(found: Mapping[str, Estimate], mass: Mass | None = None) -> Evidence:
    """The estimates of one target, divided by the mass of its prior, and whether they agree."""
    mass = mass or Mass(1.0, 0.0)
    log_mass, log_mass_sd = float(np.log(mass.value)), mass.sd / mass.value
    z = {name: e.log_evidence - log_mass for name, e in found.items()}
    sd = {name: float(np.hypot(e.sd, log_mass_sd)) for name, e in found.items()}
    agreed, reason = _agreement(found, sd)
    return Evidence(
        z, sd, agreed, reason, {n: e.evaluations for n, e in found.items()}, {n: e.seconds for n, e in found.items()}
    )


def _agreement(found: Mapping[str, Estimate], sd: Mapping[str, float]) -> tuple[bool, str]:
    """Whether two estimates agree, and the reason if not; the mass of the prior cancels in their difference."""
    a, b = found[NESTED], found[BRIDGE]
    joint, total = float(np.hypot(a.sd, b.sd)), float(np.hypot(sd[NESTED], sd[BRIDGE]))
    difference = abs(a.log_evidence - b.log_evidence)
    if not np.isfinite(difference) or not np.isfinite(total):
        return False, "One of the two estimates of ln Z is not a finite number."
    if total > WIDEST:
        return False, f"The joint standard error of ln Z, {total:.2f}, is above {WIDEST:g}."
    if difference > SIGMAS * joint:
        return False, (
            f"Nested sampling and bridge sampling differ by {difference:.2f} in ln Z, which is "
            f"{difference / joint:.1f} joint standard errors."
        )
    return True, ""
