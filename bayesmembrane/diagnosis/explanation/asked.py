"""Sets that are asked for once the answer is known: those beside which the force falls, or that nobody fitted."""

from __future__ import annotations

from collections.abc import Sequence

from bayesmembrane.diagnosis.candidates.candidate import Candidate, with_effects
from bayesmembrane.diagnosis.candidates.sampled import checked
from bayesmembrane.diagnosis.candidates.weighing import Sought, starts_with
from bayesmembrane.diagnosis.explanation.checking import weigh_by_draws
from bayesmembrane.diagnosis.explanation.foreign import Foreign
from bayesmembrane.diagnosis.explanation.grown import Grown, key_of
from bayesmembrane.diagnosis.explanation.growth import fitted, last_steps
from bayesmembrane.diagnosis.explanation.promise import first_order
from bayesmembrane.diagnosis.thresholds import GROWTH


def with_sets(out: Grown, sets: Sequence[frozenset[str]]) -> None:
    """Sets that promised nothing, from each of their parts; searched on and checked as what grew."""
    before = out.best
    _kept(out, fitted(out, [step for names in sets for step in last_steps(out, names)]))
    _settle(out, before)


def with_falls(out: Grown, falls: Sequence[Foreign]) -> bool:
    """Effects that begin at some moment, or do so again, from those at which the force falls beside a set; True if any
    got better.

    One is found from nearby only, and a search for a fall looks at every reading. What is best by that is grown from
    once more, and says what noise is.
    """
    sought = []
    for f in (f for f in falls if len(out.own(f.base)) < out.most):
        for effect in out.case.visible:
            shapes = effect.come_at(f.on_clock)
            if shapes and effect.name not in f.base.names and f.shares_test_with(effect):
                starts = starts_with([f.base.x], effect, out.search.expected_sizes(effect), shapes)
                sought.append(Sought(with_effects(f.base.hypothesis, [effect]), starts, f.base))
    sought += [s for f in falls if (s := _begun_again(f)) is not None]
    before, better = out.best, _kept(out, [c for c in out.search.fits(sought) if c is not None])
    first = max(better, key=lambda c: c.log_evidence, default=None)
    if first is not None and len(out.own(first)) < out.most:
        rest = [e for e in out.case.visible if e.name not in first.names]
        rest.sort(key=lambda e: -first_order(out.search, first, e))
        _kept(out, fitted(out, [(first, e) for e in rest[: GROWTH.refits]]))
    if better:
        _settle(out, before)
    return bool(better)


def _settle(out: Grown, before: Candidate) -> None:
    """After what was found late: noise from what leads now, if that is not what led ``before``, and draws of what
    decides.
    """
    if out.best is not before:
        out.renew()
    weigh_by_draws(out)


def _begun_again(f: Foreign) -> Sought | None:
    """The base of a fall with a second event of one of its effects at that moment; None if none begins so, or all have
    one.
    """
    names, x = list(f.base.hypothesis.names), f.base.x.copy()
    for e in f.base.hypothesis.effects:
        if e.second is not None and e.begins == e.second[1] and f.shares_test_with(e):
            part, _, place = (names.index(f"{e.name}.{own}") for own in e.second)
            if x[part] < GROWTH.no_event:
                x[part], x[place] = GROWTH.second_part, f.on_clock
                return Sought(f.base.hypothesis, [x], f.base)
    return None


def _kept(out: Grown, fits: Sequence[Candidate]) -> list[Candidate]:
    """Those that are better than what is known of their hypotheses, searched on and checked.

    What is known may have been checked: linear evidences are compared, for only those are of one kind.
    """
    better = []
    for c in out.search.all_polished(fits):
        known = out.found.get(key_of(c))
        if known is None or c.log_evidence > known.log_evidence - known.by_draws:
            out.found[key_of(c)] = checked(out.search, c)
            better.append(out.found[key_of(c)])
    return better
