"""The sum over all hypotheses: how probable effects, energies and what is foreign are, each summed over the others."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.weighing import Weighing
from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS
from bayesmembrane.diagnosis.explanation.foreign import Foreign, kinds_of
from bayesmembrane.diagnosis.explanation.grown import Grown, key_of
from bayesmembrane.diagnosis.explanation.neighbours import NEGLIGIBLE
from bayesmembrane.diagnosis.explanation.promise import promised
from bayesmembrane.diagnosis.explanation.telling import ANOTHER_LAW, NOTHING, UNLISTED, falling, joined, told
from bayesmembrane.diagnosis.explanation.twins import Stands, levelled
from bayesmembrane.diagnosis.explanation.unfitted import Key, unfitted
from bayesmembrane.diagnosis.left.remaining import structure
from bayesmembrane.diagnosis.thresholds import FOREIGN, GROWTH, TWINS, VERDICT
from bayesmembrane.ground.parameters import Array

OF_A_FALL = 3
"""Parameters: how far the force falls, when, and how soon."""
CONCLUDED = (ANOTHER_LAW, UNLISTED)
"""Kinds that nothing in the curve shows by itself."""


@dataclass(frozen=True, eq=False)
class Judged:
    """A hypothesis and how probable it is.

    probability : among all that were looked at, with nothing foreign beside it
    gain : ln of the Bayes factor over the null model
    unexplained : part of the squares beyond noise that the null model leaves, which this one leaves
    reduced_chi2 : of what it leaves, its form error not taken away
    believed : ln of its probability before the data
    worse : True if it leaves clearly more than its energy does without effects: errors of its laws explain the curve
    """

    candidate: Candidate
    probability: float
    gain: float
    unexplained: float
    reduced_chi2: float
    believed: float = 0.0
    worse: bool = False

    def carried(self, given: Sequence[str]) -> bool:
        """True if it is errors of forms that explain the curve (`carried`)."""
        return self.worse or carried(self.candidate, given)

    @property
    def log_evidence(self) -> float:
        return self.candidate.log_evidence


@dataclass(frozen=True)
class Probabilities:
    """Each adds up to one.

    effects : by set of effects beyond the given ones, their names joined by "+"; `NOTHING` among them
    energies : by energy
    foreign : by kind; `NOTHING` among them
    """

    effects: Mapping[str, float]
    energies: Mapping[str, float]
    foreign: Mapping[str, float]

    def of_effect(self, *names: str) -> float:
        """Of an effect, or of several together, whatever else is at work."""
        return float(sum(p for key, p in self.effects.items() if set(names) <= set(key.split("+"))))

    def nearly_certain(self) -> list[str]:
        """Effects that are in all that is probable, by name: what is known even where the whole set is not."""
        return self.likely(VERDICT.nearly_certain)

    def likely(self, least: float = 0.5) -> list[str]:
        """Effects whose probability is ``least`` or more, by name."""
        names = {n for key in self.effects for n in key.split("+")} - {NOTHING}
        return sorted(n for n in names if self.of_effect(n) >= least)

    @property
    def anything_foreign(self) -> float:
        """Of something foreign, of whatever kind."""
        return 1.0 - self.foreign.get(NOTHING, 0.0)

    @property
    def something_found(self) -> float:
        """Of something foreign that was looked for and found, and is not only concluded."""
        return self.anything_foreign - sum(self.foreign.get(kind, 0.0) for kind in CONCLUDED)


@dataclass(frozen=True, eq=False)
class Total:
    """The sum.

    ranking : every hypothesis, the most probable first
    probabilities : summed
    joint : by (set of effects, kind of what is foreign), the most probable first
    by_laws : of sets of effects, before some of it is told of those next to them
    foreign : what was found of each kind beside the models where it was looked for, the most probable first
    """

    ranking: tuple[Judged, ...]
    probabilities: Probabilities
    joint: Mapping[tuple[str, str], float]
    by_laws: Mapping[str, float]
    foreign: tuple[Foreign, ...]


def set_name(candidate: Candidate, given: Sequence[str]) -> str:
    """The effects of a candidate beyond those given, in alphabetical order, joined by "+"."""
    return joined(frozenset(candidate.names) - set(given))


def carried(candidate: Candidate, given: Sequence[str]) -> bool:
    """True if it is not the effects that explain the curve, but errors of their laws or of the energy: of the laws of
    those that are in question, not of those ``given``.
    """
    law = max(candidate.law_errors_beyond(given).values(), default=0.0)
    return candidate.energy_error > VERDICT.carried or law > VERDICT.law_carried


def summed(grown: Grown) -> Total:
    """All that was grown, and what is foreign beside the most probable of it.

    Of what holds only with laws or an energy that are far off, most is told to be something foreign.
    """
    case, given = grown.case, grown.case.null.names
    seen = grown.seen()
    others = _other_energies(grown, seen)
    weights = _Weights.of(grown, seen, others)
    every = sorted(grown.found.values(), key=weights, reverse=True)
    found = _foreign(grown, every, given)
    shown = [f for f in found if f.counted(grown.counts) > BELIEFS.supported]  # what the data speak for
    kinds = kinds_of(found)
    nothing = BELIEFS.log_foreign(0) if kinds else 0.0
    strange = _beside_tears(grown, every, weights, shown, BELIEFS.log_foreign(kinds), nothing)
    every.sort(key=weights, reverse=True)
    terms = [(c, NOTHING, weights(c) + nothing) for c in every]
    terms += [(f.base, f.key, w) for f, w in zip(shown, strange, strict=True)]
    guessed = [(key, w + weights.raised[key[1]] + nothing) for key, w in others.items()]
    p = _normalised(np.array([*(w for _, _, w in terms), *(w for _, w in guessed)]))
    parts = [(c.hypothesis.material.name, set_name(c, given), kind) for c, kind, _ in terms]
    parts += [(energy, joined(names - set(given)), NOTHING) for (energy, names), _ in guessed]
    joint, energies = defaultdict[tuple[str, str], float](float), defaultdict[str, float](float)
    for (energy, name, kind), q in zip(parts, p.tolist(), strict=True):
        joint[name, kind] += q
        energies[energy] += q
    for name, q in _untried(grown, every, joint).items():
        joint[name, NOTHING] += q
    worse = {id(c): _worse(grown, c) for c in every}
    for i, (c, kind, _) in enumerate(terms):
        if kind != NOTHING or p[i] < NEGLIGIBLE or _described(grown, c, given):  # what has nothing can lose nothing
            continue
        if carried(c, given) or worse[id(c)]:
            name, moved = set_name(c, given), BELIEFS.another_law * float(p[i])
            joint[name, NOTHING] -= moved
            joint[name, ANOTHER_LAW] += moved
            p[i] -= moved
    vague = _vague(grown, every, shown, joint)
    mistaken = {e.name: e.mistaken for e in case.visible if e.name not in given}
    beside = sum(not e.known for e in case.null.hypothesis.effects)
    flat, both = told(joint, mistaken, vague, beside)
    judged = []
    for (c, kind, _), q in zip(terms, p[: len(terms)].tolist(), strict=True):
        if kind == NOTHING:
            key = set_name(c, given), NOTHING
            of_set = q / joint[key] if q > 0 else 0.0
            judged.append(_judged(grown, c, of_set * both[key], worse[id(c)]))
    judged.sort(key=lambda j: -j.probability)
    marginal = Probabilities(_summed_out(both, 0), falling(BELIEFS.energies_flattened(energies)), _summed_out(both, 1))
    return Total(tuple(judged), marginal, both, _summed_out(flat, 0), tuple(found))


@dataclass(frozen=True, eq=False)
class _Weights:
    """ln of the weight of a candidate in the sum: its ``own``, and by what its set of effects is ``raised``."""

    own: Mapping[Key, float]
    raised: dict[frozenset[str], float]

    @classmethod
    def of(cls, grown: Grown, seen: Mapping[Key, float], others: Mapping[Key, float]) -> _Weights:
        """Of all that was grown, with what was ``seen`` of its effects; ``others``: ln weights of what was not."""
        own = {key: w + seen[key] for key, w in grown.weights().items()}
        return cls(own, _raised(grown, own, others))

    def __call__(self, c: Candidate) -> float:
        return self.own[key_of(c)] + self.raised[frozenset(c.names)]


def _beside_tears(
    grown: Grown,
    every: Sequence[Candidate],
    weights: _Weights,
    shown: Sequence[Foreign],
    of_kind: float,
    of_none: float,
) -> list[float]:
    """ln of the weight of what is foreign and ``shown``, no less than what leaves the same trace allows; and sets are
    raised in ``weights`` by what it has that a tear of theirs leaves, too. ``of_kind`` and ``of_none``: ln of
    the probability of one kind, and of nothing foreign, before the data.
    """
    counts = grown.counts
    strange = [weights.own[key_of(f.base)] - counts * _undone(f) + f.counted(counts) + of_kind for f in shown]
    tears = [_tears(f, every, grown.search) for f in shown]
    least = [_like_a_tear(f, some, weights, grown.search) for f, some in zip(shown, tears, strict=True)]
    for w, some in zip(strange, tears, strict=True):
        for names in {frozenset(c.names) for c in some}:
            # Of the set, whatever its energy: of one that tears worse in this energy another one may be ahead.
            best = max(weights(c) for c in every if frozenset(c.names) == names)
            weights.raised[names] += max(w - float(np.log(BELIEFS.apart)) - best - of_none, 0.0)
    return [max(w, low) for w, low in zip(strange, least, strict=True)]


def _worse(grown: Grown, c: Candidate) -> bool:
    """True if effects leave more than their energy does without them, or the null model where that was not fitted, both
    at their best, by what tells two sets apart.
    """
    given = frozenset(grown.case.null.names)
    plain = grown.found.get((c.hypothesis.material.name, given), _null(grown))
    beyond = set(c.names) - given
    return bool(beyond) and grown.search.excess(c) - grown.search.excess(plain) > 2 * TWINS.behind


def _null(grown: Grown) -> Candidate:
    """The model as given."""
    return grown.found[(grown.case.null.hypothesis.material.name, frozenset(grown.case.null.names))]


def _described(grown: Grown, c: Candidate, given: Sequence[str]) -> bool:
    """True of an energy without effects by which the tests see nothing that is missing."""
    return set_name(c, given) == NOTHING and (grown.case.sees_nothing or grown.case.tested(c).adequate)


def _vague(
    grown: Grown, every: Sequence[Candidate], shown: Sequence[Foreign], joint: Mapping[tuple[str, str], float]
) -> dict[str, float]:
    """From 0 to 1, by kind of what is foreign, how far the most probable set of effects beside it leaves more than
    noise (`BELIEFS.blurred`): whatever is behind the curve, laws of the library do not follow it.
    """
    given, search, out = grown.case.null.names, grown.search, dict[str, float]()
    for kind in {kind for _, kind in joint}:
        first = max((name for name, k in joint if k == kind), key=lambda name: joint[name, kind])
        if kind == NOTHING:
            left = [structure(search, c) for c in every if set_name(c, given) == first]
        else:
            same = (f for f in shown if f.key == kind and set_name(f.base, given) == first)
            left = [structure(search, f.base, f.trace) for f in same]
        if first != NOTHING and left:
            out[kind] = min(max(min(left) / BELIEFS.blurred, 0.0), 1.0)
    return out


def _like_a_tear(
    f: Foreign, tears: Sequence[Candidate], weight: Callable[[Candidate], float], search: Weighing
) -> float:
    """ln of the least weight of a force that falls at some moment: a part of that of an effect which comes so.

    Where it fits nearly as well as the same energy with one of the ``tears`` beside the same set, neither is told to be
    more than `BELIEFS.apart` times as probable: what warms up, or a cell whose zero moves, leaves the same trace.
    """
    near = [weight(c) for c in tears if _fits_better(c, f, search) < TWINS.behind]
    return max(near, default=-np.inf) - float(np.log(BELIEFS.apart))


def _tears(f: Foreign, every: Sequence[Candidate], search: Weighing) -> list[Candidate]:
    """The same energy and set as beside a fall, with an effect that comes so; fitting not much worse.

    Lost steps are what a clamp that slips once leaves, too.
    """
    return [
        c
        for c in every
        if f.falls
        and c.hypothesis.material is f.base.hypothesis.material
        and len(c.names) == len(f.base.names) + 1
        and all(
            e.name in f.base.names or (f.kind in e.like_foreign and f.shares_test_with(e)) for e in c.hypothesis.effects
        )
        and -_fits_better(c, f, search) < TWINS.behind
    ]


def _fits_better(c: Candidate, f: Foreign, search: Weighing) -> float:
    """(S_f + k_f - S_c - k_c) / 2, ln of the likelihood by which ``c`` is ahead of a fall, each leaving squares S by k
    parameters: a tear has many, whose priors count against it, and a fall few, and neither fits worse for that.
    """
    fall = search.squares(f.base, f.trace) + f.base.x.size + OF_A_FALL
    return 0.5 * (fall - search.squares(c) - c.x.size)


def _untried(grown: Grown, every: Sequence[Candidate], joint: Mapping[tuple[str, str], float]) -> dict[str, float]:
    """{set: probability} of the first sets with one more effect, where that was never fitted, for it promised little.

    Weighed to first order, and a part (`BELIEFS.untried`) of that: what was not looked at is not excluded.
    """
    case, given, tried = grown.case, set(grown.case.null.names), {frozenset(c.names) for c in every}
    out = defaultdict[str, float](float)
    for base in _leaders(every)[: GROWTH.untried]:
        own, odds = set_name(base, case.null.names), [e.odds for e in base.hypothesis.effects if e.name not in given]
        for e in case.visible if len(odds) < BELIEFS.most else []:
            names = frozenset((*base.names, e.name))
            if e.name in base.names or names in tried:
                continue
            visible = [v.odds for v in case.visible]
            prior = BELIEFS.log_set([*odds, e.odds], visible) - BELIEFS.log_set(odds, visible)
            gain = min(promised(grown.search, base, e, grown.counts), BELIEFS.supported)
            q = BELIEFS.untried * joint[own, NOTHING] * float(np.exp(prior + gain))
            if q > 0:
                name = joined(names - given)
                out[name] = max(out[name], q)
    return out


def _leaders(every: Sequence[Candidate]) -> list[Candidate]:
    """Of every set of effects the first of ``every``."""
    first: dict[frozenset[str], Candidate] = {}
    for c in every:
        first.setdefault(frozenset(c.names), c)
    return list(first.values())


def _other_energies(grown: Grown, seen: Mapping[Key, float]) -> dict[Key, float]:
    """ln weight of the energies that a set was not fitted with, in which its effects are seen as with its best one."""
    foretold = unfitted(grown.log_tempered())
    best: dict[frozenset[str], Candidate] = {}
    for c in sorted(grown.found.values(), key=lambda c: c.log_evidence):
        best[frozenset(c.names)] = c
    return {
        (energy, names): z + grown.believed(best[names], energy) + seen[key_of(best[names])]
        for (energy, names), z in foretold.items()
    }


def _raised(grown: Grown, weights: Mapping[Key, float], others: Mapping[Key, float]) -> dict[frozenset[str], float]:
    """By set of effects, by how much its ln weight rises where twins of it have more than they can be sure of.

    ``weights`` : ln weight of what was fitted; ``others`` : of what was not.
    """
    before = max(grown.search.excess(_null(grown)), 1e-300)
    total, stands = {}, {}
    for names in {names for _, names in grown.found}:
        same = [c for (_, own), c in grown.found.items() if own == names]
        rest = [w for (_, own), w in others.items() if own == names]
        total[names] = float(np.logaddexp.reduce([*(weights[key_of(c)] for c in same), *rest]))
        best = max(same, key=lambda c: weights[key_of(c)])
        left = grown.search.excess(best) / before
        stands[names] = Stands(left, best.log_evidence, _plausible(best, grown.search))
    return levelled(total, stands, grown.case.twins())


def _plausible(candidate: Candidate, search: Weighing) -> bool:
    """True if every effect of it is of a size that occurs, is there at all, and away from its bound."""
    for e in candidate.hypothesis.in_question:
        for i, expected in zip(e.sizes, search.expected_sizes(e).tolist(), strict=True):
            p, name = e.coordinates[i], f"{e.name}.{e.coordinates[i].name}"
            size = abs(candidate.parameters[name] - (p.null or 0.0))
            if name in candidate.at_bound or not TWINS.least * expected < size < TWINS.usual * expected:
                return False
    return True


def _foreign(grown: Grown, every: Sequence[Candidate], given: Sequence[str]) -> list[Foreign]:
    """What is foreign beside the best energy of the first few sets, and beside the plain model; a limit beside every
    plain energy.
    """
    bases = {set_name(c, given): c for c in _leaders(every)}
    chosen = dict(list(bases.items())[: FOREIGN.bases])
    chosen.setdefault(NOTHING, bases[NOTHING])
    grown.case.tell("looking for what no effect describes")
    plain = [c for c in every if set_name(c, given) == NOTHING and c is not chosen[NOTHING]]
    return grown.case.foreign(grown.search, list(chosen.values()), plain)


def _undone(f: Foreign) -> float:
    """What draws brought its base is of the squares that the base leaves: not of those that ``f`` takes away."""
    return f.share * max(f.base.by_draws, 0.0)


def _normalised(log_weights: Array) -> Array:
    p = np.exp(log_weights - np.max(log_weights))
    return np.asarray(p / np.sum(p))


def _summed_out(joint: Mapping[tuple[str, str], float], kept: int) -> dict[str, float]:
    """The probabilities of one part of a pair, summed over the other."""
    out = defaultdict[str, float](float)
    for key, q in joint.items():
        out[key[kept]] += q
    return falling(out)


def _judged(grown: Grown, c: Candidate, probability: float, worse: bool) -> Judged:
    null = _null(grown)
    left, before = grown.search.excess(c), grown.search.excess(null)
    n = c.residual.size
    return Judged(
        c,
        probability,
        c.log_evidence - null.log_evidence,
        min(left / before, 1.0) if before > 0 else 0.0,
        (left + n - c.x.size) / max(n - c.x.size, 1),
        grown.believed(c),
        worse,
    )
