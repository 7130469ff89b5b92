"""Sets of effects grow one by one, and are looked back at: what led the search need not stay."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from bayesmembrane.diagnosis.candidates.candidate import Candidate, with_effects
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.explanation.case import OpenCase
from bayesmembrane.diagnosis.explanation.growth import Grown, _with_less
from bayesmembrane.diagnosis.thresholds import GROWTH
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

    def at(self, h: Hypothesis, x: np.ndarray) -> Candidate | None:
        self.coordinates.append(x)
        names = frozenset(e.name for e in h.effects)
        return candidate(h, self.start[names]) if names in self.start else None

    def polished(self, c: Candidate) -> Candidate:
        self.asked.append(frozenset(c.names))
        return candidate(c.hypothesis, self.end[frozenset(c.names)])


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
