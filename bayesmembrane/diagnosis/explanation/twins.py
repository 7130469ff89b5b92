"""Effects that a test cannot tell apart: no shape of a law is sure enough to choose between them.

Two effects are twins on a measurement where both change the curve by functions of the deflection alone that nearly
coincide beside the plain model (`confounded`), where both make loops at any speed, where one follows time and the
other the way, and the disc moved at one speed without a hold, or where only the way back would tell them apart, and
there is less than half of it. Laws of a library are close to what happens, not the same: of two sets that differ by
twins, and stand nearly as well, none is told to be more than `BELIEFS.apart` times as probable as the other, nor one
with both twins than one of them alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates.speeds import one_speed
from bayesmembrane.diagnosis.detection.scores import Signature, confounded
from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS
from bayesmembrane.diagnosis.thresholds import TWINS
from bayesmembrane.physics.effects.base import Effect

Set = frozenset[str]


@dataclass(frozen=True)
class Near:
    """How nearly as well as the one a set with the other of two twins must stand, to be alike.

    left : part of the squares beyond noise of the plain model that it may leave more
    behind : ln of the Bayes factor by which it may be behind
    """

    left: float
    behind: float = np.inf


@dataclass(frozen=True)
class Stands:
    """How well a set of effects stands.

    left : part of the squares beyond noise of the plain model that it leaves
    log_evidence : its ln Z
    plausible : its effects are of sizes that occur: else nothing is told to be as probable as its twin
    """

    left: float
    log_evidence: float = 0.0
    plausible: bool = True


Pairs = Mapping[Set, Near]


def twins(effects: Sequence[Effect], signatures: Sequence[Signature]) -> dict[Set, Near]:
    """Pairs of ``effects`` that are functions of the deflection alone, and nearly coincide, or loops at any speed."""
    still, known = {e.name for e in effects if not e.remembers}, {e.name for e in effects}
    alike, loose = Near(TWINS.alike, TWINS.behind), Near(np.inf, TWINS.far_behind)
    by_nature = {
        frozenset((e.name, o)): loose if e.of_many_shapes else alike
        for e in effects
        for o in e.twins_at_any_speed
        if o in known
    }
    return by_nature | {frozenset((a, b)): alike for a, b, _ in confounded(signatures) if {a, b} <= still}


def twins_in_time(effects: Sequence[Effect], measurement: Measurement) -> dict[Set, Near]:
    """Pairs of ``effects`` of which one follows time and the other the way, where the disc moved at one speed."""
    if not one_speed(measurement):
        return {}
    return {frozenset((e.name, o)): Near(TWINS.alike_in_time) for e in effects for o in e.twins_at_one_speed}


def twins_one_way(effects: Sequence[Effect], measurement: Measurement) -> dict[Set, Near]:
    """Pairs of ``effects`` that only the way back tells apart, where the disc never came half of the way back."""
    deflection = np.abs(measurement.deflection)
    reached = np.maximum.accumulate(deflection)
    if np.any((deflection < TWINS.back * reached) & (reached > TWINS.back * reached[-1])):
        return {}
    known = {e.name for e in effects}
    return {frozenset((e.name, o)): Near(TWINS.alike) for e in effects for o in e.twins_one_way if o in known}


def swapped(names: Set, pairs: Iterable[Set]) -> Iterator[tuple[str, str, Set]]:
    """(out, in, the set after it) for every effect of a set whose twin is not in it."""
    for pair in pairs:
        inside = names & pair
        if len(inside) == 1:
            (out,), (new,) = inside, pair - inside
            yield out, new, (names - {out}) | {new}


def _beside(names: Set, pairs: Pairs) -> Iterator[tuple[Set, Near]]:
    """(a set, how near it must stand) for every effect of a set whose twin is not in it: with that twin instead of it,
    and with both, which what is no more than an error of a law does not leave far behind.
    """
    for old, new, other in swapped(names, pairs):
        near = pairs[frozenset((old, new))]
        yield other, near
        yield other | {old}, Near(min(near.left, TWINS.alike), min(near.behind, TWINS.behind))


def levelled(weights: Mapping[Set, float], stands: Mapping[Set, Stands], pairs: Pairs) -> dict[Set, float]:
    """By how much ln of a set's probability rises, so that none is `BELIEFS.apart` times less than a twin of it, or
    than it with a twin of one of its effects, which may be no more than an error of the law of that one.

    weights : by set, ln of its probability, whatever the constant
    stands : by set, how well it stands
    """
    out = {}
    for names, weight in weights.items():
        best = max(
            (
                weights[other]
                for other, near in _beside(names, pairs)
                if other in weights and _near(stands[names], stands[other], near)
            ),
            default=-np.inf,
        )
        out[names] = max(best - float(np.log(BELIEFS.apart)) - weight, 0.0)
    return out


def _near(one: Stands, other: Stands, pair: Near) -> bool:
    near = one.left - other.left < pair.left and other.log_evidence - one.log_evidence < pair.behind
    return one.plausible and near
