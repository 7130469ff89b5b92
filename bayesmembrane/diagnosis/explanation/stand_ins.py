"""Sets of effects of which one stands in for another: by a law that is not the library's, or for nothing at all.

A curve says how much a film softens or relaxes, and by what law of the library; of laws that are not there it says
nothing. Beside other effects, which take what such a law leaves, the sum is sure of the wrong one as often as not where
what it is made of has many laws, and hardly ever where it is an offset.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from math import exp, prod

from bayesmembrane.diagnosis.explanation.neighbours import NEGLIGIBLE
from bayesmembrane.diagnosis.explanation.twins import Set
from bayesmembrane.physics.effects.base import AT


def smaller_favoured(p: Mapping[Set, float], spurious: float) -> dict[Set, float]:
    """p e^(-s n) of sets of n effects, s being ``spurious``, with the sum that they had; that of no effect stays."""
    weighed = {names: q * exp(-spurious * (len(names) - 1)) for names, q in p.items() if names}
    before, after = sum(q for names, q in p.items() if names), sum(weighed.values())
    return {names: weighed[names] * before / after if names and after > 0 else q for names, q in p.items()}


def stood_in(
    p: Mapping[Set, float], mistaken: Mapping[str, float], alone: float, for_none: float, beside: int = 0
) -> dict[Set, float]:
    """A set with effects i keeps prod (1 - m_i) of p, and gives the rest away by each of them as m_i / sum m.

    m is how often an effect is ``mistaken``; of one without others beside it, in its set or among as many as are given
    ``beside`` every set, the part ``alone`` of that. Of what is given away by one effect the part ``for_none`` goes to
    the set without it, and the rest to those with another one instead that is at work in the same tests, as often as
    that is mistaken itself; all of it to the one where there is nothing of the other. The sum is kept. What has next to
    nothing gives nothing.
    """
    whole, out = sum(p.values()), defaultdict[Set, float](float)
    for names, q in p.items():
        part, gives = 1.0 if len(names) + beside > 1 else alone, q > NEGLIGIBLE * whole
        often = {n: part * mistaken.get(n, 0.0) for n in sorted(names) if gives}
        near = {n: _next_to(n, names, mistaken, for_none) for n, m in often.items() if m > 0}
        m = {n: often[n] for n, sets in near.items() if sets}
        kept = prod(1 - v for v in m.values())
        out[names] += q * kept
        for n, v in m.items():
            for other, share in near[n].items():
                out[other] += q * (1 - kept) * share * v / sum(m.values())
    return dict(out)


def _next_to(name: str, names: Set, mistaken: Mapping[str, float], for_none: float) -> dict[Set, float]:
    """Sets without ``name``, or with another effect of the same test, or of all tests, instead, and the share of each
    in what it gives away; they add up to one if there are any.
    """
    rest, tests = names - {name}, {"", name.partition(AT)[2]}
    instead = {n: m for n, m in mistaken.items() if m > 0 and n not in names and n.partition(AT)[2] in tests}
    less = 0.0 if not rest else for_none if instead else 1.0
    out = {rest | {n}: (1 - less) * m / sum(instead.values()) for n, m in instead.items()}
    return out | ({rest: less} if rest else {})
