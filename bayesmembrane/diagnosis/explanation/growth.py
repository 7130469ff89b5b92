"""Sets of effects, grown one by one from the most probable so far, with every energy; a beam and no threshold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from bayesmembrane.diagnosis.candidates.candidate import Candidate, with_effects, without_effect
from bayesmembrane.diagnosis.candidates.weighing import Sought, starts_with
from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS
from bayesmembrane.diagnosis.explanation.case import DiagnosisCase
from bayesmembrane.diagnosis.explanation.checking import weigh_by_draws
from bayesmembrane.diagnosis.explanation.events import with_second_events
from bayesmembrane.diagnosis.explanation.grown import Grown, key_of
from bayesmembrane.diagnosis.explanation.promise import first_order, gains_of_pairs
from bayesmembrane.diagnosis.explanation.twins import swapped
from bayesmembrane.diagnosis.explanation.unfitted import Key
from bayesmembrane.diagnosis.thresholds import FOREIGN, GROWTH, SAMPLED, TWINS
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.effects.base import Effect
from bayesmembrane.physics.hypothesis import Hypothesis


def grown(case: DiagnosisCase) -> Grown:
    """All hypotheses that could carry weight: each single effect, and sets that grow from the most probable ones.

    Sets that turn out to be among these only as parts of larger ones are grown from in their turn.
    """
    out = Grown(case, case.search)
    for c in case.plain.values():
        out.add(c)
    _grow(out)
    if not out.limited:
        _with_less(out)
        if _grow(out):
            _with_less(out)
        _with_exchanged(out)
        _with_pairs(out)
        _with_twins(out)
    _with_parts(out)
    _with_crossed(out)
    weigh_by_draws(out)
    return out


def _grow(out: Grown) -> bool:
    """Sets one effect larger than the most probable of every size that none was grown from; True if there were any.

    Growth ends where a larger set has less than `GROWTH.worth` of what the smaller ones have together.
    """
    most, any_new = out.most, False
    if out.case.null.names:
        _with_events(out, 0)
    for size in range(1, most + 1):
        beam = [out.case.best_plain] if size == 1 else _beam(out, size - 1)
        bases = [c for c in beam if frozenset(c.names) not in out.followed]
        for base in bases:
            out.followed.add(frozenset(base.names))
            _add_effects(out, [(base, effect) for effect in _promising(out, base, size)])
        if not out.of_size(size):
            break
        if bases:
            any_new = True
            out.renew()
            _with_events(out, size)
            _with_other_energies(out, size)
            out.polish(size)
            out.limited = size == 1 and _limited(out)
        if out.limited or not _worth_more(out, size):
            break
    return any_new


def _with_events(out: Grown, size: int) -> None:
    """The best sets of this size with second events of what comes at once; size 0: every energy with what is given."""
    some = out.best_of_each_set(size)[: GROWTH.polished] if size else out.of_size(0)
    for c in with_second_events(out.search, some):
        out.add(c)


def _limited(out: Grown) -> bool:
    """True where a limit explains much better what the most probable set so far does not, and leaves noise alone.

    Effects that are put together to follow a force that stops rising are hard to fit, and none of that is needed.
    """
    plain = [out.found[key_of(c)] for c in out.case.plain.values()]  # weighed under the noise that the best is
    return out.case.log_evidence_of_limit(out.search, plain) > out.best.log_evidence + FOREIGN.settled


def _with_less(out: Grown) -> None:
    """The most probable sets without each of their effects, from where the others are beside it.

    A search from the plain fit may end where the material was bent to imitate what is missing; one from a larger set
    does not. Without this, effects that do nothing are named for having led the search.
    """
    for size in range(BELIEFS.most, 0, -1):
        best = out.best.log_evidence
        near = [c for c in out.of_size(size)[: GROWTH.lessened] if best - c.log_evidence < GROWTH.less_reach]
        _search_on(out, [without_effect(c, name) for c in near for name in out.own(c)])


def _with_parts(out: Grown) -> None:
    """What has a share in the sum without each of its effects, where that was not fitted with this energy.

    An effect of no size would seem to matter where the energy beside it is what explains the curve.
    """
    shares = out.shares(out.seen())
    near = [out.found[key] for key, share in shares.items() if share > np.log(SAMPLED.first.share)]
    steps = [(c, name) for c in near for name in out.own(c)]
    new = [(c, n) for c, n in steps if (c.hypothesis.material.name, frozenset(c.names) - {n}) not in out.found]
    _search_on(out, [without_effect(c, name) for c, name in new])


def _with_crossed(out: Grown) -> None:
    """What has a share in the sum once more, from the materials of others of its energy that have one; and the first
    few sets with every energy, from the effects of the best one.

    The valley of an energy with many parameters is bent and has several ends: to which of them a search comes hangs on
    round-off, and what was found beside other effects may lead to a better one.
    """
    shares = out.shares(out.seen())
    order = sorted((k for k, share in shares.items() if share > np.log(GROWTH.crossed)), key=lambda k: -shares[k])
    sought = []
    for key in order[: GROWTH.most_crossed]:
        c = out.found[key]
        size = c.hypothesis.material_size
        others = [out.found[k].x[:size] for k in order if k[0] == key[0] and k != key][: GROWTH.crossed_with]
        if size > 1 and others:
            sought.append(Sought(c.hypothesis, [np.concatenate([m, c.x[size:]]) for m in others], c))
    sought += _with_effects_of_the_best(out, shares)
    found = [c for c in out.search.fits(sought) if c is not None]
    near = [c for c in found if c.log_evidence > out.found[key_of(c)].log_evidence - GROWTH.less_gain]
    for c in out.search.all_polished(near):
        out.add(c)


def _with_effects_of_the_best(out: Grown, shares: Mapping[Key, float]) -> list[Sought]:
    """The first few sets with every other energy once more, from where the best one has their effects by now."""
    first: dict[frozenset[str], Candidate] = {}
    for key in sorted(shares, key=lambda k: -shares[k]):
        if key[1] != frozenset(out.case.null.names):
            first.setdefault(key[1], out.found[key])
    chosen = list(first.items())[: GROWTH.with_best_effects]
    others = [(best, c) for names, best in chosen for (_, own), c in out.found.items() if own == names]
    return [_transplanted(best, c) for best, c in others if c is not best]


def _search_on(out: Grown, steps: Sequence[tuple[Hypothesis, Array]]) -> None:
    """From the best of these places for each hypothesis, where it is worth it."""
    best, starts = out.best.log_evidence, dict[Key, Candidate]()
    for start in out.search.placed(steps):
        if start is not None and (
            (key := key_of(start)) not in starts or start.log_evidence > starts[key].log_evidence
        ):
            starts[key] = start
    near = [start for key, start in starts.items() if _worth_a_search(out, key, start, best)]
    for c in out.search.all_polished(near):
        out.add(c)


def _worth_a_search(out: Grown, key: Key, start: Candidate, best: float) -> bool:
    """True for a start that is not far behind the ``best`` of all, nor behind what was found of it before."""
    before = out.found[key].log_evidence if key in out.found else -np.inf
    return start.log_evidence > max(best - GROWTH.less_reach, before - GROWTH.less_gain)


def _with_exchanged(out: Grown) -> None:
    """The most probable set of several effects with each of them exchanged for those that promise most beside the rest.

    What was added first may stand for what is there, and the rest of it be no set that anything grew from. Where that
    led to a better set, it is done once more with that one.
    """
    for _ in range(GROWTH.exchanges):
        best = out.best
        own = out.own(best)
        _add_effects(out, [pair for name in own for pair in _exchanges(out, best, name)] if len(own) > 1 else [])
        if best is out.best:
            break


def _exchanges(out: Grown, best: Candidate, name: str) -> list[tuple[Candidate, Effect]]:
    """``best`` without one of its effects, from where the others are, and those to exchange it for."""
    energy, rest = best.hypothesis.material.name, frozenset(best.names) - {name}
    less = out.found.get((energy, rest)) or out.search.at(*without_effect(best, name))
    tried = {names for _, names in out.found}
    others = [e for e in out.case.visible if e.name not in best.names and rest | {e.name} not in tried]
    if less is None:
        return []
    gains = {e.name: first_order(out.search, less, e) for e in others}
    others.sort(key=lambda e: -gains[e.name])
    return [(less, effect) for effect in others[: GROWTH.exchanged]]


def _with_pairs(out: Grown) -> None:
    """Sets that two effects promise to complete together, and large ones from each of their parts.

    An effect that looks like another one as long as it is alone is no set to grow from, and a search that goes on from
    one part of a set may end where another does not. Sets with all of the best one and more were grown from it.
    """
    if out.case.question.quick or not out.of_size(2):
        return
    before = out.best
    sought = _promising_pairs(out, list(out.case.plain.values()))
    sought += _promising_pairs(out, out.best_of_each_set(1)[: GROWTH.pairs_beside])
    near = [c for size in range(2, BELIEFS.most + 1) for c in out.best_of_each_set(size)[: GROWTH.searched_again]]
    reach, best = GROWTH.again_reach / out.counts, frozenset(before.names)
    sought += [frozenset(c.names) for c in near if before.log_evidence - c.log_evidence < reach]
    others = [names for names in dict.fromkeys(sought) if not best <= names]
    _add_effects(out, [step for names in others for step in last_steps(out, names)])
    for size in range(2, BELIEFS.most + 1):
        if out.best is not before:
            _with_other_energies(out, size)
        out.polish(size)


def _promising_pairs(out: Grown, bases: Sequence[Candidate]) -> list[frozenset[str]]:
    """Sets that nobody fitted of one of ``bases`` and two effects more, by what they promise to first order."""
    tried, promised = {names for _, names in out.found}, dict[frozenset[str], float]()
    for base in bases:
        here = out.found[key_of(base)]
        rest = [e for e in out.case.visible if e.name not in here.names]
        for pair, gain in gains_of_pairs(out.search, here, rest).items():
            names = frozenset(here.names) | pair
            promised[names] = max(promised.get(names, -np.inf), here.log_evidence + gain)
    first = max(promised.values(), default=0.0)
    order = sorted(promised, key=lambda names: -promised[names])
    near = [names for names in order if names not in tried and promised[names] > first - GROWTH.pairs_reach]
    return near[: GROWTH.pairs]


def last_steps(out: Grown, names: frozenset[str]) -> list[tuple[Candidate, Effect]]:
    """The sets that lack one of ``names``, each with the most probable energy that it was fitted with, and that one."""
    known = {e.name: e for e in out.case.effects}
    parts: dict[str, Candidate] = {}
    for (_, own), c in out.found.items():
        lacks = names - own
        if own < names and len(lacks) == 1:
            name = next(iter(lacks))
            if name in known and (name not in parts or c.log_evidence > parts[name].log_evidence):
                parts[name] = c
    return [(base, known[name]) for name, base in parts.items()]


def _with_twins(out: Grown) -> None:
    """The most probable set with each of its effects that this test cannot tell from another as that other."""
    best = out.best
    energy, known = best.hypothesis.material.name, {e.name: e for e in out.case.effects}
    unseen = [
        (old, new)
        for old, new, names in swapped(frozenset(best.names), out.case.twins())
        if (energy, names) not in out.found and new in known
    ]
    pairs = [(out.found.get((energy, frozenset(best.names) - {old})), known[new]) for old, new in unseen]
    _add_effects(out, [(base, effect) for base, effect in pairs[: TWINS.added] if base is not None])


def _beam(out: Grown, size: int) -> list[Candidate]:
    """The sets that a further effect is added to: the most probable ones, and those that leave the least squares.

    Where much is missing, errors of laws as large as 40 % carry thousands of squares, and what is probable for them is
    not what leads on.
    """
    every = out.best_of_each_set(size)
    reach = GROWTH.beam_reach / out.counts
    near = [c for c in every if every[0].log_evidence - c.log_evidence < reach]
    least = sorted(near, key=out.search.excess)[: GROWTH.beam_by_squares]
    return list({id(c): c for c in (*near[: GROWTH.beam], *least)}.values())


def _promising(out: Grown, base: Candidate, size: int) -> list[Effect]:
    """Effects worth a fit beside ``base``: all that are visible beside the plain model, else those whose trace, to
    first order, takes most away.
    """
    rest = [e for e in out.case.visible if e.name not in base.names]
    if size == 1:
        return rest
    gains = {e.name: first_order(out.search, base, e) for e in rest}
    known = {frozenset(c.names) for c in out.of_size(size)}
    rest = [e for e in rest if frozenset((*base.names, e.name)) not in known]
    rest.sort(key=lambda e: -gains[e.name])
    promising = [e for e in rest if gains[e.name] > max(GROWTH.promise, gains[rest[0].name] - GROWTH.refit_reach)]
    return promising[: GROWTH.refits] if len(promising) > GROWTH.least_refits else rest[: GROWTH.least_refits]


def _add_effects(out: Grown, pairs: Sequence[tuple[Candidate, Effect]]) -> None:
    """Each of these candidates with one more effect, where that is better than what is known of it."""
    for c in fitted(out, pairs):
        out.add(c)


def fitted(out: Grown, pairs: Sequence[tuple[Candidate, Effect]]) -> list[Candidate]:
    """Each of these candidates with one more effect, as far as there is a film."""
    sought = []
    for base, effect in pairs:
        names = [e.title for e in base.hypothesis.effects if e.name not in out.case.null.names]
        out.case.tell(f"refitting with {' and '.join([*names, effect.title])}")
        starts = starts_with(_bases(out, base), effect, out.search.expected_sizes(effect))
        sought.append(Sought(with_effects(base.hypothesis, [effect]), starts, base))
    return [c for c in out.search.fits(sought) if c is not None]


def _bases(out: Grown, base: Candidate) -> list[Array]:
    """Where a further effect starts from: the fit, and draws of the prior where the fit may be bent."""
    if base.hypothesis.effects != out.case.null.hypothesis.effects:
        return [base.x]
    name = base.hypothesis.material.name
    if name not in out.starts:
        out.starts[name] = out.search.material_starts(base.hypothesis)[: GROWTH.further_starts]
    return [base.x, *out.starts[name]]


def _with_other_energies(out: Grown, size: int) -> None:
    """The most probable sets with every other energy, from that energy's own fit and the effects of the set's.

    Sets that are no better than without one of their effects have no further energy tried.
    """
    names = list(out.case.plain)
    tried = [c for c in out.best_of_each_set(size) if size == 1 or _gains(out, c)]
    # An energy that is not the true one may bend until it hides an effect, which is seen beside another one at once.
    near = [c for c in tried if size == 1 and tried[0].log_evidence - c.log_evidence < GROWTH.singles_reach]
    chosen = near if len(near) > GROWTH.with_other_energies else tried[: GROWTH.with_other_energies]
    for some in (chosen[:1], chosen[1:]):  # the first says which energies are worth it
        found = _with_energies(out, some, names)
        for best in some:
            for name in names:
                out.add(found.get((name, frozenset(best.names))))
            names = [n for n in names if _behind(out, best, n) < GROWTH.energy_reach]


def _with_energies(out: Grown, chosen: Sequence[Candidate], names: Sequence[str]) -> dict[Key, Candidate]:
    """Sets with each of these energies, from the energy's own fit and the effects of the set; without those known."""
    sought: dict[Key, Sought] = {}
    for best in chosen:
        for name in names:
            if (key := (name, frozenset(best.names))) not in out.found:
                plain = out.case.plain[name]
                out.case.tell(f"trying {best.label} with the energy {plain.hypothesis.material.title}")
                sought[key] = _transplanted(best, plain)
    found = out.search.fits(list(sought.values()))
    return {key: c for key, c in zip(sought, found, strict=True) if c is not None}


