"""Sets that are asked for late: those that nobody fitted, and those beside which the force falls."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.explanation import asked as asked_module
from bayesmembrane.diagnosis.explanation.asked import with_falls, with_sets
from bayesmembrane.diagnosis.explanation.case import OpenCase
from bayesmembrane.diagnosis.explanation.foreign import SUDDEN, Foreign
from bayesmembrane.diagnosis.explanation.grown import Grown
from bayesmembrane.diagnosis.thresholds import GROWTH
from tests.diagnosis.explanation.shelf import FRICTION, MULLINS, Shelf, candidate, claim


def test_sets_that_the_answer_asks_for_are_fitted_from_their_parts_and_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was checked before keeps the ln Z that it has."""
    shelf, both = Shelf({}, {FRICTION | MULLINS: -12.0}), claim("friction", "mullins")
    parts = [candidate(claim("friction"), -10.0), candidate(claim("mullins"), -30.0), candidate(claim(), -60.0)]
    steps: list[Any] = []

    def fitted(_: Grown, pairs: Any) -> list[Candidate]:
        steps.extend((frozenset(base.names), effect.name) for base, effect in pairs)
        return [candidate(both, -15.0)]

    monkeypatch.setattr(asked_module, "fitted", fitted)
    monkeypatch.setattr(asked_module, "checked", lambda _, c: replace(c, log_evidence=c.log_evidence + 1.0))
    case = SimpleNamespace(effects=both.effects)
    grown = Grown(cast(OpenCase, case), cast(Search, cast(Any, shelf)))
    for c in parts:
        grown.add(c)
    late = list[str]()
    monkeypatch.setattr(Grown, "renew", lambda _: late.append("noise"))
    monkeypatch.setattr(asked_module, "weigh_by_draws", lambda _: late.append("draws"))
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

    monkeypatch.setattr(asked_module, "fitted", lambda _, pairs: grew.extend(pairs) or [])
    monkeypatch.setattr(asked_module, "checked", lambda _, c: c)
    monkeypatch.setattr(asked_module, "first_order", lambda *_: 1.0)
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
    monkeypatch.setattr(asked_module, "weigh_by_draws", lambda _: late.append("draws"))
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
