"""Hypotheses side by side: what is known of each, and the ranking."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import logsumexp

from bayesmembrane.calibration.prior import Mass
from bayesmembrane.calibration.quality import Quality
from bayesmembrane.comparison.convexity_modes import ByMode
from bayesmembrane.comparison.evidence.estimate import Evidence
from bayesmembrane.comparison.leave_out.score import LeaveOneOut, LeaveRangeOut
from bayesmembrane.comparison.prior_widths import Widened
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.showable import Showable
from bayesmembrane.physics.hypothesis import Hypothesis

REACH = 10.0  # of ln Z: what is certainly farther behind the best has a probability below 1e-4


@dataclass(frozen=True)
class ByWeights:
    """ln Z by the importance weights of all that a mixture proposed, its standard error, and Pareto's k-hat of them."""

    log_evidence: float
    sd: float
    k_hat: float


@dataclass(frozen=True, eq=False)
class Row:
    """One hypothesis.

    Attributes
    ----------
    label, hypothesis : which
    evidence : ln Z by both estimators, None if there is none
    loo, rest : leave-one-out; prediction of the rest of the range, None if that was not asked for
    prior_mass : part of the prior that its convexity mode leaves, None if it is not known
    posterior_probability, posterior_probability_sd : among the hypotheses that could be fitted, equally probable
        before, with the standard error that those of ln Z make; None without a ranking
    widths, modes : ln Z under other prior widths, and under the other convexity modes
    run : folder of the posterior draws, if it is stored
    evaluations, seconds : in all
    quality : how far the draws can be trusted, None without any
    failure : "" or why the hypothesis could not be fitted: the error that fitting raised
    by_weights : a third estimate of ln Z, which does not decide; None where emcee's ensembles walked
    """

    label: str
    hypothesis: Hypothesis
    evidence: Evidence | None = None
    loo: LeaveOneOut | None = None
    rest: LeaveRangeOut | None = None
    prior_mass: Mass | None = None
    posterior_probability: float | None = None
    widths: tuple[Widened, ...] = ()
    modes: tuple[ByMode, ...] = ()
    run: Path | None = None
    evaluations: int = 0
    seconds: float = 0.0
    quality: Quality | None = None
    failure: str = ""
    posterior_probability_sd: float | None = None
    by_weights: ByWeights | None = None

    @property
    def fitted(self) -> bool:
        """Whether it has an evidence."""
        return self.evidence is not None

    def summary(self) -> dict[str, Any]:
        """Plain values."""
        e, loo = self.evidence, self.loo
        return {
            "hypothesis": self.label,
            "log_evidence": dict(e.log_evidence) if e else {},
            "log_evidence_sd": dict(e.log_evidence_sd) if e else {},
            "agreed": bool(e and e.agreed),
            "by_weights": asdict(self.by_weights) if self.by_weights else None,
            "elpd_loo": loo.elpd if loo else None,
            "loo_se": loo.se if loo else None,
            "loo_refits": len(loo.refitted) if loo else None,
            "prior_mass": self.prior_mass.value if self.prior_mass else None,
            "prior_mass_sd": self.prior_mass.sd if self.prior_mass else None,
            "posterior_probability": self.posterior_probability,
            "posterior_probability_sd": self.posterior_probability_sd,
            "coverage": asdict(e.coverage) if e and e.coverage else None,
            "held_out": self.rest.summary() if self.rest else None,
            "prior_widths": [w.summary() for w in self.widths],
            "convexity_modes": [m.summary() for m in self.modes],
            "run": str(self.run) if self.run else None,
            "evaluations": self.evaluations,
            "seconds": self.seconds,
        }


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Showable):
    """Hypotheses side by side: ``rows`` in the order asked for."""

    rows: tuple[Row, ...]

    @property
    def fitted(self) -> tuple[Row, ...]:
        """The rows with an evidence."""
        return tuple(r for r in self.rows if r.fitted)

    @property
    def doubtful(self) -> tuple[Row, ...]:
        """The fitted rows on whose evidence the estimators do not agree, although it could be near the best."""
        known = [r.evidence.best[0] for r in self.rows if r.evidence is not None and r.evidence.agreed]
        least = max(known, default=-np.inf) - REACH
        unsure = (r for r in self.rows if r.evidence is not None and not r.evidence.agreed)
        return tuple(r for r in unsure if r.evidence is not None and not r.evidence.most < least)

    @property
    def agreed(self) -> bool:
        """Whether both estimators agree on every hypothesis that could be near the best, and there is one."""
        return bool(self.fitted) and not self.doubtful

    @property
    def ranking(self) -> tuple[Row, ...]:
        """Rows whose evidence is known, the largest first; empty without agreement."""
        if not self.agreed:
            return ()
        known = [r for r in self.rows if r.evidence is not None and r.evidence.agreed]
        return tuple(sorted(known, key=lambda r: -r.evidence.best[0] if r.evidence else 0.0))

    def summary(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "table": [r.summary() for r in self.rows],
            "agreed": self.agreed,
            "ranking": [r.label for r in self.ranking],
        }


def ranked(rows: Sequence[Row]) -> Comparison:
    """The comparison of rows whose probabilities are not known yet."""
    found = Comparison(tuple(rows))
    if not found.agreed:
        return found
    # What is out of reach counts with the most that it can be.
    best = [(-np.inf, 0.0) if e is None else e.best if e.agreed else (e.most, 0.0) for e in (r.evidence for r in rows)]
    p, error = probabilities(*(np.array(column) for column in zip(*best, strict=True)))
    judged = [
        replace(r, posterior_probability=float(q), posterior_probability_sd=float(e)) if r.fitted else r
        for r, q, e in zip(rows, p, error, strict=True)
    ]
    return Comparison(tuple(judged))


def probabilities(log_evidence: Array, sd: Array) -> tuple[Array, Array]:
    """p_i = Z_i / sum_j Z_j of ln Z (M,), with standard errors p_i sqrt(sum_j (delta_ij - p_j)^2 sd_j^2), (M,) each."""
    p = np.exp(log_evidence - logsumexp(log_evidence))
    return p, p * np.sqrt((1 - 2 * p) * sd**2 + np.sum(p**2 * sd**2))
