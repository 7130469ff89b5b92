"""What the probabilities come to: nothing, a name, several, another energy, or nothing that is known."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesmembrane.diagnosis.candidates.weighing import Weighing
from bayesmembrane.diagnosis.explanation.asked import with_falls, with_sets
from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS
from bayesmembrane.diagnosis.explanation.case import DiagnosisCase
from bayesmembrane.diagnosis.explanation.foreign import Foreign, kinds_of
from bayesmembrane.diagnosis.explanation.growth import grown
from bayesmembrane.diagnosis.explanation.promise import promised
from bayesmembrane.diagnosis.explanation.telling import ANOTHER_LAW, NOTHING
from bayesmembrane.diagnosis.explanation.total import CONCLUDED, Judged, Probabilities, Total, set_name, summed
from bayesmembrane.diagnosis.thresholds import GROWTH, VERDICT


@dataclass(frozen=True, eq=False)
class Verdict:
    """What the probabilities come to.

    verdict : "adequate", "named", "ambiguous", "material" or "unknown"
    members : the hypotheses that it rests on, each with one energy of its set of effects (`_first_of_each_set`): the
        most probable, as many as hold `VERDICT.sure` together by the laws of the library; of these, those that were
        fitted
    ranking : every hypothesis that was fitted, the most probable first
    probabilities : summed
    foreign : what was found that is foreign, where it is not sure that there is nothing
    rivals : the most probable of the members, or of more sets than can be told, one or none of which is right: what
        another test would have to tell apart
    """

    verdict: str
    members: tuple[Judged, ...]
    ranking: tuple[Judged, ...]
    probabilities: Probabilities
    foreign: Foreign | None = None
    rivals: tuple[Judged, ...] = ()


def adequate(case: DiagnosisCase) -> Verdict:
    """The tests see nothing. What single effects could still be there is told to first order.

    What is foreign is weighed all the same: it may have been taken for noise, or be of a shape that no test asks for.
    """
    null = case.null
    dof = max(null.residual.size - null.x.size, 1)
    judged = Judged(null, 1.0, 0.0, 1.0, case.search.excess(null) / dof + 1)
    case.tell("looking for what no effect describes")
    others = [c for c in case.plain.values() if c is not case.best_plain]
    found = case.foreign(case.search, [case.best_plain], others)
    p = _first_order(case, found)
    told = found[0] if p.anything_foreign > VERDICT.foreign_told else None
    return Verdict("adequate", (judged,), (judged,), p, told)


def undoubted(p: Probabilities) -> bool:
    """True if no effect and nothing foreign are as probable as they must be where no test sees a misfit."""
    return min(p.effects.get(NOTHING, 0.0), p.foreign[NOTHING]) > VERDICT.doubted


def explained(case: DiagnosisCase) -> tuple[Weighing, Verdict]:
    """The verdict of all that could explain the curve, and the search under whose noise that was weighed.

    Sets that nobody fitted, for they promised little, are fitted where the answer is one set or more according to them;
    and what begins at some moment is looked for where the force is seen to fall.
    """
    every = grown(case)
    total = summed(every)
    if with_falls(every, _falls(total)):
        total = summed(every)
    for _ in range(VERDICT.looked_again):
        rivals = _unfitted_rivals(total, case.null.names)
        if not rivals:
            break
        with_sets(every, rivals)
        total = summed(every)
    return every.search, decided(case, total)


def _falls(total: Total) -> list[Foreign]:
    """Falls of the force that are worth a word."""
    p = total.probabilities
    return [f for f in total.foreign if f.falls and p.foreign.get(f.key, 0.0) > VERDICT.foreign_told]


def _unfitted_rivals(total: Total, given: Sequence[str]) -> list[frozenset[str]]:
    """Sets, the effects ``given`` among them, that were never fitted and share an answer with one set alone."""
    fitted = {set_name(j.candidate, given) for j in total.ranking}
    told = _smallest(total.by_laws)
    rest = [name for name in told if name not in fitted]
    return [frozenset((*name.split("+"), *given)) for name in rest] if len(told) - len(rest) == 1 else []


def decided(case: DiagnosisCase, total: Total) -> Verdict:
    """The verdict of a sum over hypotheses, of a model that misses something.

    What is foreign beside effects that carry nearly all of the misfit is told with them; where it carries more, a name
    would be a guess.
    """
    p, given = total.probabilities, case.null.names
    strange = _strange(total, given)
    best = _first_of_each_set(total.ranking, given)
    if case.sees_nothing and undoubted(p) and NOTHING in best:
        return Verdict("adequate", (best[NOTHING],), total.ranking, p, strange)
    names = _told(total, best)
    members, sure = tuple(best[name] for name in names), len(names) == 1 and p.effects[names[0]] >= VERDICT.sure
    unknown, rivals = Verdict("unknown", (), total.ranking, p, strange), members[: VERDICT.most_members]
    if not members:
        return unknown
    first = members[0]
    if len(members) > VERDICT.most_members and not _worth_telling(total):
        return unknown if first.carried(given) else replace(unknown, rivals=rivals)
    if strange is not None and p.something_found > 0.5 and _carries(strange, first, given):
        return unknown
    if sure and names[0] == NOTHING:
        return unknown if p.anything_foreign > 1 - VERDICT.sure else _without_effects(case, total, members)
    if first.carried(given) or p.foreign.get(ANOTHER_LAW, 0.0) > 0.5:
        return unknown
    if sure:
        return Verdict("named", members, total.ranking, p, strange)
    return Verdict("ambiguous", members, total.ranking, p, strange, rivals)


def _told(total: Total, fitted: Collection[str]) -> list[str]:
    """The sets that are needed by the laws, of those that were ``fitted``, the most probable first; one that is not
    told to be sure has the next one by the laws beside it.

    That one alone is left of several of which others were never fitted does not make it sure. What is told of a set for
    being next to another one makes it no member: by the laws it may be refuted.
    """
    p, by_laws = total.probabilities.effects, [name for name in total.by_laws if name in fitted]
    names = [name for name in _smallest(total.by_laws) if name in fitted] or by_laws[:1]
    if len(names) == 1 and p[names[0]] < VERDICT.sure:
        names += [name for name in by_laws if name not in names and total.by_laws[name] >= VERDICT.least_member][:1]
    return sorted(names, key=lambda name: -p[name])


def _worth_telling(total: Total) -> bool:
    """True if an effect or none leads, or a few sets do by known laws, however many share the rest."""
    p, (few, together) = total.probabilities, VERDICT.few
    first = sum(list(total.by_laws.values())[:few])
    return bool(p.likely(VERDICT.leads)) or p.effects.get(NOTHING, 0.0) >= VERDICT.leads or first >= together


def _first_of_each_set(ranking: Sequence[Judged], given: Sequence[str]) -> dict[str, Judged]:
    """By set of effects its most probable energy; beside effects that with the fewest parameters of those as good.

    Which of two energies is a little more probable than the other hangs on the noise, and on round-off.
    """
    sets: dict[str, list[Judged]] = {}
    for j in ranking:
        sets.setdefault(set_name(j.candidate, given), []).append(j)
    for name, same in sets.items():
        near = [j for j in same if j.probability * VERDICT.alike >= same[0].probability]
        good = [j for j in near if not j.carried(given)]
        if name != NOTHING and good:
            sets[name] = [min(good, key=lambda j: j.candidate.x.size)]
    return {name: same[0] for name, same in sets.items()}


def _carries(strange: Foreign, first: Judged, given: Sequence[str]) -> bool:
    """True if it is what is foreign that explains the curve, not the most probable set beside it."""
    alone = set_name(first.candidate, given) == NOTHING
    return alone or strange.share * first.unexplained > VERDICT.foreign_carries


def _strange(total: Total, given: Sequence[str]) -> Foreign | None:
    """The most probable thing that is foreign, beside the most probable set; None if that is not worth a word."""
    p = total.probabilities
    if p.something_found <= VERDICT.foreign_told:
        return None
    first, kind = next(key for key in total.joint if key[1] not in (NOTHING, *CONCLUDED))
    same = [f for f in total.foreign if f.key == kind]
    return next((f for f in same if set_name(f.base, given) == first), same[0])


def _smallest(probabilities: Mapping[str, float]) -> list[str]:
    """The fewest that hold `VERDICT.sure` together, of probabilities that fall."""
    held, out = 0.0, []
    for key, q in probabilities.items():
        out.append(key)
        held += q
        if held >= VERDICT.sure:
            break
    return out


def _without_effects(case: DiagnosisCase, total: Total, members: tuple[Judged, ...]) -> Verdict:
    """No effect is needed: another energy, if that describes the curve; else an energy that is not known."""
    best, p = members[0], total.probabilities
    describes = case.tested(best.candidate).adequate or best.candidate.energy_error < VERDICT.carried
    if not describes:
        return Verdict("unknown", (), total.ranking, p)
    same = best.candidate.hypothesis.material is case.null.hypothesis.material
    if not same:
        return Verdict("material", members, total.ranking, p)
    return Verdict("adequate", members, total.ranking, p)


def _first_order(case: DiagnosisCase, found: Sequence[Foreign]) -> Probabilities:
    """Probabilities of single effects beside every energy, from their traces alone, and of what is foreign."""
    plain, best = _with_energy(case), case.best_plain.log_evidence
    odds = [e.odds for e in case.visible]
    none = float(np.logaddexp.reduce(list(plain.values())))
    near = [n for n, c in case.plain.items() if best - c.log_evidence < GROWTH.energy_reach]
    nothing = BELIEFS.log_set((), odds)
    sets, energies = {NOTHING: none + nothing}, {n: [w] for n, w in plain.items()}
    for e in case.visible:
        beside = {n: plain[n] + promised(case.search, case.plain[n], e) for n in near}
        together, prior = float(np.logaddexp.reduce(list(beside.values()))), BELIEFS.log_set((e.odds,), odds)
        for n, w in beside.items():
            energies[n].append(w + prior - nothing)
        weight = together + prior
        if np.isfinite(weight):
            sets[e.name] = weight
    summed = {n: float(np.logaddexp.reduce(w)) for n, w in energies.items()}
    return Probabilities(_shares(sets), BELIEFS.energies_flattened(_shares(summed)), _foreign_first(case, found, plain))


def _with_energy(case: DiagnosisCase) -> dict[str, float]:
    """By energy, ln of its probability without effects, up to a constant."""
    count, declared = len(case.plain), case.question.energy
    return {n: c.log_evidence + BELIEFS.log_energy(n, declared, count) for n, c in case.plain.items()}


def _foreign_first(case: DiagnosisCase, found: Sequence[Foreign], plain: Mapping[str, float]) -> dict[str, float]:
    """By kind, the probability of what is foreign beside energies without effects."""
    kinds, none = kinds_of(found), float(np.logaddexp.reduce(list(plain.values())))
    strange = {NOTHING: none + (BELIEFS.log_foreign(0) if kinds else 0.0)}
    for f in found:
        if f.gain > BELIEFS.supported:
            weight = plain[f.base.hypothesis.material.name] + f.gain + BELIEFS.log_foreign(kinds)
            strange[f.key] = float(np.logaddexp(strange.get(f.key, -np.inf), weight))
    return _shares(strange)


def _shares(log_weights: dict[str, float]) -> dict[str, float]:
    w = np.array(list(log_weights.values()))
    p = np.exp(w - np.logaddexp.reduce(w))
    return dict(sorted(zip(log_weights, map(float, p), strict=True), key=lambda i: -i[1]))
