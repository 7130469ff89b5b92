"""The sum over hypotheses: what a further effect that could not be seen is worth, and one that nobody fitted."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from bayesmembrane.diagnosis.candidates.candidate import Candidate, with_effects
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.explanation import telling, total
from bayesmembrane.diagnosis.explanation import visible as visible_module
from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS, Beliefs
from bayesmembrane.diagnosis.explanation.case import OpenCase
from bayesmembrane.diagnosis.explanation.foreign import LOST, SUDDEN, UNNAMED, Foreign
from bayesmembrane.diagnosis.explanation.grown import Grown
from bayesmembrane.diagnosis.explanation.telling import ANOTHER_LAW, NOTHING, UNLISTED
from bayesmembrane.diagnosis.thresholds import TWINS
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.effects.base import Effect
from bayesmembrane.physics.hypothesis import hypothesis

LEFT = 100.0
FOUR = (1.0,) * 4  # odds of all effects
TRIED = [SimpleNamespace(odds=1.0, mistaken=0.0, name=n) for n in ("friction", "mullins")]


def candidate(*effects: str, log_evidence: float, energy: str = "gent") -> Candidate:
    claim = with_effects(hypothesis(energy), [components("effects")[n]() for n in effects])
    nothing, x = np.zeros(3), np.zeros(claim.curve_size)
    return Candidate(
        claim, x, nothing, nothing[:, None], log_evidence, (), nothing[None], np.array([0.0, -9.0]), nothing
    )


def effects(monkeypatch: pytest.MonkeyPatch, **said: Any) -> dict[str, float]:
    """Probabilities of the sets of `summed_up`."""
    return dict(summed_up(monkeypatch, **said).probabilities.effects)


def summed_up(
    monkeypatch: pytest.MonkeyPatch,
    seen: float,
    gain: float,
    untried: Sequence[Any] = (),
    promised: float = -np.inf,
    step: Mapping[str, Any] | None = None,
    flatter: float = 1.0,
    sees_nothing: bool = True,
    adequate: bool = False,
    elsewhere: float = 0.0,
    unlisted: float = 0.0,
    left: float = 0.0,
    mistaken: float = 0.0,
) -> total.Total:
    """The sum where friction explains the curve, and Mullins beside it has a ``gain`` in ln Z.

    That changes by ``seen`` where what could not be seen counts as absent. Of four effects that can be seen some may be
    ``untried``, where traces of those that were not fitted have a ``promised`` ln of the Bayes factor. Beside the first
    set there is a ``step``, if there is one. ``flatter`` : the power of `Beliefs.flattened`;
    ``elsewhere`` : told of sets that are next to those of the sum; ``unlisted`` : of a fault of no known kind;
    ``left`` : squares that each model leaves; ``mistaken`` : how often each effect is, for another.
    """
    for module in (total, telling):
        monkeypatch.setattr(module, "BELIEFS", told(flatter, elsewhere, unlisted))
    takes = {
        frozenset({"friction"}): {"friction": LEFT - 20.0},
        frozenset({"friction", "mullins"}): {"mullins": 3.0},
        frozenset(): {},
    }

    def visible(_: Search, c: Candidate, given: Collection[str], found: dict[str, float], counts: float) -> float:
        assert not given
        assert counts == BELIEFS.counts(50.0 + max(gain, 0.0))
        assert found == takes[frozenset(c.names)]
        return seen if "mullins" in c.names else 0.0

    monkeypatch.setattr(total, "levelled", lambda weights, *_: dict.fromkeys(weights, 0.0))

    def foretold(_: Search, base: Candidate, effect: Effect, counts: float) -> float:
        assert effect.name not in base.names
        assert counts == BELIEFS.counts(50.0 + max(gain, 0.0))
        return promised

    monkeypatch.setattr(total, "promised", foretold)
    monkeypatch.setattr(visible_module, "log_seen", visible)
    squares = {frozenset(): LEFT, frozenset({"friction"}): 20.0, frozenset({"friction", "mullins"}): 17.0}
    search = SimpleNamespace(
        excess=lambda c: squares[frozenset(c.names)],
        expected_sizes=lambda e: np.array([e.size.scale]),
        log_tempered=lambda c, counts: counts * c.log_evidence,
        squares=lambda c, trace=None: left,
    )
    plain = candidate(log_evidence=-60.0)
    case = SimpleNamespace(
        null=plain,
        plain={"gent": plain},
        visible=[SimpleNamespace(**{**vars(e), "mistaken": mistaken}) for e in [*untried, *TRIED, *TRIED][:4]],
        question=SimpleNamespace(energy=None),
        sees_nothing=sees_nothing,
        tested=lambda _: SimpleNamespace(adequate=adequate),
        twins=lambda: frozenset(),
        foreign=lambda _, bases, __: [] if step is None else [Foreign(SUDDEN, bases[0], 30.0, **step)],
        tell=lambda _: None,
    )
    grown = Grown(cast(OpenCase, case), cast(Search, cast(Any, search)))
    for c in (
        plain,
        candidate("friction", log_evidence=-10.0),
        candidate("friction", "mullins", log_evidence=-10.0 + gain),
    ):
        grown.add(c)
    return total.summed(grown)


def told(flatter: float = 1.0, elsewhere: float = 0.0, unlisted: float = 0.0) -> Beliefs:
    """With another power of `Beliefs.flattened`, so much told of sets next to those of the sum, and of what is not
    listed, and sets of every size alike.
    """
    shares = {
        "elsewhere": elsewhere,
        "elsewhere_by_another_law": 2 * elsewhere,
        "elsewhere_beside_structure": elsewhere,
    }
    faults = {"unlisted": unlisted, "unlisted_beside_structure": unlisted}
    return replace(BELIEFS, flatter=flatter, spurious=0.0, **shares, **faults)


def by_likelihood_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """No twins, nothing that a trace promises, and all effects as large as can be seen."""
    monkeypatch.setattr(total, "levelled", lambda weights, *_: dict.fromkeys(weights, 0.0))
    monkeypatch.setattr(total, "promised", lambda *_: -np.inf)
    monkeypatch.setattr(visible_module, "log_seen", lambda *_: 0.0)


def grown_of(case: Any) -> Grown:
    """Nothing yet, of a case under whose noise all fits leave the same squares."""
    search = SimpleNamespace(
        excess=lambda c: LEFT,
        expected_sizes=lambda e: np.array([e.size.scale]),
        log_tempered=lambda c, counts: counts * c.log_evidence,
        squares=lambda c, trace=None: 0.0,
    )
    return Grown(cast(OpenCase, case), cast(Search, cast(Any, search)))


@pytest.mark.parametrize("seen", [1.5, 0.0, -25.0])
def test_a_set_counts_as_far_as_its_effects_can_be_seen(monkeypatch: pytest.MonkeyPatch, seen: float) -> None:
    """Whole: it is the prior of its sizes that changes, while only a part of ln Z counts."""
    p = effects(monkeypatch, seen=seen, gain=2.0)
    counted = BELIEFS.counts(52.0) * 2.0 + seen
    odds = np.exp(counted + BELIEFS.log_set((1.0,) * 2, FOUR) - BELIEFS.log_set((1.0,), FOUR))
    assert p["friction+mullins"] == pytest.approx(odds / (1 + odds), rel=1e-6)


def test_sets_are_told_flattened_and_what_is_foreign_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    step = {"share": 0.1}
    said, flat = (summed_up(monkeypatch, seen=0.5, gain=2.0, step=step, flatter=f) for f in (1.0, BELIEFS.flatter))
    assert flat.probabilities.foreign == pytest.approx(said.probabilities.foreign)
    beside = {k: p for k, p in said.joint.items() if k[1] == NOTHING}
    assert {k: flat.joint[k] for k in beside} == pytest.approx(BELIEFS.flattened(beside))
    assert sum(flat.probabilities.effects.values()) == pytest.approx(1.0)
    for j in flat.ranking:  # one energy each: what a hypothesis has is what its set has
        assert j.probability == pytest.approx(flat.joint["+".join(sorted(j.candidate.names)) or NOTHING, NOTHING])
    assert [j.probability for j in flat.ranking] == sorted((j.probability for j in flat.ranking), reverse=True)


def test_no_set_stands_out_that_leaves_more_than_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    """Next to all by known laws, and no law of the library follows the curve."""
    said = {
        left: summed_up(monkeypatch, seen=0.0, gain=30.0, flatter=0.5, elsewhere=0.4, unlisted=0.1, left=left)
        for left in (1.0, 5.5, 20.0)
    }
    noise, some, more = (total.probabilities for total in said.values())
    assert noise.effects["friction+mullins"] > 0.99
    assert noise.foreign.get(UNLISTED, 0.0) < 1e-6
    assert more.effects["friction+mullins"] == pytest.approx(0.66, abs=0.01)  # one step back of two is home
    assert more.foreign[UNLISTED] == pytest.approx(0.1, abs=0.01)
    assert more.effects["friction"] > 1e-2
    assert more.effects["friction+mullins"] + 0.05 < some.effects["friction+mullins"] < 0.95
    assert sum(more.effects.values()) == pytest.approx(1.0)


def test_effects_are_told_as_surely_as_they_are_seldom_mistaken(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of Mullins and friction together a part is told of each alone, and what is said of a hypothesis follows."""
    sure, doubted = (summed_up(monkeypatch, seen=0.0, gain=30.0, mistaken=m) for m in (0.0, 0.2))
    assert sure.probabilities.effects["friction+mullins"] > 0.99
    p = doubted.probabilities.effects
    assert p["friction+mullins"] == pytest.approx(0.64 * sure.probabilities.effects["friction+mullins"])
    assert p["friction"] == pytest.approx(p["mullins"], rel=1e-3) == pytest.approx(0.18, rel=1e-3)
    assert p[NOTHING] == pytest.approx(sure.probabilities.effects[NOTHING])
    assert doubted.by_laws == pytest.approx(sure.by_laws)
    for j in doubted.ranking:
        assert j.probability == pytest.approx(p["+".join(sorted(j.candidate.names)) or NOTHING])


