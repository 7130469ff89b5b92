"""Sets of effects grow one by one, and are looked back at: what led the search need not stay."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from bayesmembrane.diagnosis.candidates.candidate import Candidate, with_effects
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.explanation import growth
from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS
from bayesmembrane.diagnosis.explanation.case import OpenCase
from bayesmembrane.diagnosis.explanation.foreign import SUDDEN, Foreign
from bayesmembrane.diagnosis.explanation.growth import (
    Grown,
    _last_steps,
    _promising_pairs,
    _with_crossed,
    _with_exchanged,
    _with_less,
    _with_parts,
    weigh_by_draws,
    with_falls,
    with_sets,
)
from bayesmembrane.diagnosis.thresholds import FOREIGN, GROWTH, SAMPLED, SEARCH, VERDICT
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.hypothesis import Hypothesis, hypothesis


def claim(*effects: str) -> Hypothesis:
    return with_effects(hypothesis("gent"), [components("effects")[n]() for n in effects])


def candidate(h: Hypothesis, log_evidence: float) -> Candidate:
    nothing = np.zeros(3)
    x = np.arange(h.curve_size, dtype=float)
    return Candidate(h, x, nothing, nothing[:, None], log_evidence, (), nothing[None], np.zeros(2), nothing)


class Shelf:
    """In place of a search: ln Z by set of effects, before and after it is searched on."""

    def __init__(self, start: dict[frozenset[str], float], end: dict[frozenset[str], float]) -> None:
        self.start, self.end = start, end
        self.asked: list[frozenset[str]] = []
        self.coordinates: list[np.ndarray] = []

    def placed(self, every: list[tuple[Hypothesis, np.ndarray]]) -> list[Candidate | None]:
        self.coordinates += [x for _, x in every]
        named = [(h, frozenset(e.name for e in h.effects)) for h, _ in every]
        return [candidate(h, self.start[names]) if names in self.start else None for h, names in named]

    def log_tempered(self, c: Candidate, counts: float) -> float:
        return counts * c.log_evidence

    def all_polished(self, every: list[Candidate]) -> list[Candidate]:
        self.asked += [frozenset(c.names) for c in every]
        return [candidate(c.hypothesis, self.end[frozenset(c.names)]) for c in every]


def looked_back(shelf: Shelf, *found: Candidate) -> dict[frozenset[str], float]:
    case = SimpleNamespace(null=candidate(claim(), 0.0))
    grown = Grown(cast(OpenCase, case), cast(Search, cast(Any, shelf)))
    for c in found:
        grown.add(c)
    _with_less(grown)
    return {names: c.log_evidence for (_, names), c in grown.found.items()}


FRICTION, MULLINS = frozenset({"friction"}), frozenset({"mullins"})


@pytest.mark.parametrize("before", [-80.0, None])
def test_a_smaller_set_is_searched_for_from_a_larger_one(before: float | None) -> None:
    shelf = Shelf({FRICTION: -12.0, MULLINS: -90.0}, {FRICTION: -9.5})
    earlier = [] if before is None else [candidate(claim("friction"), before)]
    found = looked_back(shelf, candidate(claim("friction", "mullins"), -10.0), *earlier)
    assert found[FRICTION] == -9.5
    assert shelf.asked == [FRICTION]


def test_what_decides_is_fitted_without_each_of_its_effects(monkeypatch: pytest.MonkeyPatch) -> None:
    """A set that is fitted with an energy whose part was fitted with others only; one without a share is left alone."""
    monkeypatch.setattr(growth, "all_seen", lambda _, found, *__: dict.fromkeys(found, 0.0))
    shelf = Shelf({FRICTION: -11.0, MULLINS: -90.0}, {FRICTION: -9.5})
    odds = [SimpleNamespace(odds=1.0) for _ in range(4)]
    plain = candidate(claim(), -60.0)
    case = SimpleNamespace(null=plain, plain={"gent": plain}, visible=odds, question=SimpleNamespace(energy=None))
    grown = Grown(cast(OpenCase, case), cast(Search, cast(Any, shelf)))
    for c in (plain, candidate(claim("friction", "mullins"), -10.0), candidate(claim("friction", "tearing"), -80.0)):
        grown.add(c)
    _with_parts(grown)
    assert shelf.asked == [FRICTION]
    assert grown.found["gent", FRICTION].log_evidence == -9.5
    _with_parts(grown)
    assert shelf.asked == [FRICTION]


def test_what_is_far_behind_is_not_weighed_by_itself() -> None:
    """Its ln Z is as far behind that of the best as a part of it says; the others have their priors whole."""
    asked: list[frozenset[str]] = []

    def log_tempered(c: Candidate, counts: float) -> float:
        asked.append(frozenset(c.names))
        return counts * c.log_evidence - 2.0 * len(c.names)

    case = SimpleNamespace(null=candidate(claim(), 0.0))
    grown = Grown(cast(OpenCase, case), cast(Search, cast(Any, SimpleNamespace(log_tempered=log_tempered))))
    for names, z in (((), -1000.0), (("friction",), -10.0), (("friction", "mullins"), -9.0)):
        grown.add(candidate(claim(*names), z))
    counts = grown.counts
    found = {names: z for (_, names), z in grown.log_tempered().items()}
    assert frozenset() not in asked
    assert found[FRICTION] == pytest.approx(counts * -10.0 - 2.0)
    assert found[FRICTION | MULLINS] == pytest.approx(counts * -9.0 - 4.0)
    assert found[frozenset()] == pytest.approx(counts * -1000.0 - 4.0)


def test_sets_that_the_answer_asks_for_are_fitted_from_their_parts_and_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was checked before keeps the ln Z that it has."""
    shelf, both = Shelf({}, {FRICTION | MULLINS: -12.0}), claim("friction", "mullins")
    parts = [candidate(claim("friction"), -10.0), candidate(claim("mullins"), -30.0), candidate(claim(), -60.0)]
    steps: list[Any] = []

    def fitted(_: Grown, pairs: Any) -> list[Candidate]:
        steps.extend((frozenset(base.names), effect.name) for base, effect in pairs)
        return [candidate(both, -15.0)]

    monkeypatch.setattr(growth, "_fitted", fitted)
    monkeypatch.setattr(growth, "checked", lambda _, c: replace(c, log_evidence=c.log_evidence + 1.0))
    case = SimpleNamespace(effects=both.effects)
    grown = Grown(cast(OpenCase, case), cast(Search, cast(Any, shelf)))
    for c in parts:
        grown.add(c)
    late = list[str]()
    monkeypatch.setattr(Grown, "renew", lambda _: late.append("noise"))
    monkeypatch.setattr(growth, "weigh_by_draws", lambda _: late.append("draws"))
    with_sets(grown, [FRICTION | MULLINS])
    assert late == ["draws"]  # the same set leads
    assert set(steps) == {(FRICTION, "mullins"), (MULLINS, "friction")}
    assert shelf.asked == [FRICTION | MULLINS]
    found = {names: c.log_evidence for (_, names), c in grown.found.items()}
    assert found == {FRICTION: -10.0, MULLINS: -30.0, frozenset(): -60.0, FRICTION | MULLINS: -11.0}


