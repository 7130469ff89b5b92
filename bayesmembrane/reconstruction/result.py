"""The answer of a reconstruction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.showable import Showable
from bayesmembrane.reconstruction.rows import Correction, Suspect


@dataclass(frozen=True)
class RangeResult:
    """One range of training deflections.

    Attributes
    ----------
    name : of the range
    n_points : probability of each number of points
    positions : for each number of points looked at, ln evidence relative to the best, and the most probable first
        position in m
    first, first_sd : mean and standard deviation of the first position, m, for the most probable number
    deflection, force, force_sd : (n,) at the most probable positions; m, N, N
    """

    name: str
    n_points: dict[int, float]
    positions: dict[int, tuple[float, float]]
    first: float
    first_sd: float
    deflection: Array
    force: Array
    force_sd: Array

    def summary(self) -> dict[str, Any]:
        """Plain numbers, lengths in mm."""
        evidence = {
            str(n): {"log_evidence": e, "most_probable_first_mm": 1e3 * a} for n, (e, a) in self.positions.items()
        }
        return {
            "n_points": {str(n): p for n, p in self.n_points.items()},
            "first_mm": {"mean": 1e3 * self.first, "sd": 1e3 * self.first_sd},
            "deflection_mm": (1e3 * self.deflection).tolist(),
            "force_N": self.force.tolist(),
            "sd_N": self.force_sd.tolist(),
            "evidence": evidence,
        }


@dataclass(frozen=True)
class LossCheck:
    """One printed loss, beside the distance of the reconstructed curve and what the other rows predict; all in N.

    ``wrong`` is the probability that the row says something wrong, judged by the other rows.
    """

    material: str
    column: str
    range: str
    printed: float
    reconstructed: float
    predicted: float
    predicted_sd: float
    wrong: float

    def summary(self) -> dict[str, Any]:
        """Plain numbers, N."""
        return {
            "material": self.material,
            "column": self.column,
            "range": self.range,
            "printed_N": self.printed,
            "reconstructed_minus_printed_N": self.reconstructed - self.printed,
            "others_predict_N": self.predicted,
            "others_predict_sd_N": self.predicted_sd,
            "probability_row_is_wrong": self.wrong,
        }


@dataclass(frozen=True)
class FamilyResult:
    """What one family of curves says by itself.

    Attributes
    ----------
    name, title : how answers call it, how reports print it
    probability : after the losses; families are equally probable before them
    log_evidence : ln p(losses) by Laplace's approximation, relative to the best family
    least_probability : what it has whatever its evidence, for evidences are not that sure; 0 if it is far behind
    force, force_sd : (N,) N, at the deflections of the reconstruction; None for a family that is not mixed
    """

    name: str
    title: str
    probability: float
    log_evidence: float
    least_probability: float
    force: Array | None
    force_sd: Array | None

    def summary(self) -> dict[str, Any]:
        """Plain numbers, N."""
        return {
            "title": self.title,
            "probability": self.probability,
            "log_evidence": self.log_evidence if np.isfinite(self.log_evidence) else None,
            "least_probability": self.least_probability,
            "force_N": None if self.force is None else self.force.tolist(),
            "sd_N": None if self.force_sd is None else self.force_sd.tolist(),
        }


@dataclass(frozen=True)
class Influence:
    """Forces (N,) in N at the same deflections if one assumption were changed, and what that does to ln evidence.

    The change is that of the curve with a smooth logarithm, in which all of these assumptions mean something. The
    evidence is None where the data or the measure of the first positions differ too.
    """

    changed: str
    force: Array
    log_evidence: float | None


@dataclass(frozen=True, repr=False)
class Reconstruction(Showable):
    """The measured curve, how sure it is, and which printed rows contradict the others.

    Attributes
    ----------
    ranges : one result per range
    covariance : (N, N) N^2, of the forces of all ranges one after the other: family, curve, load cell, positions
    losses : every printed loss beside the reconstructed one
    suspects : rows that contradict the others, with the smallest corrections
    influence : what other priors and likelihoods would give
    scales : posterior means of roughness, rounding and solver errors
    families : what the curve may be, with probabilities; forces and covariance are those of their mixture
    """

    ranges: tuple[RangeResult, ...]
    covariance: Array
    losses: tuple[LossCheck, ...]
    suspects: tuple[Suspect, ...]
    influence: tuple[Influence, ...]
    scales: dict[str, float]
    families: tuple[FamilyResult, ...] = ()

    @property
    def deflection(self) -> Array:
        """(N,) m, ranges one after the other."""
        return np.concatenate([r.deflection for r in self.ranges])

    @property
    def force(self) -> Array:
        """(N,) N, ranges one after the other."""
        return np.concatenate([r.force for r in self.ranges])

    def summary(self) -> dict[str, Any]:
        """Plain numbers; lengths in mm, forces in N."""
        influence = [
            {"changed": i.changed, "force_change_N": (i.force - self.force).tolist(), "log_evidence": i.log_evidence}
            for i in self.influence
        ]
        return {
            **{r.name: r.summary() for r in self.ranges},
            "families": {f.name: f.summary() for f in self.families},
            "suspect_rows": [_suspect(s) for s in self.suspects],
            "covariance_N2": self.covariance.tolist(),
            "losses": [c.summary() for c in self.losses],
            "influence": influence,
            "scales": self.scales,
        }


def _suspect(found: Suspect) -> dict[str, Any]:
    return {
        "material": found.material,
        "column": found.column,
        "probability": found.probability,
        "corrections": _entries(found.corrections),
        "alternatives": [_entries(a) for a in found.alternatives],
    }


def _entries(corrections: Sequence[Correction]) -> list[dict[str, Any]]:
    return [
        {"entry": c.entry, "printed": c.printed, "consistent": c.consistent, "best": c.best, "sd": c.sd}
        for c in corrections
    ]
