"""Our results beside those of the source paper, in words: losses of the optima, and the order of the materials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bayesmembrane.comparison.result import Comparison, Row
from bayesmembrane.data.published import PublishedTable
from bayesmembrane.words.hypothesis import spoken
from bayesmembrane.words.language import listed, newtons

LEVEL = 0.1  # losses that differ by less than this part rank the same
DECIDED = 2.0  # standard errors of a difference of ln Z, below which neither order is decided

PaperLosses = Mapping[str, Mapping[str, float]]
"""By range and material: the loss of the paper's optimum, N."""


def paper_losses(table: PublishedTable) -> dict[str, dict[str, float]]:
    """Losses of the paper's optima over the range that they were fitted to, N, by range and material."""
    return {
        name: {row.material: float(row.loss[i]) for row in table.rows if row.column == name}
        for i, name in enumerate(table.ranges)
    }


@dataclass(frozen=True)
class LossPair:
    """Ours and the paper's loss of one material over one range, "the range up to 30 mm", N, on the same curve."""

    name: str
    range: str
    ours: float
    paper: float | None


def losses(pairs: Sequence[LossPair]) -> str:
    """How our optima compare with the paper's parameters on the same curve."""
    known = [(p, p.paper) for p in pairs if p.paper is not None]
    if not known:
        return ""
    above = [p for p, paper in known if p.ours > paper * (1 + 1e-6)]
    far = [(p, paper) for p, paper in known if p.ours < 0.5 * paper]
    if above:
        told = listed(f"{p.name} over {p.range}" for p in above)
        return f"Our optimum has a larger loss than the paper's parameters for {told}: the search missed a minimum."
    sentence = "No loss of ours lies above that of the paper's parameters on the same curve."
    if far:
        told = listed(f"{p.name} over {p.range} ({newtons(p.ours)} against {newtons(paper)})" for p, paper in far)
        sentence += f" Ours is less than half of it for {told}."
    return sentence


def order_sentences(c: Comparison, paper: Mapping[str, float]) -> list[str]:
    """A sentence for every pair that evidence and the paper's losses (N, by material) put in another order, and one if
    there is none.
    """
    ranking = [r for r in c.ranking if r.hypothesis.material.name in paper and not r.hypothesis.effects]
    told = []
    for i, better in enumerate(ranking):
        for worse in ranking[i + 1 :]:
            a, b = paper[better.hypothesis.material.name], paper[worse.hypothesis.material.name]
            if a > b:
                told.append(_difference(better, worse, a, b))
    if len(ranking) > 1 and not told:
        told.append("the evidence puts the materials in the same order as the paper's losses.")
    return told


def _difference(better: Row, worse: Row, a: float, b: float) -> str:
    assert better.evidence is not None
    assert worse.evidence is not None
    (za, sa), (zb, sb) = better.evidence.best, worse.evidence.best
    gap, sd = za - zb, float(np.hypot(sa, sb))
    names = spoken(better.hypothesis), spoken(worse.hypothesis)
    start = (
        f"the evidence puts {names[0]} before {names[1]} by {gap:.1f} +- {sd:.2g} in ln Z, and the paper has them the "
        f"other way round, with losses of {a:.3g} and {b:.3g} N"
    )
    if gap < DECIDED * sd or gap < 1.0:
        return f"{start}; neither order is decided."
    extra = worse.hypothesis.curve_size - better.hypothesis.curve_size
    if extra > 0 and a < (1 + LEVEL) * b:
        return (
            f"{start}: the losses are level within {100 * LEVEL:.0f} %, and the {extra} more parameters of {names[1]} "
            "do not pay for themselves."
        )
    if extra > 0:
        return (
            f"{start}: the loss counts the fit of the best point alone; the evidence also counts the {extra} more "
            f"parameters of {names[1]}, most of whose prior the data rule out."
        )
    return (
        f"{start}: the paper's losses weigh every point alike and come from optima without our convexity prior; the "
        "evidence weighs each point by its noise and averages over the prior."
    )