@pytest.mark.parametrize(("end", "better"), [(-9.0, True), (-20.0, False)])
def test_a_tear_is_looked_for_where_the_force_is_seen_to_fall(
    monkeypatch: pytest.MonkeyPatch, end: float, better: bool
) -> None:
    """From that moment, beside the set beside which it falls; what is best by that is grown from once more. No set
    gets more effects than are asked for.
    """
    torn, base = claim("mullins", "tearing"), candidate(claim("mullins"), -15.0)
    tear = torn.effects[1]
    asked: list[Any] = []
    grew: list[Any] = []

    def fits(sought: list[Any]) -> list[Candidate | None]:
        asked.extend(sought)
        return [candidate(s.hypothesis, -30.0) for s in sought]

    monkeypatch.setattr(growth, "_fitted", lambda _, pairs: grew.extend(pairs) or [])
    monkeypatch.setattr(growth, "checked", lambda _, c: c)
    monkeypatch.setattr(growth, "first_order", lambda *_: 1.0)
    search = SimpleNamespace(
        fits=fits,
        all_polished=lambda every: [replace(c, log_evidence=end) for c in every],
        expected_sizes=lambda e: np.array([0.1]),
    )
    friction = claim("friction").effects[0]
    case = SimpleNamespace(
        null=candidate(claim(), 0.0), visible=[tear, friction], question=SimpleNamespace(quick=False)
    )
    grown = Grown(cast(OpenCase, case), cast(Search, cast(Any, search)))
    grown.add(base)
    once = candidate(torn, -7.0)
    once.x[torn.names.index("tearing.second")] = 0.0
    grown.add(replace(once, by_draws=5.0))  # -12 by its linear model
    falls = [
        Foreign(SUDDEN, base, 30.0, size=-0.03, on_clock=0.7),
        Foreign(SUDDEN, grown.best, 3.0, size=-0.01, on_clock=0.2),
        Foreign(SUDDEN, candidate(claim("mullins", "friction", "rate"), -9.0), 30.0, size=-0.03, on_clock=0.5),
    ]
    late = list[str]()
    monkeypatch.setattr(Grown, "renew", lambda _: late.append("noise"))
    monkeypatch.setattr(growth, "weigh_by_draws", lambda _: late.append("draws"))
    assert with_falls(grown, falls) is better
    assert late == (["noise", "draws"] if better else [])
    assert [[e.name for e in s.hypothesis.effects] for s in asked] == 2 * [["mullins", "tearing"]]
    own = [c.name for c in tear.coordinates]
    place, part, again = (base.x.size + own.index(n) for n in ("moment", "second", "second_moment"))
    assert {float(start[place]) for start in asked[0].starts} == {0.7}
    assert {float(start[part]) for start in asked[0].starts} == {0.0}
    (start,) = asked[1].starts  # where it falls beside a tear, that may run once more
    assert (start[part], start[again]) == (GROWTH.second_part, 0.2)
    assert grown.found["gent", MULLINS | {"tearing"}].log_evidence == (end if better else -7.0)
    assert [e.name for _, e in grew] == (["friction"] if better else [])


