"""Hypotheses judged under several noise models: what each is worth whatever the noise, and who leads under each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import logsumexp

from bayesmembrane.comparison.result import Comparison, Row
from bayesmembrane.physics.hypothesis import Hypothesis

AUTO = "auto"
NOISES = ("white", "ar1", "form")
"""What "auto" judges every hypothesis under, equally probable before."""


@dataclass(frozen=True)
class OverNoises:
    """One material with its effects.

    Attributes
    ----------
    label, hypothesis : which, the latter with the noise under which it is most probable
    log_evidence, sd : ln of the mean of Z over the noise models under which it could be fitted, and its standard error
    by_noise : noise -> ln Z
    posterior_probability : the sum of its rows'; None without a ranking
    """

    label: str
    hypothesis: Hypothesis
    log_evidence: float
    sd: float
    by_noise: dict[str, float]
    posterior_probability: float | None

    def summary(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "hypothesis": self.label,
            "log_evidence": self.log_evidence,
            "log_evidence_sd": self.sd,
            "by_noise": dict(self.by_noise),
            "posterior_probability": self.posterior_probability,
        }


def several(found: Comparison) -> bool:
    """Whether hypotheses were judged under more than one noise model."""
    return len({r.hypothesis.noise.name for r in found.rows}) > 1


def over_noises(found: Comparison) -> tuple[OverNoises, ...]:
    """Every hypothesis with an evidence, whatever its noise; the most probable first."""
    groups: dict[str, list[Row]] = {}
    for row in found.fitted:
        groups.setdefault(_own(row), []).append(row)
    return tuple(sorted((_summed(label, rows) for label, rows in groups.items()), key=lambda s: -s.log_evidence))


def under(found: Comparison, noise: str) -> Comparison:
    """The rows of one noise model."""
    return Comparison(tuple(r for r in found.rows if r.hypothesis.noise.name == noise))


def noises_of(found: Comparison) -> list[str]:
    """The noise models of the fitted rows, the most probable first."""
    z: dict[str, list[float]] = {}
    for row in found.fitted:
        if row.evidence is not None:
            z.setdefault(row.hypothesis.noise.name, []).append(row.evidence.best[0])
    return sorted(z, key=lambda n: -float(logsumexp(z[n])))


def _own(row: Row) -> str:
    """Material, effects and convexity prior: all but the noise."""
    h = row.hypothesis
    return h.label() if h.convexity.name == "reached" else f"{h.label()} ({h.convexity.name})"


def _summed(label: str, rows: list[Row]) -> OverNoises:
    best = [(r.hypothesis, *r.evidence.best) for r in rows if r.evidence is not None]
    z, sd = np.array([b[1] for b in best]), np.array([b[2] for b in best])
    share = np.exp(z - logsumexp(z))
    known = [r.posterior_probability for r in rows]
    return OverNoises(
        label,
        best[int(np.argmax(z))][0],
        float(logsumexp(z) - np.log(len(z))),
        float(np.sqrt(np.sum((share * sd) ** 2))),
        {b[0].noise.name: b[1] for b in best},
        None if None in known else float(np.sum(np.array(known, dtype=float))),
    )
