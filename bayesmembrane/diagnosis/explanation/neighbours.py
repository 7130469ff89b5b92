"""Sets of effects beside those that explain a curve by the laws of the library: with one effect more, less, or another.

What is behind a curve follows laws of its own. Those of the library may then be met by another set, next to the true
one, and the sum over hypotheses does not see it: the true set is far behind, or was never looked at.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence

from bayesmembrane.diagnosis.explanation.twins import Set

NEGLIGIBLE = 1e-5
"""Of all that is told; sets that have less give nothing away, and receive nothing if they were not summed."""


def spread(p: Mapping[Set, float], visible: Sequence[str], most: int, share: float, farther: float) -> dict[Set, float]:
    """(1 - share) p + share (1 - farther) p K + share farther p K K, with the sum that p has.

    K takes a set to every one of ``visible`` effects, ``most`` at the most, that differs from it by one that is added,
    left out or exchanged, with the same probability. No effect is left as it is, for it is of laws that too much is
    said, and so is a set that nothing is next to.
    """
    whole = sum(p.values())
    if share == 0.0 or whole <= 0.0:
        return dict(p)
    least = NEGLIGIBLE * whole
    one = _stepped(p, visible, most, least)
    two = _stepped(one, visible, most, least)
    near = {n: (1 - farther) * one.get(n, 0.0) + farther * two.get(n, 0.0) for n in dict.fromkeys([*one, *two])}
    out = {n: (1 - share) * p.get(n, 0.0) + share * near.get(n, 0.0) for n in dict.fromkeys([*p, *near])}
    told = {n: q for n, q in out.items() if n in p or q > least}
    kept = whole / sum(told.values())
    return {n: q * kept for n, q in told.items()}


def _stepped(p: Mapping[Set, float], visible: Sequence[str], most: int, least: float) -> dict[Set, float]:
    """p K, but for what is next to nothing."""
    out = defaultdict[Set, float](float)
    for names, q in p.items():
        near = (_next_to(names, visible, most) if q > least else []) or [names]
        for other in near:
            out[other] += q / len(near)
    return out


def _next_to(names: Set, visible: Sequence[str], most: int) -> list[Set]:
    """All sets of some effects that differ by one, in an order that hangs on no hash."""
    if not names:
        return []
    rest = [v for v in visible if v not in names]
    less = [names - {own} for own in sorted(names)]
    more = [names | {v} for v in rest] if len(names) < most else []
    return more + [part for part in less if part] + [part | {v} for part in less for v in rest]
