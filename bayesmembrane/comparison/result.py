"""Hypotheses side by side: what is known of each, and the ranking."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.calibration.prior import Mass
from bayesmembrane.calibration.quality import Quality
from bayesmembrane.comparison.convexity_modes import ByMode
from bayesmembrane.comparison.evidence.estimate import Evidence
from bayesmembrane.comparison.leave_out.score import LeaveOneOut, LeaveRangeOut
from bayesmembrane.comparison.prior_widths import Widened
from bayesmembrane.ground.showable import Showable
from bayesmembrane.physics.hypothesis import Hypothesis


@dataclass(frozen=True, eq=False)
class Row:
    """One hypothesis.

    Attributes
    ----------
    label, hypothesis : which
    evidence : ln Z by both estimators, None if there is none
    loo, rest : leave-one-out; prediction of the rest of the range, None if that was not asked for
    prior_mass : part of the prior that its convexity mode leaves, None if it is not known
    posterior_probability : among the hypotheses that could be fitted, equally probable before; None without a ranking
    widths, modes : ln Z under other prior widths, and under the other convexity modes
    run : folder of the posterior draws, if it is stored
    evaluations, seconds : in all
    quality : how far the draws can be trusted, None without any
    failure : "" or why the hypothesis could not be fitted: the error that fitting raised
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
            "elpd_loo": loo.elpd if loo else None,
            "loo_se": loo.se if loo else None,
            "loo_refits": len(loo.refitted) if loo else None,
            "prior_mass": self.prior_mass.value if self.prior_mass else None,
            "prior_mass_sd": self.prior_mass.sd if self.prior_mass else None,
            "posterior_probability": self.posterior_probability,
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
        """The fitted rows on whose evidence the estimators do not agree."""
        return tuple(r for r in self.rows if r.evidence is not None and not r.evidence.agreed)

    @property
    def agreed(self) -> bool:
        """Whether both estimators agree on every hypothesis that could be fitted, and there is one."""
        return bool(self.fitted) and not self.doubtful

    @property
    def ranking(self) -> tuple[Row, ...]:
        """Fitted rows, the largest evidence first; empty without agreement."""
        if not self.agreed:
            return ()
        return tuple(sorted(self.fitted, key=lambda r: -r.evidence.best[0] if r.evidence else 0.0))

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
    z = np.array([r.evidence.best[0] if r.evidence else -np.inf for r in rows])
    p = np.exp(z - np.max(z)) / np.sum(np.exp(z - np.max(z)))
    return Comparison(
        tuple(replace(r, posterior_probability=float(q) if r.fitted else None) for r, q in zip(rows, p, strict=True))
    )