def test_probabilities_add_up_to_one(monkeypatch: pytest.MonkeyPatch) -> None:
    assert sum(effects(monkeypatch, seen=0.0, gain=-1.0).values()) == pytest.approx(1.0)


def test_a_further_effect_that_nobody_fitted_is_not_excluded(monkeypatch: pytest.MonkeyPatch) -> None:
    """It keeps a small part of what its trace promises beside the set, and no more however much that is."""
    unseen = [SimpleNamespace(odds=1.0, mistaken=0.0, name="tearing")]
    nothing = effects(monkeypatch, seen=0.0, gain=-1.0)
    assert "friction+tearing" not in nothing
    found = {p: effects(monkeypatch, seen=0.0, gain=-1.0, untried=unseen, promised=p) for p in (-2.0, 50.0)}
    prior = BELIEFS.log_set((1.0,) * 2, FOUR) - BELIEFS.log_set((1.0,), FOUR)
    for said, p in found.items():
        kept = BELIEFS.untried * np.exp(prior + min(said, BELIEFS.supported))
        assert p["friction+tearing"] / p["friction"] == pytest.approx(kept)
        assert p["friction+mullins"] / p["friction"] == pytest.approx(nothing["friction+mullins"] / nothing["friction"])
    assert [sum(p.values()) for p in found.values()] == pytest.approx([1.0, 1.0])


