"""Sets of effects grow one by one, and are looked back at: what led the search need not stay."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from bayesmembrane.diagnosis.candidates.candidate import Candidate, with_effects
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.explanation import grown as grown_module
from bayesmembrane.diagnosis.explanation import growth
from bayesmembrane.diagnosis.explanation.case import OpenCase
from bayesmembrane.diagnosis.explanation.grown import Grown
from bayesmembrane.diagnosis.explanation.growth import (
    _promising_pairs,
    _with_crossed,
    _with_exchanged,
    _with_less,
    _with_parts,
    last_steps,
)
from bayesmembrane.diagnosis.thresholds import FOREIGN, GROWTH
from bayesmembrane.ground.registry import components
from tests.diagnosis.explanation.shelf import FRICTION, MULLINS, Shelf, candidate, claim


def looked_back(shelf: Shelf, *found: Candidate) -> dict[frozenset[str], float]:
    case = SimpleNamespace(null=candidate(claim(), 0.0))
    grown = Grown(cast(OpenCase, case), cast(Search, cast(Any, shelf)))
    for c in found:
        grown.add(c)
    _with_less(grown)
    return {names: c.log_evidence for (_, names), c in grown.found.items()}


@pytest.mark.parametrize("before", [-80.0, None])
def test_a_smaller_set_is_searched_for_from_a_larger_one(before: float | None) -> None:
    shelf = Shelf({FRICTION: -12.0, MULLINS: -90.0}, {FRICTION: -9.5})
    earlier = [] if before is None else [candidate(claim("friction"), before)]
    found = looked_back(shelf, candidate(claim("friction", "mullins"), -10.0), *earlier)
    assert found[FRICTION] == -9.5
    assert shelf.asked == [FRICTION]


def test_what_decides_is_fitted_without_each_of_its_effects(monkeypatch: pytest.MonkeyPatch) -> None:
    """A set that is fitted with an energy whose part was fitted with others only; one without a share is left alone."""
    monkeypatch.setattr(grown_module, "all_seen", lambda _, found, *__: dict.fromkeys(found, 0.0))
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


def test_what_decides_is_searched_for_from_the_materials_of_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each from those of its energy that have a share, with its own effects; a better end is polished and kept."""
    monkeypatch.setattr(grown_module, "all_seen", lambda _, found, *__: dict.fromkeys(found, 0.0))
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
    steps = last_steps(grown, frozenset({"friction", "mullins", "tearing"}))
    assert [(sorted(base.names), effect.name) for base, effect in steps] == [(["friction", "mullins"], "tearing")]
    steps = last_steps(grown, frozenset({"friction", "tearing"}))
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
