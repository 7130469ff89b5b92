"""How the sum is told: flatter than it is, and a part of it of sets and faults next to those that were weighed."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import TypeVar

from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS
from bayesmembrane.diagnosis.explanation.neighbours import spread
from bayesmembrane.diagnosis.explanation.stand_ins import smaller_favoured, stood_in

Named = TypeVar("Named")

NOTHING = "none"
"""No effect; nothing foreign."""
ANOTHER_LAW = "another_law"
"""A kind of what is foreign: what no law, or no energy, of the library follows."""
UNLISTED = "unlisted"
"""A kind of what is foreign: a fault of no known kind, or one that was not seen, which effects follow instead."""
Joint = Mapping[tuple[str, str], float]
"""Probabilities by (set of effects, kind of what is foreign)."""


def told(
    joint: Joint, mistaken: Mapping[str, float], vague: Mapping[str, float], beside: int = 0
) -> tuple[Joint, Joint]:
    """(flattened, told): the sum as it is flattened, and that with parts of it told of sets next to those that were
    weighed, of faults that are not listed, and of effects for which others may stand in.

    mistaken : of the effects that are visible, by name, how often they are mistaken for another (`Effect.mistaken`)
    vague : 0 to 1 by kind of what is foreign, how far no set stands out beside it
    beside : how many effects are given, and were not measured: they are beside every set
    """
    flat = _flattened(joint, vague)
    near = _with_neighbours(flat, list(mistaken), vague)
    listed = _with_unlisted(near, vague.get(NOTHING, 0.0))
    return flat, _with_stand_ins(listed, mistaken, beside)


def _flattened(joint: Joint, vague: Mapping[str, float]) -> dict[tuple[str, str], float]:
    """`Beliefs.flattened` over the sets of effects beside each kind of what is foreign; together one, and falling.
    As far as a kind is ``vague`` none stands out beside it.

    No effect keeps what it has, for it is of laws that too much is said: of a hundred sets that are next to nothing
    each, flattened with it, all together would come to more than it.
    """
    kinds, out = defaultdict[str, dict[str, float]](dict), dict[tuple[str, str], float]()
    for (name, kind), q in joint.items():
        if name == NOTHING:
            out[name, kind] = q
        else:
            kinds[kind][name] = q
    for kind, sets in kinds.items():
        by_known_laws = 0.0 if kind == ANOTHER_LAW else 1.0 - vague.get(kind, 0.0)
        out |= {(name, kind): q for name, q in BELIEFS.flattened(sets, by_known_laws).items()}
    whole = sum(joint.values())
    return falling({key: q / whole for key, q in out.items()})


def _with_neighbours(joint: Joint, visible: Sequence[str], vague: Mapping[str, float]) -> dict[tuple[str, str], float]:
    """With a part of what sets have beside each kind of what is foreign told of those next to them, as far as none
    stands out by known laws; a larger one as far as a kind is ``vague``.
    """
    out = dict[tuple[str, str], float]()
    for kind, sets in _by_kind(joint).items():
        doubted, degree = BELIEFS.elsewhere * (1 - BELIEFS.standing_out(sets.values())), vague.get(kind, 0.0)
        doubted += degree * (BELIEFS.elsewhere_beside_structure - doubted)
        share = BELIEFS.elsewhere_by_another_law if kind == ANOTHER_LAW else doubted
        near = spread(sets, visible, BELIEFS.most, share, BELIEFS.farther)
        out |= {(joined(names), kind): q for names, q in near.items()}
    return falling(out)


def _with_unlisted(joint: Joint, vague: float) -> dict[tuple[str, str], float]:
    """With a part of what effects have, and nothing foreign, told of `UNLISTED` beside them, as far as no set stands
    out; a larger one as far as they are ``vague``.
    """
    known = {name: q for (name, kind), q in joint.items() if kind == NOTHING}
    share = BELIEFS.unlisted + vague * (BELIEFS.unlisted_beside_structure - BELIEFS.unlisted)
    part = share * (1 - BELIEFS.standing_out(known.values()))
    moved = {(name, UNLISTED): part * q for name, q in known.items() if name != NOTHING and part * q > 0}
    return falling(
        {(n, k): q - moved.get((n, UNLISTED), 0.0) if k == NOTHING else q for (n, k), q in joint.items()} | moved
    )


def _with_stand_ins(joint: Joint, mistaken: Mapping[str, float], beside: int) -> dict[tuple[str, str], float]:
    """With smaller sets favoured, and a part of what each has told of those in which one of its effects is another one
    or none, beside each kind of what is foreign.
    """
    out = dict[tuple[str, str], float]()
    for kind, sets in _by_kind(joint).items():
        fewer = smaller_favoured(sets, BELIEFS.spurious)
        doubted = stood_in(fewer, mistaken, BELIEFS.mistaken_alone, BELIEFS.mistaken_for_none, beside)
        out |= {(joined(names), kind): q for names, q in doubted.items()}
    return falling(out)


def _by_kind(joint: Joint) -> dict[str, dict[frozenset[str], float]]:
    """By kind of what is foreign: by set of effects, its probability."""
    kinds = defaultdict[str, dict[frozenset[str], float]](dict)
    for (name, kind), q in joint.items():
        kinds[kind][frozenset() if name == NOTHING else frozenset(name.split("+"))] = q
    return kinds


def falling(p: Mapping[Named, float]) -> dict[Named, float]:
    """The largest first."""
    return dict(sorted(p.items(), key=lambda i: -i[1]))


def joined(names: frozenset[str]) -> str:
    """Of a set of effects, as the sum has it."""
    return "+".join(sorted(names)) or NOTHING