def leaving(base: Candidate, fall: float, tear: float) -> Any:
    """By what a fall leaves beside the ``base``, and any other hypothesis by itself, parameters counted."""
    return lambda c, trace=None: fall - base.x.size - total.OF_A_FALL if c is base else tear - c.x.size


def test_a_fall_that_stays_is_at_most_twelve_times_less_probable_than_a_tear_that_leaves_its_trace() -> None:
    """Beside the same effects, with the same energy, and where it fits nearly as well, whatever their priors say."""
    base, torn = candidate("friction", log_evidence=-50.0), candidate("friction", "tearing", log_evidence=-20.0)
    softer, other = candidate("friction", "mullins", log_evidence=-20.0), replace(torn, log_evidence=-45.0)
    far = TWINS.behind

    def least(left: float, size: float, *others: Candidate) -> float:
        search = cast(Search, SimpleNamespace(squares=leaving(base, left, 30.0)))
        fall = Foreign(SUDDEN, base, 24.0, -1.0, size=size)
        return total._like_a_tear(fall, total._tears(fall, [base, *others], search), lambda c: 3.0, search)

    for some in (torn, other):
        for left in (30.0, 30.0 + 1.9 * far, 30.0 - 1.2 * far):
            assert least(left, -0.1, some) == pytest.approx(3.0 - np.log(BELIEFS.apart))
    for left, size, one in ((30.0, 0.1, torn), (30.0 + 2.1 * far, -0.1, torn), (30.0, -0.1, softer)):
        assert least(left, size, one) == -np.inf


