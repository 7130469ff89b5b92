"""Sets of effects beside those that explain a curve by the laws of the library: with one effect more, less, or another.

What is behind a curve follows laws of its own. Those of the library may then be met by another set, next to the true
one, and the sum over hypotheses does not see it: the true set is far behind, or was never looked at.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence

Set = frozenset[str]

NEGLIGIBLE = 1e-5
"""Of all that is told; sets that have less are left out."""


def spread(p: Mapping[Set, float], visible: Sequence[str], most: int, share: float, further: float) -> dict[Set, float]:
    """(1 - share) p + share (1 - further) p K + share further p K K, with the sum that p has.

    K takes a set to every one of ``visible`` effects, ``most`` at the most, that differs from it by one that is added,
    left out or exchanged, with the same probability. No effect keeps what it has, for it is of laws that too much is
    said.
    """
    if share == 0.0:
        return dict(p)
    one = _stepped(p, visible, most)
    two = _stepped(one, visible, most)
    near = {names: (1 - further) * one.get(names, 0.0) + further * two.get(names, 0.0) for names in {*one, *two}}
    out = {names: (1 - share) * p.get(names, 0.0) + share * near.get(names, 0.0) for names in {*p, *near}}
    whole = sum(p.values())
    told = {names: q for names, q in out.items() if q > NEGLIGIBLE * whole}
    return {names: q * whole / sum(told.values()) for names, q in told.items()}


def _stepped(p: Mapping[Set, float], visible: Sequence[str], most: int) -> dict[Set, float]:
    """p K."""
    out = defaultdict[Set, float](float)
    for names, q in p.items():
        near = _next_to(names, visible, most) if names else [names]
        for other in near:
            out[other] += q / len(near)
    return out


def _next_to(names: Set, visible: Sequence[str], most: int) -> list[Set]:
    """All sets that differ by one effect; the order of names does not hang on that of a hash."""
    rest = [v for v in visible if v not in names]
    more = [names | {v} for v in rest] if len(names) < most else []
    less = [names - {own} for own in sorted(names)]
    return more + less + [part | {v} for part in less for v in rest]
