"""Hypotheses that are searched for side by side are found where each is found alone."""

from collections import Counter
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.diagnosis.candidates.candidate import with_effects
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.candidates.side_by_side import Searching
from bayesmembrane.diagnosis.candidates.weighing import Sought, starts_with
from bayesmembrane.diagnosis.thresholds import SEARCH
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.mechanics.request import Request
from bayesmembrane.physics.mechanics.solution import Curves
from bayesmembrane.physics.rigs.annulus import Annulus
from tests.diagnosis.curves import triangle, white_noise
from tests.generator.film import Film

SD = 0.004
PLAIN = hypothesis("neo_hookean")


class Counted:
    """The solver, and how often it was called."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, asked: Request) -> Curves:
        self.calls += 1
        return api.solve(asked)


@pytest.fixture(scope="module")
def measured() -> Measurement:
    path = triangle(90, (0.02, 0.03))
    film = Film("neo_hookean", (8.0,), 0.010, 0.035, 0.04)
    force = film.force(path) + SD * np.random.default_rng(5).standard_normal(path.size)
    return Measurement(path, force, Annulus(0.010, 0.035), Specimen("film", 5e-5), time=np.arange(1.0, path.size + 1))


def searching(measured: Measurement) -> tuple[Search, Counted]:
    solve = Counted()
    return Search(measured, white_noise(measured, SD, 80.0), solve=solve), solve


def sought(search: Search) -> list[Sought]:
    plain = search.fit(PLAIN, search.material_starts(PLAIN))
    assert plain is not None
    effects = [components("effects")[n]() for n in ("mullins", "friction", "prestretch", "permanent_set")]
    return [
        Sought(with_effects(PLAIN, [e]), starts_with([plain.x], e, search.expected_sizes(e)), plain) for e in effects
    ]


def test_together_and_alone_end_at_the_same_evidence_by_fewer_solutions(measured: Measurement) -> None:
    (one, counted), (other, counted_alone) = searching(measured), searching(measured)
    every, again = sought(one), sought(other)
    counted.calls = counted_alone.calls = 0
    together = one.fits(every)
    alone = [other.fit(s.hypothesis, s.starts, s.parent) for s in again]
    for a, b in zip(together, alone, strict=True):
        assert a is not None
        assert b is not None
        assert a.log_evidence == pytest.approx(b.log_evidence, abs=0.02)
    assert counted.calls < counted_alone.calls
    polished = one.all_polished([c for c in together if c is not None])
    for a, c in zip(polished, alone, strict=True):
        assert c is not None
        assert a.log_evidence == pytest.approx(other.polished(c).log_evidence, abs=0.02)


def test_a_search_that_stays_far_behind_is_not_waited_for_and_the_best_ends_where_it_does_alone(
    measured: Measurement, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A guide that sticks, and hypotheses that know of none, by a valley that they might creep along for long."""
    rubbed = replace(measured, force=measured.force + 0.1 * np.sign(np.gradient(measured.deflection)))
    told: Counter[str] = Counter()
    own = Searching.told

    def counted(search: Searching, r: np.ndarray, j: np.ndarray) -> None:
        told[search.hypothesis.effects[-1].name if search.hypothesis.effects else ""] += 1
        own(search, r, j)

    monkeypatch.setattr(Searching, "told", counted)
    (one, _), (other, _) = searching(rubbed), searching(rubbed)
    every, again = sought(one), sought(other)
    together = [c for c in one.fits(every) if c is not None]
    many = Counter(told)
    told.clear()
    alone = [c for s in again if (c := other.fit(s.hypothesis, s.starts, s.parent)) is not None]
    best = max(alone, key=lambda c: c.log_evidence)
    assert best.names == ("friction",)
    assert together[alone.index(best)].log_evidence == pytest.approx(best.log_evidence, abs=0.02)
    others = [n for n in told if n not in ("", "friction")]
    assert sum(many[n] for n in others) < sum(told[n] for n in others)
    for a, b in zip(together, alone, strict=True):
        assert b is best or a.log_evidence < best.log_evidence - SEARCH.behind / 2


class Line:
    """A search that is told residuals of known ``sizes`` step by step, of each row its own, whatever it asks."""

    def __init__(self, *sizes: list[float]) -> None:
        self.sizes, self.step = sizes, 0
        axes = SimpleNamespace(
            bounds=(np.array([-1e9]), np.array([1e9])),
            to_x=lambda u: u,
            pull=lambda u: (0.0 * u, np.zeros_like(u)),
            slope=np.ones_like,
        )
        start = np.zeros((len(sizes), 1))
        self.search = Searching(PLAIN, cast(Any, axes), cast(Any, lambda v: v), start, 40)

    def go(self, steps: int) -> None:
        for _ in range(steps):
            rows = self.search._descent.rows if self.step else range(len(self.sizes))
            r = np.array([[self.sizes[row][min(self.step, len(self.sizes[row]) - 1)], 0.0] for row in rows])
            self.step += 1
            self.search.told(r, np.full((len(r), 2, 1), 30.0))


def test_a_start_that_is_good_at_first_hides_none_that_falls() -> None:
    stuck, falling = [100.0] + 30 * [101.0], [900.0 - 20 * k for k in range(40)]
    one, both, alone = Line(stuck), Line(stuck, falling), Line(falling)
    for line in (one, both, alone):
        line.go(10)
    assert one.search.hopeless(10.0)
    assert not both.search.hopeless(10.0)
    assert not alone.search.hopeless(10.0)


def test_steps_that_win_nothing_for_a_while_are_no_end() -> None:
    """The damping rises by them, until one wins."""
    waiting = Line([1000.0, 1001.0, 1001.0, 1001.0, 900.0, 800.0])
    waiting.go(4)
    assert not waiting.search.hopeless(10.0)
    waiting.go(2)
    assert not waiting.search.hopeless(10.0)
    for_long = Line([1000.0] + 20 * [1001.0])
    for_long.go(SEARCH.idle + 1)
    assert for_long.search.hopeless(10.0)
    assert not for_long.search.hopeless(990.0**2)


def test_where_a_search_ended_is_not_solved_again(measured: Measurement) -> None:
    search, solve = searching(measured)
    found = search.fit(PLAIN, search.material_starts(PLAIN))
    assert found is not None
    solve.calls = 0
    r, j = search.batch(found.hypothesis, found.x[None])
    assert solve.calls == 0
    assert np.array_equal(r[0], -found.residual)
    assert np.array_equal(j[0], found.slopes)


def test_a_hypothesis_without_a_film_is_none_beside_those_that_have_one(measured: Measurement) -> None:
    search, _ = searching(measured)
    effect = components("effects")["mullins"]()
    start = starts_with([np.array([2.0])], effect, search.expected_sizes(effect))
    lost = [np.full_like(s, np.nan) for s in start]
    claims = [with_effects(PLAIN, [effect]) for _ in range(2)]
    found = search.fits([Sought(claims[0], lost), Sought(claims[1], start)])
    assert found[0] is None
    assert found[1] is not None