@pytest.mark.parametrize(("kind", "size", "held"), [(LOST, 1e-3, True), (LOST, -1e-3, False), (SUDDEN, -0.1, False)])
def test_a_clamp_that_slips_is_held_against_lost_steps_and_not_against_a_fall(
    kind: str, size: float, held: bool
) -> None:
    base, slid = candidate("friction", log_evidence=-50.0), candidate("friction", "clamp_slip", log_evidence=-20.0)
    search = cast(Search, cast(Any, SimpleNamespace(squares=leaving(base, LEFT, LEFT))))
    assert (total._tears(Foreign(kind, base, 9.0, size=size), [base, slid], search) == [slid]) is held


@pytest.mark.parametrize("ahead", [-20.0, 0.0, 15.0])
@pytest.mark.parametrize(("size", "behind", "held"), [(-0.1, 0.9, True), (0.1, 0.9, False), (-0.1, 1.1, False)])
def test_a_tear_is_at_most_twelve_times_less_probable_than_a_fall_that_stands_little_better(
    monkeypatch: pytest.MonkeyPatch, size: float, behind: float, held: bool, ahead: float
) -> None:
    """Nor more, for being ``ahead`` with another energy than that beside which it was compared."""
    by_likelihood_alone(monkeypatch)
    for module in (total, telling):
        monkeypatch.setattr(module, "BELIEFS", told())
    base = candidate("friction", log_evidence=-60.0)
    torn = candidate("friction", "tearing", log_evidence=-60.0)
    other = candidate("friction", "tearing", log_evidence=-60.0 + ahead, energy="yeoh")
    case = SimpleNamespace(
        null=candidate(log_evidence=-90.0),
        plain={"gent": base},
        visible=[*TRIED, SimpleNamespace(odds=1.0, mistaken=0.0, name="tearing")],
        question=SimpleNamespace(energy=None),
        sees_nothing=True,
        twins=lambda: frozenset(),
        foreign=lambda *_: [Foreign(SUDDEN, base, 24.0, -1.0, size=size)],
        tell=lambda _: None,
    )
    grown = grown_of(case)
    for c in (case.null, base, torn, other):
        grown.add(c)
    cast(Any, grown.search).squares = leaving(base, LEFT, LEFT + 2 * behind * TWINS.behind)
    joint = total.summed(grown).joint
    ratio = joint["friction", SUDDEN] / joint["friction+tearing", NOTHING]
    both = 1.0 + float(np.exp(-abs(ahead)))  # what is behind, of the set as a whole
    assert (ratio == pytest.approx(BELIEFS.apart / both, rel=1e-4)) is held
    assert held or ratio > 2 * BELIEFS.apart


