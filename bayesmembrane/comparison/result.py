"""Hypotheses side by side: what is known of each, the ranking, and both in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.calibration.prior import Mass
from bayesmembrane.calibration.quality import Quality
from bayesmembrane.comparison.convexity_modes import ByMode
from bayesmembrane.comparison.evidence.estimate import WIDEST, Evidence
from bayesmembrane.comparison.leave_out.score import LeaveOneOut, LeaveRangeOut
from bayesmembrane.comparison.prior_widths import Widened
from bayesmembrane.physics.hypothesis import Hypothesis

DECIDED = 2.0  # standard errors of a difference, below which it is none


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
    reason : "" or why the hypothesis has no evidence, as a sentence
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
    reason: str = ""

    @property
    def fitted(self) -> bool:
        """Whether it has an evidence."""
        return self.evidence is not None

    def summary(self) -> dict[str, Any]:
        """Plain values for the JSON answer of ``compare``."""
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
            "held_out": _held_out(self.rest) if self.rest else None,
            "prior_widths": [_plain(vars(w)) for w in self.widths],
            "convexity_modes": [_plain(vars(m)) for m in self.modes],
            "run": str(self.run) if self.run else None,
            "evaluations": self.evaluations,
            "seconds": self.seconds,
            "reason": self.reason or (e.reason if e else ""),
        }


@dataclass(frozen=True, eq=False)
class Comparison:
    """Hypotheses side by side.

    Attributes
    ----------
    rows : in the order asked for
    agreed : both estimators agree on every hypothesis that could be fitted, and there is one
    reason : "" or why there is no ranking, as a sentence
    sentence : what evidence and prediction prefer, and whether they disagree
    survival : whether the ranking survives other widths of the priors
    """

    rows: tuple[Row, ...]
    agreed: bool
    reason: str
    sentence: str
    survival: str

    @property
    def ranking(self) -> tuple[Row, ...]:
        """Fitted rows, the largest evidence first; empty without agreement."""
        fitted = [r for r in self.rows if r.evidence is not None]
        if not self.agreed:
            return ()
        return tuple(sorted(fitted, key=lambda r: -r.evidence.best[0] if r.evidence else 0.0))

    def summary(self) -> dict[str, Any]:
        """Plain values for the JSON answer of ``compare``."""
        return {
            "table": [r.summary() for r in self.rows],
            "agreed": self.agreed,
            "reason": self.reason,
            "ranking": [r.label for r in self.ranking],
            "sentence": self.sentence,
            "prior_sensitivity": self.survival,
        }


def ranked(rows: Sequence[Row]) -> Comparison:
    """The comparison of rows whose probabilities are not known yet."""
    agreed, reason = _agreement(rows)
    if agreed:
        z = np.array([r.evidence.best[0] if r.evidence else -np.inf for r in rows])
        p = np.exp(z - np.max(z)) / np.sum(np.exp(z - np.max(z)))
        rows = [replace(r, posterior_probability=float(q) if r.fitted else None) for r, q in zip(rows, p, strict=True)]
    return Comparison(tuple(rows), agreed, reason, _sentence(rows, agreed), survival(rows))


def _agreement(rows: Sequence[Row]) -> tuple[bool, str]:
    fitted = [r for r in rows if r.evidence is not None]
    if not fitted:
        return False, "None of the hypotheses could be fitted."
    doubtful = [r for r in fitted if r.evidence is not None and not r.evidence.agreed]
    if doubtful:
        told = " ".join(f"{r.label}: {r.evidence.reason}" for r in doubtful if r.evidence)
        return False, f"There is no ranking, because ln Z is not known well enough of {len(doubtful)} of them. {told}"
    return True, ""


# ---- in words --------------------------------------------------------------------------------------------------------


def _sentence(rows: Sequence[Row], agreed: bool) -> str:
    """What evidence and leave-one-out prefer, by how much, and whether they disagree."""
    both = [r for r in rows if r.evidence is not None and r.loo is not None]
    if len(both) < 2:
        return "There are not two hypotheses to choose between."
    by_loo = sorted(both, key=lambda r: -r.loo.elpd if r.loo else 0.0)
    predicts, next_best = by_loo[0], by_loo[1]
    if not agreed:
        gap, se = _elpd_gap(predicts, next_best)
        return (
            f"The evidence gives no ranking; leave-one-out prefers {predicts.label} to {next_best.label} by {gap:.1f} "
            f"+- {se:.1f}{_weak(gap, se)}."
        )
    by_z = sorted(both, key=lambda r: -_best(r)[0])
    gap = _best(by_z[0])[0] - _best(by_z[1])[0]
    sd = float(np.hypot(_best(by_z[0])[1], _best(by_z[1])[1]))
    start = f"The evidence prefers {by_z[0].label} to {by_z[1].label} by {gap:.1f} +- {sd:.2g} in ln Z{_bayes(gap)}"
    if predicts is by_z[0]:
        d, se = _elpd_gap(predicts, next_best)
        return f"{start}, and leave-one-out prefers it too, to {next_best.label} by {d:.1f} +- {se:.1f}{_weak(d, se)}."
    d, se = _elpd_gap(predicts, by_z[0])
    if d > DECIDED * se:
        return (
            f"{start}, but leave-one-out prefers {predicts.label} to it by {d:.1f} +- {se:.1f}: evidence and "
            "prediction disagree, and of the two the evidence is the one that depends on the width of the priors."
        )
    return (
        f"{start}, and leave-one-out puts {predicts.label} before it by {d:.1f} +- {se:.1f}{_weak(d, se)}: prediction "
        "does not contradict the evidence."
    )


def survival(rows: Sequence[Row]) -> str:
    """Whether the first of the ranking stays first when any one prior is half or twice as wide, as a sentence."""
    fitted = sorted((r for r in rows if r.evidence is not None), key=lambda r: -_best(r)[0])
    if len(fitted) < 2:
        return ""
    first, second = fitted[:2]
    lead = _best(first)[0] - _best(second)[0]
    # The prior of the noise is the same for all: changing it for one alone would say nothing.
    changed = [(r, w) for r in fitted for w in r.widths if w.factor != 1.0 and not w.parameter.startswith("noise.")]
    known = [(r, w) for r, w in changed if not w.reason]
    unknown = len(changed) - len(known)
    if not known:
        return "What other widths of the priors would do to ln Z cannot be said from these draws."
    # The first can fall, and any other can rise.
    fall, down = max(((-w.change, w) for r, w in known if r is first), key=lambda c: c[0], default=(0.0, known[0][1]))
    rise, up = max(
        ((_best(r)[0] - _best(second)[0] + w.change, w) for r, w in known if r is not first),
        key=lambda c: c[0],
        default=(0.0, known[0][1]),
    )
    worst = lead - max(fall, rise)
    which = down if fall >= rise else up
    rest = f" {unknown} of the changes cannot be told from these draws." if unknown else ""
    if worst > 0:
        return (
            f"{first.label} stays first when any one prior is half or twice as wide: its lead of {lead:.1f} in ln Z "
            f"falls to {worst:.1f} at worst, with the prior of {which.parameter} {which.factor:g} times as wide.{rest}"
        )
    return (
        f"The first place depends on the priors: with the prior of {which.parameter} {which.factor:g} times as wide, "
        f"the lead of {first.label} of {lead:.1f} in ln Z is lost by {-worst:.1f}.{rest}"
    )


def _best(row: Row) -> tuple[float, float]:
    assert row.evidence is not None
    return row.evidence.best


def _elpd_gap(a: Row, b: Row) -> tuple[float, float]:
    """elpd_a - elpd_b and its standard error, from the differences point by point."""
    assert a.loo is not None
    assert b.loo is not None
    d = a.loo.pointwise - b.loo.pointwise
    return float(np.sum(d)), float(np.sqrt(d.size * np.var(d)))


def _weak(gap: float, se: float) -> str:
    return "" if gap > DECIDED * se else ", which is no difference"


def _bayes(gap: float) -> str:
    return ", which decides little" if gap < 1.0 + WIDEST else ""


def _held_out(rest: LeaveRangeOut) -> dict[str, Any]:
    names = ("elpd", "se", "monte_carlo_sd", "effective", "lost", "rmse_N", "max_N", "points")
    return _plain({n: getattr(rest, n) for n in names})


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """nan as None."""
    return {k: None if isinstance(v, float) and not np.isfinite(v) else v for k, v in values.items()}