@pytest.mark.parametrize("structure", [False, True])
def test_of_what_leads_more_draws_are_made_than_of_what_may_decide(
    monkeypatch: pytest.MonkeyPatch, structure: bool
) -> None:
    """The null model, all that has a share, and, with more draws, what leads by then; each is first searched for to its
    end, and once. Beside what leaves structure only what leads is checked, and once.
    """
    ended: list[tuple[str, ...]] = []

    def all_polished(every: list[Candidate], steps: int) -> list[Candidate]:
        assert steps == SEARCH.iterations
        ended.extend(c.names for c in every)
        return every

    shares = {(): 1e-6, ("friction",): 0.9, ("mullins",): 0.09, ("tearing",): 0.005, ("rate",): 1e-5}
    drawn: list[tuple[tuple[str, ...], Any]] = []
    monkeypatch.setattr(growth, "checked", lambda _, c, drawing: drawn.append((c.names, drawing)) or c)
    monkeypatch.setattr(
        growth, "_shares", lambda out, _: {key: float(np.log(shares[c.names])) for key, c in out.found.items()}
    )
    monkeypatch.setattr(Grown, "seen", lambda _: {})
    case = SimpleNamespace(null=candidate(claim(), 0.0), tell=lambda _: None)
    over = 1.0 + BELIEFS.blurred + (0.01 if structure else -0.01)  # of what counts as noise, few points being left
    points = candidate(claim("friction"), 0.0)
    noise = 1.0 + VERDICT.chance * float(np.sqrt(2.0 / max(points.residual.size - points.x.size, 1)))
    squares = over * max(VERDICT.noise_chi2, noise) * max(points.residual.size - points.x.size, 1)
    search = SimpleNamespace(all_polished=all_polished, squares=lambda *_: squares)
    grown = Grown(cast(OpenCase, case), cast(Search, cast(Any, search)))
    for names in shares:
        grown.add(candidate(claim(*names), 0.0))
    weigh_by_draws(grown)
    weigh_by_draws(grown)
    assert sorted(ended) == [(), ("friction",), ("mullins",), ("tearing",)]
    del drawn[len(drawn) // 2 :]
    kinds = (SAMPLED.first, SAMPLED.last, SAMPLED.vague)
    first, last, vague = ([names for names, d in drawn if d is each] for each in kinds)
    assert first == ([] if structure else [(), ("friction",), ("mullins",), ("tearing",)])
    assert last == ([] if structure else [("friction",), ("mullins",)])
    assert vague == ([(), ("friction",), ("mullins",)] if structure else [])


def test_what_decides_is_searched_for_from_the_materials_of_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each from those of its energy that have a share, with its own effects; a better end is polished and kept."""
    monkeypatch.setattr(growth, "all_seen", lambda _, found, *__: dict.fromkeys(found, 0.0))
    odds = [SimpleNamespace(odds=1.0) for _ in range(4)]
    plain = candidate(claim(), -90.0)
    one, two = (candidate(claim(n), z) for n, z in (("friction", -10.0), ("mullins", -10.5)))
    one = replace(one, x=one.x + 100.0)
    asked: list[Any] = []

    def fits(sought: list[Any]) -> list[Candidate | None]:
        asked.extend(sought)
        return [candidate(s.hypothesis, -30.0 if s.hypothesis is one.hypothesis else -9.0) for s in sought]

    search = SimpleNamespace(
        fits=fits, all_polished=lambda every: every, log_tempered=lambda c, counts: counts * c.log_evidence
    )
    case = SimpleNamespace(null=plain, plain={"gent": plain}, visible=odds, question=SimpleNamespace(energy=None))
    grown = Grown(cast(OpenCase, case), cast(Search, cast(Any, search)))
    for c in (plain, one, two):
        grown.add(c)
    _with_crossed(grown)
    assert [s.hypothesis for s in asked] == [one.hypothesis, two.hypothesis]
    for s, own, other in zip(asked, (one, two), (two, one), strict=True):
        ((start,),) = (s.starts,)
        size = own.hypothesis.material_size
        np.testing.assert_array_equal(start, [*other.x[:size], *own.x[size:]])
    assert {n: c.log_evidence for (_, n), c in grown.found.items() if n} == {FRICTION: -10.0, MULLINS: -9.0}


def test_what_was_found_before_is_not_lost() -> None:
    shelf = Shelf({FRICTION: -12.0}, {FRICTION: -12.0})
    found = looked_back(shelf, candidate(claim("friction", "mullins"), -10.0), candidate(claim("friction"), -11.0))
    assert found[FRICTION] == -11.0


def test_what_is_far_behind_is_not_searched_on() -> None:
    far = -10.0 - GROWTH.less_reach - 1.0
    shelf = Shelf({FRICTION: far, MULLINS: -40.0}, {})
    found = looked_back(shelf, candidate(claim("friction", "mullins"), -10.0))
    assert set(found) == {FRICTION | MULLINS}


def test_the_other_coordinates_are_where_they_were() -> None:
    shelf = Shelf({}, {})
    whole = candidate(claim("friction", "mullins"), -10.0)
    looked_back(shelf, whole)
    sizes = [len(e.coordinates) for e in whole.hypothesis.effects]
    material = whole.hypothesis.material_size
    first = whole.x[material : material + sizes[0]]
    second = whole.x[material + sizes[0] : material + sum(sizes)]
    for x in shelf.coordinates:
        assert np.array_equal(x[:material], whole.x[:material])
    left = [x[material : material + max(sizes)] for x in shelf.coordinates]
    assert sorted(len(x) for x in left) == sorted(sizes)
    for kept in (first, second):
        assert any(np.array_equal(x, kept) for x in left)


def exchanged(
    monkeypatch: pytest.MonkeyPatch, promised: dict[str, float], end: dict[frozenset[str], float]
) -> list[Any]:
    """Sets that are fitted by exchanging effects of {friction, tearing}, the best so far, with ln Z of ``end``."""
    asked: list[Any] = []

    def add(out: Grown, pairs: list[tuple[Candidate, Any]]) -> None:
        for base, effect in pairs:
            names = frozenset((*base.names, effect.name))
            asked.append(names)
            out.add(candidate(with_effects(base.hypothesis, [effect]), end.get(names, -60.0)))

    monkeypatch.setattr(growth, "first_order", lambda _, base, effect: promised[effect.name])
    monkeypatch.setattr(growth, "_add_effects", add)
    visible = [components("effects")[n]() for n in ("friction", "tearing", *promised)]
    case = SimpleNamespace(null=candidate(claim(), 0.0), visible=visible)
    grown = Grown(cast(OpenCase, case), cast(Search, cast(Any, SimpleNamespace(at=lambda *_: None))))
    for names, z in ((("friction",), -40.0), (("tearing",), -50.0), (("friction", "tearing"), -10.0)):
        grown.add(candidate(claim(*names), z))
    _with_exchanged(grown)
    return asked


PROMISED = {"mullins": 30.0, "viscoelastic": 5.0, "clamp_slip": 1.0}


def test_effects_of_the_best_set_are_exchanged_for_what_promises_most(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = exchanged(monkeypatch, PROMISED, {})
    pairs = [("tearing", "mullins"), ("tearing", "viscoelastic"), ("friction", "mullins"), ("friction", "viscoelastic")]
    assert asked == [frozenset(p) for p in pairs]


def test_a_better_set_that_is_found_by_that_is_gone_on_from(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is fitted twice."""
    better = frozenset({"tearing", "mullins"})
    asked = exchanged(monkeypatch, PROMISED, {better: -2.0})
    assert len(asked) == len(set(asked))
    assert frozenset({"tearing", "clamp_slip"}) in asked  # beside what is left of it


def several(*found: tuple[tuple[str, ...], float]) -> Grown:
    """A search that has found these sets, with effects of the library to look for."""
    known = [components("effects")[n]() for n in ("friction", "mullins", "tearing", "clamp_slip")]
    case = SimpleNamespace(null=candidate(claim(), 0.0), effects=known, visible=known)
    grown = Grown(cast(OpenCase, case), cast(Search, cast(Any, None)))
    for names, z in found:
        grown.add(candidate(claim(*names), z))
    return grown


def test_a_set_is_searched_for_from_each_of_its_parts_that_was_found() -> None:
    grown = several(((), -90.0), (("friction",), -40.0), (("tearing",), -50.0), (("friction", "mullins"), -10.0))
    steps = _last_steps(grown, frozenset({"friction", "mullins", "tearing"}))
    assert [(sorted(base.names), effect.name) for base, effect in steps] == [(["friction", "mullins"], "tearing")]
    steps = _last_steps(grown, frozenset({"friction", "tearing"}))
    assert {(*base.names, effect.name) for base, effect in steps} == {("friction", "tearing"), ("tearing", "friction")}


def test_pairs_that_nobody_fitted_are_asked_for_by_what_they_promise(monkeypatch: pytest.MonkeyPatch) -> None:
    promised = {
        frozenset({"friction", "mullins"}): 50.0,  # fitted
        frozenset({"tearing", "clamp_slip"}): 49.0,
        frozenset({"mullins", "tearing"}): 49.5,
        frozenset({"friction", "tearing"}): 50.0 - 1.1 * GROWTH.pairs_reach,
    }
    monkeypatch.setattr(growth, "gains_of_pairs", lambda *_: promised)
    grown = several(((), -90.0), (("friction", "mullins"), -41.0))
    (plain,) = grown.of_size(0)
    assert _promising_pairs(grown, [plain]) == [{"mullins", "tearing"}, {"tearing", "clamp_slip"}]


@pytest.mark.parametrize("limit", [-np.inf, -80.0, 10.0])
def test_nothing_grows_where_a_limit_leaves_noise_alone(monkeypatch: pytest.MonkeyPatch, limit: float) -> None:
    """Single effects are fitted, and the sum is told of them: sets of several only if none explains all so well."""
    grew: list[Any] = []

    def add(out: Grown, pairs: list[Any]) -> None:
        grew.append(len(pairs))
        out.add(candidate(claim("friction"), -50.0))

    for step in ("_with_less", "_with_exchanged", "_with_pairs", "_with_twins"):
        monkeypatch.setattr(growth, step, lambda *_, step=step: grew.append(step))
    for step in ("_with_parts", "_with_crossed", "weigh_by_draws", "_with_other_energies"):
        monkeypatch.setattr(growth, step, lambda *_: None)
    monkeypatch.setattr(growth, "_add_effects", add)
    monkeypatch.setattr(growth, "_worth_more", lambda *_: False)
    monkeypatch.setattr(Grown, "polish", lambda *_: None)
    plain = candidate(claim(), -100.0)
    anew = candidate(claim(), -90.0)

    def renewed(out: Grown) -> None:
        """Under another noise everything has another ln Z."""
        out.add(anew)

    def with_limit(_: Any, bases: list[Candidate]) -> float:
        assert bases == [anew]
        return limit

    monkeypatch.setattr(Grown, "renew", renewed)
    case = SimpleNamespace(
        null=plain,
        best_plain=plain,
        plain={"gent": plain},
        visible=[components("effects")["friction"]()],
        question=SimpleNamespace(quick=False),
        log_evidence_of_limit=with_limit,
        search=None,
    )
    out = growth.grown(cast(OpenCase, case))
    assert out.limited == (limit > -50.0 + FOREIGN.settled)
    assert grew[0] == 1
    assert ("_with_pairs" in grew) is not out.limited
