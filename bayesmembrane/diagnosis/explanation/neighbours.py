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


def spread(p: Mapping[Set, float], visible: Sequence[str], shares: Sequence[float], farther: float) -> dict[Set, float]:
    """p - q + (1 - farther) q K + farther q K K, with the sum that p has, where q of a set is its ``shares`` [size] p.

    K takes a set to those of ``visible`` effects, as large as there are shares at the most, that differ from it by one
    that is added, left out or exchanged: each of the three is as probable, where there is such a set, and so are all
    sets of one of them. No effect is left as it is, for it is of laws that too much is said, and so is a set that
    nothing is next to.
    """
    whole, most = sum(p.values()), len(shares) - 1
    given = {n: shares[len(n)] * q for n, q in p.items()}
    if not any(given.values()):
        return dict(p)
    least = NEGLIGIBLE * whole
    one = _stepped(given, visible, most, least)
    two = _stepped(one, visible, most, least)
    near = {n: (1 - farther) * one.get(n, 0.0) + farther * two.get(n, 0.0) for n in dict.fromkeys([*one, *two])}
    out = {n: p.get(n, 0.0) - given.get(n, 0.0) + near.get(n, 0.0) for n in dict.fromkeys([*p, *near])}
    told = {n: q for n, q in out.items() if n in p or q > least}
    kept = whole / sum(told.values())
    return {n: q * kept for n, q in told.items()}


def _stepped(p: Mapping[Set, float], visible: Sequence[str], most: int, least: float) -> dict[Set, float]:
    """p K, but for what is next to nothing."""
    out = defaultdict[Set, float](float)
    for names, q in p.items():
        near = (_next_to(names, visible, most) if q > least else []) or [[names]]
        for alike in near:
            for other in alike:
                out[other] += q / (len(near) * len(alike))
    return out


def _next_to(names: Set, visible: Sequence[str], most: int) -> list[list[Set]]:
    """The sets of some effects that have one more, one less and another one, as far as there are any, in an order that
    hangs on no hash.
    """
    if not names:
        return []
    rest = [v for v in visible if v not in names]
    less = [names - {own} for own in sorted(names)]
    more = [names | {v} for v in rest] if len(names) < most else []
    return [alike for alike in (more, [part for part in less if part], [p | {v} for p in less for v in rest]) if alike]
