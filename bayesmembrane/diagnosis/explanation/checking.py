"""What decides, checked by importance sampling."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bayesmembrane.diagnosis.candidates.sampled import checked
from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS
from bayesmembrane.diagnosis.explanation.grown import Grown
from bayesmembrane.diagnosis.explanation.unfitted import Key
from bayesmembrane.diagnosis.left.remaining import structure
from bayesmembrane.diagnosis.thresholds import GROWTH, SAMPLED, Drawing


def weigh_by_draws(out: Grown) -> None:
    """Importance sampling of all that decides: of the null model, and of every hypothesis that has a share in the sum;
    more of it of those that lead then.

    One that loses by it gives its share to others, which then are checked in their turn. Where what leads leaves more
    than noise nothing will stand out (`BELIEFS.blurred`): fewer are checked then, and none with more draws.
    """
    out.case.tell("checking what decides by importance sampling")
    _to_the_end(out)
    seen = out.seen()
    if _nothing_stands_out(out, seen):
        _check(out, seen, SAMPLED.vague)
        if _nothing_stands_out(out, seen):
            return
    _check(out, seen, SAMPLED.first)
    _check(out, seen, SAMPLED.last)


def _check(out: Grown, seen: Mapping[Key, float], drawing: Drawing) -> None:
    """What has the share of this ``drawing``, the most probable first, and the null model; again what was, if it is the
    last one.
    """
    null = (out.case.null.hypothesis.material.name, frozenset(out.case.null.names))
    again = drawing is SAMPLED.last
    rest = dict.fromkeys(key for key, c in out.found.items() if again or not c.by_draws or key == null)
    for _ in range(SAMPLED.most):
        shares = out.shares(seen)
        first = not again and null in rest
        key = null if first else max(rest, key=shares.__getitem__, default=null)
        if key not in rest or not (first or shares[key] > np.log(drawing.share)):
            break
        del rest[key]
        if key not in out.ended:
            out.search_to_the_end([key])
        out.found[key] = checked(out.search, out.found[key], drawing)


def _nothing_stands_out(out: Grown, seen: Mapping[Key, float]) -> bool:
    """True if the hypothesis with the largest share has effects and leaves more than noise all the same, and so do all
    with effects that are not far behind it: draws may change that by as much.
    """
    shares = out.shares(seen)
    most = max(shares.values())
    near = [out.found[key] for key, s in shares.items() if most - s < SAMPLED.may_change]
    first = out.found[max(shares, key=shares.__getitem__)]
    rivals = (c for c in near if out.own(c))
    return bool(out.own(first)) and all(structure(out.search, c) >= BELIEFS.blurred for c in rivals)


def _to_the_end(out: Grown) -> None:
    """What has a share in the sum searched on until nothing is gained, if it was not: a linear model says how probable
    a set is from beside its end, but draws are made about where the search was.
    """
    shares = out.shares(out.seen())
    order = sorted((k for k, s in shares.items() if s > np.log(SAMPLED.first.share)), key=lambda k: -shares[k])
    out.search_to_the_end([k for k in order if k not in out.ended][: GROWTH.to_the_end])