def _gains(out: Grown, c: Candidate) -> bool:
    """True if a set is more probable than each of those with one effect less that were fitted."""
    smaller = [f.log_evidence for (_, names), f in out.found.items() if names < frozenset(c.names)]
    return c.log_evidence > max(smaller, default=-np.inf) + GROWTH.promise


def _behind(out: Grown, best: Candidate, energy: str) -> float:
    """ln of the Bayes factor by which an energy is behind the best one with the same effects."""
    same = {e: c.log_evidence for (e, names), c in out.found.items() if names == frozenset(best.names)}
    return max(same.values()) - same.get(energy, -np.inf)


def _transplanted(best: Candidate, plain: Candidate) -> Sought:
    hypothesis: Hypothesis = replace(plain.hypothesis, effects=best.hypothesis.effects)
    effects = best.x[best.hypothesis.material_size :]
    return Sought(hypothesis, [np.concatenate([plain.x[: plain.hypothesis.material_size], effects])], best)


def _worth_more(out: Grown, size: int) -> bool:
    """True if sets of this size carry enough for larger ones to be looked at."""
    here = _mass(out, out.of_size(size))
    below = [_mass(out, out.of_size(s)) for s in range(size)]
    return bool(here > float(np.logaddexp.reduce(below)) + np.log(GROWTH.worth))


def _mass(out: Grown, candidates: Sequence[Candidate]) -> float:
    every = [out.counts * c.log_evidence + out.believed(c) for c in candidates]
    return float(np.logaddexp.reduce(every)) if every else -np.inf
