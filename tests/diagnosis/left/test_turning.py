"""What begins at a turn beside a law of loops, or at the last one, is told, and nothing else is."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.left.turning import at_a_turn
from bayesmembrane.physics.hypothesis import hypothesis
from tests.diagnosis.curves import SD, measured, triangle, white_noise


def torn_beside_loops(names: Sequence[str] = ("tearing", "hysteresis")) -> tuple[Search, Candidate]:
    """A film with these effects, as large as they usually are, moved to two peaks and back."""
    d = triangle(60)
    m = measured(8 * d, d)
    h = hypothesis("neo_hookean", names).on(m)
    search = Search(m, white_noise(m, SD))
    (start,) = search.material_starts(hypothesis("neo_hookean"))[:1]
    fit = search.at(h, np.concatenate([start, *([p.first for p in e.coordinates] for e in h.effects)]))
    assert fit is not None
    return search, fit


@pytest.mark.parametrize(
    ("names", "moment", "told"),
    [
        (["tearing", "hysteresis"], 40.5, True),  # the second peak; the first is at 10 s
        (["tearing", "hysteresis"], 10.4, True),
        (["tearing", "hysteresis"], 33.0, False),
        (["tearing", "force_offset"], 40.5, True),  # nothing is loaded again after that
        (["tearing"], 40.5, True),
        (["tearing"], 39.5, True),  # of a turn, too, what comes just before
        (["tearing"], 45.0, False),  # in the middle of a leg no loop lets a force fall at once
        (["tearing", "force_offset"], 10.4, False),
        (["tearing"], 10.4, False),
        (["hysteresis", "friction"], 40.5, False),
    ],
)
def test_a_tear_at_a_turn_is_told_where_loops_may_be_all_of_it(names: list[str], moment: float, told: bool) -> None:
    search, fit = torn_beside_loops(names)
    m, h = search.measurement, fit.hypothesis
    turns = m.path.clock[np.flatnonzero(np.diff(m.path.leg))]
    assert np.min(np.abs(turns - 40.5)) < 1
    assert np.min(np.abs(turns - 10.4)) < 1
    x = fit.x.copy()
    if "tearing" in names:
        x[h.names.index("tearing.moment")] = moment
    assert (at_a_turn(replace(fit, x=x), m) is not None) is told


@pytest.mark.parametrize(("part", "told"), [(0.0, False), (0.5, True), (1.0, True)])
def test_a_second_tear_at_a_turn_is_told_as_far_as_there_is_one(part: float, told: bool) -> None:
    search, fit = torn_beside_loops()
    x = fit.x.copy()
    for name, value in (("moment", 33.0), ("second", part), ("second_moment", 40.5)):
        x[fit.hypothesis.names.index(f"tearing.{name}")] = value
    assert (at_a_turn(replace(fit, x=x), search.measurement) is not None) is told


def test_a_first_tear_at_a_turn_of_which_nothing_is_left_is_not_told() -> None:
    search, fit = torn_beside_loops()
    x = fit.x.copy()
    for name, value in (("moment", 40.5), ("second", 1.0), ("second_moment", 33.0)):
        x[fit.hypothesis.names.index(f"tearing.{name}")] = value
    assert at_a_turn(replace(fit, x=x), search.measurement) is None


@pytest.mark.parametrize(("lifted", "told"), [(0.0, True), (1e-3, True), (15e-3, True), (25e-3, False)])
def test_a_turn_is_the_last_one_unless_the_disc_is_lifted_half_as_far_again(lifted: float, told: bool) -> None:
    d = np.concatenate([triangle(60), np.linspace(0.0, lifted, 8)[1:]]) if lifted else triangle(60)
    m = measured(8 * d, d)
    h = hypothesis("neo_hookean", ["tearing"]).on(m)
    search = Search(m, white_noise(m, SD))
    (start,) = search.material_starts(hypothesis("neo_hookean"))[:1]
    fit = search.at(h, np.concatenate([start, *([p.first for p in e.coordinates] for e in h.effects)]))
    assert fit is not None
    x = fit.x.copy()
    x[h.names.index("tearing.moment")] = m.path.clock[np.argmax(d)]
    assert (at_a_turn(replace(fit, x=x), m) is not None) is told