def test_a_set_is_not_less_probable_for_having_been_fitted_with_one_energy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two energies are alike without effects: friction fitted with both has no more than Mullins fitted with one."""
    by_likelihood_alone(monkeypatch)
    plain = [candidate(log_evidence=-60.0, energy=name) for name in ("gent", "yeoh")]
    case = SimpleNamespace(
        null=plain[0],
        plain=dict(zip(("gent", "yeoh"), plain, strict=True)),
        visible=[*TRIED, *TRIED],
        question=SimpleNamespace(energy=None),
        sees_nothing=True,
        twins=lambda: frozenset(),
        foreign=lambda *_: [],
        tell=lambda _: None,
    )
    grown = grown_of(case)
    both = [candidate("friction", log_evidence=-10.0, energy=name) for name in ("gent", "yeoh")]
    for c in (*plain, *both, candidate("mullins", log_evidence=-10.0)):
        grown.add(c)
    p = total.summed(grown).probabilities
    assert p.effects["mullins"] == pytest.approx(p.effects["friction"])
    assert p.energies["gent"] == pytest.approx(p.energies["yeoh"])
    # Energies are told flatter than they are summed, whether one stands out or not.
    grown.add(candidate("friction", log_evidence=-7.0, energy="gent"))
    told = total.summed(grown).probabilities
    for module in (total, telling):
        monkeypatch.setattr(module, "BELIEFS", replace(BELIEFS, energies_flatter=1.0))
    summed = total.summed(grown).probabilities
    assert summed.energies["gent"] > 1.2 * summed.energies["yeoh"]
    assert told.energies == pytest.approx(BELIEFS.energies_flattened(summed.energies))
    assert told.effects == pytest.approx(summed.effects)


def test_draws_of_a_poor_model_say_nothing_of_what_takes_its_misfit_away(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draws about a fit that misses everything brought 55: something smooth beside it had 87 % for that."""
    by_likelihood_alone(monkeypatch)

    def foreign_with(by_draws: float, share: float) -> float:
        null = replace(candidate(log_evidence=-900.0 + by_draws), by_draws=by_draws)
        case = SimpleNamespace(
            null=null,
            plain={"gent": null},
            visible=[*TRIED, *TRIED],
            question=SimpleNamespace(energy=None),
            sees_nothing=True,
            twins=lambda: frozenset(),
            foreign=lambda *_: [Foreign(UNNAMED, null, 850.0, share=share)],
            tell=lambda _: None,
        )
        grown = grown_of(case)
        for c in (null, candidate("friction", log_evidence=-50.0)):
            grown.add(c)
        return total.summed(grown).probabilities.anything_foreign

    assert foreign_with(55.0, 1.0) == pytest.approx(foreign_with(0.0, 1.0), rel=0.2)
    assert foreign_with(55.0, 0.0) > 0.9
    assert foreign_with(-55.0, 1.0) < foreign_with(0.0, 1.0)


@pytest.mark.parametrize(
    ("off", "sees_nothing", "adequate", "far"),
    [
        ("friction", False, False, ["friction", "friction+mullins"]),
        ("friction", True, False, ["friction", "friction+mullins"]),
        (NOTHING, False, False, [NOTHING]),
        (NOTHING, False, True, []),
        (NOTHING, True, False, []),
        ("", False, False, []),
    ],
)
def test_what_holds_only_with_a_law_far_off_is_mostly_something_foreign(
    monkeypatch: pytest.MonkeyPatch, off: str, sees_nothing: bool, adequate: bool, far: list[str]
) -> None:
    """Beside the same sets; an energy that is off is none where the tests see nothing."""
    monkeypatch.setattr(total, "carried", lambda c, _: off in (c.names or (NOTHING,)))
    said = {"sees_nothing": sees_nothing, "adequate": adequate}
    found = summed_up(monkeypatch, 0.0, 1.0, **said).probabilities
    plain = summed_up(monkeypatch, 0.0, 1.0).probabilities.effects
    moved = BELIEFS.another_law * sum(plain[name] for name in far)
    assert found.foreign.get(ANOTHER_LAW, 0.0) == pytest.approx(moved)
    assert sum(found.foreign.values()) == pytest.approx(1.0)
    assert found.something_found == pytest.approx(0.0, abs=1e-12)
    assert found.anything_foreign == pytest.approx(moved)
    assert found.effects == pytest.approx(plain)


def test_beside_another_law_sets_are_flatter_however_one_stands_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """And those that nobody fitted keep what they have."""
    monkeypatch.setattr(total, "carried", lambda c, _: "friction" in c.names)
    said = {"untried": TRIED[:1], "promised": 0.0}
    plain = summed_up(monkeypatch, 0.0, -8.0, **said).joint
    flat = summed_up(monkeypatch, 0.0, -8.0, flatter=0.5, **said).joint
    odds = plain["friction", ANOTHER_LAW] / plain["friction+mullins", ANOTHER_LAW]
    assert odds > 20
    assert flat["friction", ANOTHER_LAW] / flat["friction+mullins", ANOTHER_LAW] == pytest.approx(odds**0.5)
    monkeypatch.setattr(total, "carried", lambda *_: False)
    known = summed_up(monkeypatch, 0.0, -8.0, **said).joint
    assert {s for s, _ in plain} == {s for s, _ in known}
    for name in {s for s, _ in known}:
        assert sum(q for (s, _), q in plain.items() if s == name) == pytest.approx(known[name, NOTHING])


