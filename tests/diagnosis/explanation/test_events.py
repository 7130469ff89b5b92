"""Second events: of a strip whose force is closed-form here, in steps that no solver of the package has made."""

import numpy as np
import pytest

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.candidates.weighing import starts_with
from bayesmembrane.diagnosis.explanation.events import with_second_events
from bayesmembrane.diagnosis.thresholds import GROWTH
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from tests.diagnosis.curves import triangle, white_noise

RIG, POINTS = Uniaxial(), 180


def strip(effect: str, *steps: tuple[float, float]) -> Measurement:
    """Pulled to twice its length and let go, twice; at each of ``steps`` (place in the first loading, size) it becomes
    longer, or loses a part of itself.
    """
    x = RIG.length * triangle(POINTS, (1.0, 1.0))
    time = np.arange(1.0, POINTS + 1)
    reached = np.maximum.accumulate(x) / RIG.length
    done = sum(size * (reached >= place) for place, size in steps)
    longer, left = (1 + done, 1.0) if effect == "clamp_slip" else (1.0, 1 - done)
    stretch = np.maximum((1 + x / RIG.length) / longer, 1.0)
    force = left * RIG.width * 60 * (stretch - 1 / stretch**2)
    sd = 1e-3 * float(np.max(force))
    noisy = force + sd * np.random.default_rng(len(steps)).standard_normal(POINTS)
    return Measurement(x, noisy, RIG, Specimen("strip", 1e-3), time=time, force_sd=np.full(POINTS, sd))


def fitted(m: Measurement, effect: str) -> tuple[Search, Candidate]:
    search = Search(m, white_noise(m, float(m.force_sd[0])))
    h, plain = hypothesis("neo_hookean", effects=[effect]).on(m), hypothesis("neo_hookean").on(m)
    base = search.fit(plain, search.material_starts(plain))
    (own,) = h.effects
    found = search.fit(h, starts_with([base.x], own, search.expected_sizes(own)), base)
    return search, search.polished(found)


@pytest.mark.parametrize(("effect", "place"), [("clamp_slip", "place"), ("tearing", "moment")])
def test_what_came_in_two_steps_is_found_in_both(effect: str, place: str) -> None:
    m = strip(effect, (0.45, 0.03), (0.8, 0.05))
    search, found = fitted(m, effect)
    one_event = found.x.copy()
    for name, value in (("second", 0.0), (f"second_{place}", 0.05)):
        one_event[found.hypothesis.names.index(f"{effect}.{name}")] = value
    once = search.at(found.hypothesis, one_event)
    assert once is not None
    (twice,) = with_second_events(search, [once])
    assert twice.log_evidence > once.log_evidence + 50
    p = twice.parameters
    loading = m.deflection[: POINTS // 4 + 1] / RIG.length
    whole = np.interp([0.45, 0.8], loading, m.time[: POINTS // 4 + 1]) if place == "moment" else np.array([0.45, 0.8])
    places = np.sort([p[f"{effect}.{place}"], p[f"{effect}.second_{place}"]])
    assert places == pytest.approx(whole, abs=0.03 * (m.time[-1] if place == "moment" else 1.0))


@pytest.mark.parametrize("effect", ["clamp_slip", "tearing"])
def test_what_came_at_once_has_no_second_event(effect: str) -> None:
    search, once = fitted(strip(effect, (0.6, 0.06)), effect)
    share = once.hypothesis.names.index(f"{effect}.second")
    assert once.x[share] < GROWTH.no_event
    for c in with_second_events(search, [once]):
        assert c.x[share] < 5 * GROWTH.no_event
        assert c.log_evidence < once.log_evidence + 3


@pytest.mark.parametrize("effect", ["clamp_slip", "tearing"])
def test_all_of_it_in_the_second_event_is_one_event(effect: str) -> None:
    search, found = fitted(strip(effect, (0.45, 0.03), (0.8, 0.05)), effect)
    x, names = found.x.copy(), found.hypothesis.names
    part, place, _ = (names.index(f"{effect}.{own}") for own in found.hypothesis.effects[0].second)
    x[[part, place]] = 1.0, 0.3 * x[place]
    one = search.at(found.hypothesis, x)
    assert one is not None
    (twice,) = with_second_events(search, [one])
    assert GROWTH.no_event < twice.x[part] < 1 - GROWTH.no_event
    assert twice.log_evidence > one.log_evidence + 50


@pytest.mark.parametrize("effect", ["clamp_slip", "tearing"])
def test_a_second_event_of_what_is_given_is_found_too(effect: str) -> None:
    """As well as of the same effect where that is looked for."""
    search, sought = fitted(strip(effect, (0.45, 0.03), (0.8, 0.05)), effect)
    h = sought.hypothesis
    given = search.polished(search.fit(h, search.material_starts(h)))
    best = max([given, *with_second_events(search, [given])], key=lambda c: c.log_evidence)
    assert best.log_evidence > sought.log_evidence - 10


def test_all_of_it_in_one_event_is_no_bound_that_stops_it() -> None:
    search, found = fitted(strip("tearing", (0.6, 0.06)), "tearing")
    x, names = found.x.copy(), found.hypothesis.names
    x[names.index("tearing.second")] = 1.0
    x[names.index("tearing.takes")] = found.hypothesis.parameters[names.index("tearing.takes")].bounds[1]
    c = search.at(found.hypothesis, x)
    assert c is not None
    assert "tearing.second" not in c.at_bound
    assert "tearing.takes" in c.at_bound


def test_an_effect_without_events_is_left_as_it_is() -> None:
    search, once = fitted(strip("tearing", (0.6, 0.06)), "zero_offset")
    assert with_second_events(search, [once]) == []


@pytest.mark.parametrize(
    ("effect", "place", "sharp"), [("clamp_slip", "place", "width"), ("tearing", "moment", "takes")]
)
def test_wherever_between_two_readings_it_came_its_place_is_known(effect: str, place: str, sharp: str) -> None:
    """By infinitely small steps it would not be: then ln Z hung on where between them a search ended."""
    search, found = fitted(strip(effect, (0.6, 0.06)), effect)
    names, step = found.hypothesis.names, search.event_steps(found.hypothesis)
    at = names.index(f"{effect}.{place}")
    (low, high), told = found.hypothesis.parameters[at].bounds, []
    for part in np.linspace(0.0, 1.0, 5):
        x = found.x.copy()
        x[names.index(f"{effect}.{sharp}")] = found.hypothesis.parameters[names.index(f"{effect}.{sharp}")].bounds[0]
        x[at] += part * step[at]
        c = search.at(found.hypothesis, x)
        assert c is not None
        told.append(float(np.sqrt(search.covariance(c)[at, at])))
    assert max(told) < 0.1 * (high - low)


def test_readings_of_a_thinned_file_are_farther_apart_than_its_path() -> None:
    m = strip("tearing", (0.6, 0.06))
    h = hypothesis("neo_hookean", effects=["tearing"]).on(m)
    at = h.names.index("tearing.moment")
    every, few = (Search(part, white_noise(part)).event_steps(h)[at] for part in (m, m.select(np.arange(0, POINTS, 3))))
    assert (every, few) == (pytest.approx(1.0), pytest.approx(3.0))