def test_a_part_is_told_of_sets_next_to_those_of_the_sum(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where none stands out; nothing is taken from no effect, and the sum by the laws of the library is kept."""
    said = {"seen": 0.0, "gain": 3.0, "untried": [SimpleNamespace(odds=1.0, mistaken=0.0, name="tearing")]}
    plain, near = (summed_up(monkeypatch, **said, elsewhere=e) for e in (0.0, 0.2))
    before, after = (dict(t.probabilities.effects) for t in (plain, near))
    assert max(before.values()) < 0.9
    assert near.by_laws == pytest.approx(plain.by_laws)
    assert plain.by_laws == pytest.approx(before)
    assert sum(after.values()) == pytest.approx(1.0)
    assert after[NOTHING] >= before[NOTHING] * (1 - 1e-9)
    for name in ("tearing", "mullins", "friction+tearing", "mullins+tearing"):
        assert after[name] > before.get(name, 0.0) + 1e-4
    kept = sum(after[name] for name in ("friction", "friction+mullins"))
    assert 0.8 < kept / sum(before[name] for name in ("friction", "friction+mullins")) < 0.9


def test_a_part_of_what_effects_have_is_told_of_a_fault_of_no_known_kind(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where none stands out, beside the same sets, and not of no effect; it is not something that was found."""
    plain, some = (summed_up(monkeypatch, 0.0, 1.0, unlisted=u).probabilities for u in (0.0, 0.1))
    assert max(plain.effects.values()) < 0.9
    assert some.effects == pytest.approx(plain.effects)
    assert some.foreign[UNLISTED] == pytest.approx(0.1 * (1 - plain.effects[NOTHING]))
    assert sum(some.foreign.values()) == pytest.approx(1.0)
    assert some.something_found == pytest.approx(0.0, abs=1e-12)
    clear = summed_up(monkeypatch, 0.0, -9.0, unlisted=0.1).probabilities
    assert max(clear.effects.values()) > 0.95
    assert clear.foreign.get(UNLISTED, 0.0) == 0.0


def test_nothing_is_told_of_others_where_one_stands_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """But beside a law that is not the library's."""
    plain, near = (dict(summed_up(monkeypatch, 0.0, -9.0, elsewhere=e).probabilities.effects) for e in (0.0, 0.2))
    assert max(plain.values()) > 0.95
    assert near == pytest.approx({n: p for n, p in plain.items() if n in near}, abs=1e-4)
    monkeypatch.setattr(total, "carried", lambda *_: True)
    far = summed_up(monkeypatch, 0.0, -9.0, elsewhere=0.2).probabilities
    moved = 1 - far.effects["friction"] / plain["friction"]
    assert moved == pytest.approx(0.4 * far.foreign[ANOTHER_LAW], abs=0.05)


@pytest.mark.parametrize(("more", "moved"), [(0.0, 0.0), (0.9, 0.0), (1.1, BELIEFS.another_law)])
def test_a_set_that_leaves_more_than_no_effect_does_is_mostly_something_foreign(
    monkeypatch: pytest.MonkeyPatch, more: float, moved: float
) -> None:
    """It is errors of its laws that explain the curve, then: they are parts of traces larger than the misfit."""
    by_likelihood_alone(monkeypatch)
    for module in (total, telling):
        monkeypatch.setattr(module, "BELIEFS", told())
    slid = candidate("friction", log_evidence=-20.0)
    case = SimpleNamespace(
        null=candidate(log_evidence=-90.0),
        plain={"gent": slid},
        visible=TRIED,
        question=SimpleNamespace(energy=None),
        sees_nothing=False,
        tested=lambda _: SimpleNamespace(adequate=False),
        twins=lambda: frozenset(),
        foreign=lambda *_: [],
        tell=lambda _: None,
    )
    grown = grown_of(case)
    for c in (case.null, slid):
        grown.add(c)
    cast(Any, grown.search).excess = lambda c: LEFT + (2 * more * TWINS.behind if c.names else 0.0)
    found = total.summed(grown)
    assert found.probabilities.foreign.get(ANOTHER_LAW, 0.0) == pytest.approx(moved, abs=1e-3)
    first = found.ranking[0]
    assert (first.worse, first.carried([])) == (bool(moved), bool(moved))
