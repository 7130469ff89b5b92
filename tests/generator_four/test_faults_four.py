"""Each fault of the fourth generator does what it says, and nothing at size 0."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from tests.generator_four.courses import BOTH_WAYS, ONE_WAY, DriveCourse, draw_course
from tests.generator_four.faults import FAULTS, FaultAtWork, draw_fault
from tests.generator_four.film_laws import LengthenedCone
from tests.generator_four.rig import LiftingRig
from tests.generator_three.curves import FilmCurves
from tests.generator_three.elements import ElementFilm, Rubber

FORMS = [(name, form) for name, kind in FAULTS.items() for form in kind.forms]
MIDDLE = 0.02


@cache
def film() -> FilmCurves:
    curves = FilmCurves(ElementFilm(10.0, 30.0), Rubber("gent", (0.02, 12.0)), 1.7)
    curves.prepare()
    return curves


@cache
def course(holds: bool = False) -> DriveCourse:
    """Two cycles to the peak, with holds at the top if asked for."""
    top = [1.0, 1.0] if holds else [1.0]
    level = np.array([0, *top, 0, *top, 0])
    at = np.interp(np.linspace(0, 1, 241), np.linspace(0, 1, len(level)), level)
    return DriveCourse(np.linspace(0, 100, 241), film().peak * at, "cycles")


def fault(name: str, form: str, size: float = MIDDLE) -> FaultAtWork:
    for seed in range(60):
        drawn = draw_fault(np.random.default_rng(seed), name)
        if drawn.form == form:
            return replace(drawn, size=size)
    raise AssertionError(form)


def read(name: str, form: str, size: float = MIDDLE, holds: bool = False) -> Any:
    """F/top"""
    rig = LiftingRig(film(), course(holds), {name: fault(name, form, size)})
    return rig.reading() / rig.top


def sound(holds: bool = False) -> Any:
    return film().sound(course(holds).at) / float(film().sound(film().peak))


def legs(values: Any) -> list[Any]:
    """First loading, its way back turned round, second loading, and its way back."""
    a, b, c, d = values[:61], values[60:121][::-1], values[120:181], values[180:241][::-1]
    return [a, b, c, d]


@pytest.mark.parametrize(("name", "form"), FORMS)
def test_a_fault_of_size_zero_leaves_the_sound_film(name: str, form: str) -> None:
    assert read(name, form, 0.0) == pytest.approx(sound(), abs=2e-5)


@pytest.mark.parametrize(("name", "form"), FORMS)
def test_a_fault_shows_more_the_larger_it_is(name: str, form: str) -> None:
    small, large = (np.linalg.norm(read(name, form, s) - sound()) for s in (MIDDLE / 2, MIDDLE))
    assert 0 < small < large


@pytest.mark.parametrize("form", ["even", "drawn_by_ring"])
def test_a_stretched_film_is_stiff_at_once(form: str) -> None:
    first = legs(read("prestretch", form) - sound())[0]
    assert read("prestretch", form)[3] > 3 * sound()[3]
    assert first[1:].min() > 0


@pytest.mark.parametrize(("name", "forms"), [("zero_offset", ("hook", "seating")), ("machine_compliance", None)])
def test_slack_and_a_soft_frame_take_force_away_alike_on_all_legs(name: str, forms: Any) -> None:
    for form in forms or FAULTS[name].forms:
        one, two, three, four = legs(read(name, form))
        assert (one <= legs(sound())[0] + 1e-9).all()
        for other in (two, three, four):
            assert other == pytest.approx(one, abs=1e-6)


@pytest.mark.parametrize(
    ("name", "form", "size"),
    [("permanent_set", "flow", 0.2), ("clamp_slip", "pull_out", 0.05), ("clamp_slip", "stick_slip", 0.05)],
)
def test_set_and_slip_leave_the_film_slack(name: str, form: str, size: float) -> None:
    one, two, three, _ = legs(read(name, form, size))
    low = slice(3, 20)
    assert (two[low] < 0.95 * one[low]).all()
    assert (three[low] < 0.98 * one[low]).all()
    assert (two[:2] == 0).all()


def test_a_residual_push_is_gone_at_the_largest_deflection_and_slack_at_rest() -> None:
    one, two, three, _ = legs(read("permanent_set", "residual", 0.1))
    assert three[-1] == pytest.approx(one[-1], abs=1e-9)
    assert (two[1:4] == 0).all()
    assert (two[1:-2] < one[1:-2]).all()


def test_the_longer_cone_is_the_solved_longer_film_to_a_quarter() -> None:
    """Of the change of force, where the film is well taut; straight meridians are exact in the limit."""
    little, free = 0.004 * 20, 20.0
    at = np.array([0.4, 0.6, 0.8, 1.0]) * film().peak
    cone = LengthenedCone(film().sound, free)
    solved = film().curve(film().rubber.parameters, 1.0, -little)(at) - film().sound(at)
    assert cone.force(at, -little) - film().sound(at) == pytest.approx(solved, rel=0.25)
    assert cone.force(at, 0) == pytest.approx(film().sound(at), rel=1e-4)
    assert cone.force(np.array([1.0]), 1.0) == 0


@pytest.mark.parametrize("form", FAULTS["mullins"].forms)
def test_a_softened_film_is_softer_on_the_way_back_and_the_next_time(form: str) -> None:
    one, two, three, four = legs(read("mullins", form, 0.2))
    middle = slice(5, 45)
    assert (two[middle] < one[middle]).all()
    assert three[middle] == pytest.approx(two[middle], rel=0.05)
    assert four[middle] == pytest.approx(two[middle], rel=0.05)


@pytest.mark.parametrize(("name", "form"), [(n, f) for n, f in FORMS if n in ("hysteresis", "friction")])
def test_loops_of_friction_are_the_same_again_and_at_any_speed(name: str, form: str) -> None:
    _, two, three, four = legs(read(name, form))
    middle = slice(15, 50)
    assert (three[middle] > two[middle]).all()
    assert four[middle] == pytest.approx(two[middle], abs=1e-3)
    rig = LiftingRig(film(), course(), {name: fault(name, form)})
    faster = replace(rig, course=replace(course(), time=course().time / 10))
    assert faster.reading() == pytest.approx(rig.reading(), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("form", FAULTS["tearing"].forms)
def test_a_torn_film_never_recovers(form: str) -> None:
    carries = (read("tearing", form, 0.2) / np.maximum(sound(), 1e-9))[sound() > 0.01]
    assert (np.diff(carries) <= 1e-9).all()
    assert 0.5 < carries[-1] < 0.95


@pytest.mark.parametrize("form", FAULTS["viscoelastic"].forms)
def test_force_falls_in_a_hold(form: str) -> None:
    force, held = read("viscoelastic", form, 0.3, holds=True), np.flatnonzero(sound(holds=True) > 0.99999)
    first = held[held < 90]
    assert (np.diff(force[first]) < 0).all()
    assert force[first[0]] < 1


@pytest.mark.parametrize("form", FAULTS["force_drift"].forms)
def test_the_zero_drifts_from_where_it_was(form: str) -> None:
    drift = read("force_drift", form) - sound()
    assert drift[0] == pytest.approx(0, abs=1e-9)
    assert abs(drift).max() == pytest.approx(MIDDLE)


def test_foreign_faults_do_what_they_say() -> None:
    def change(name: str, form: str) -> Any:
        return read(name, form) - sound()

    assert read("overload", "hard").max() == pytest.approx(1 - MIDDLE)
    assert (change("lost_motion", "nut")[:61] == pytest.approx(0, abs=1e-12)) is True
    assert (legs(change("lost_motion", "nut"))[1][5:-5] > 0).all()
    assert set(np.round(change("zero_jump", "knock"), 9)) == {0.0, MIDDLE}
    assert change("draught", "gust").max() == pytest.approx(MIDDLE, rel=0.05)
    ripple = change("screw_ripple", "one_start")[1:61]
    assert ripple.min() < 0 < ripple.max()


@pytest.mark.parametrize("kind", [*ONE_WAY, *BOTH_WAYS])
def test_courses_begin_at_rest_and_reach_the_peak(kind: str) -> None:
    for seed in range(5):
        found = draw_course(np.random.default_rng(seed), kind, 20.0)
        assert found.at[0] == 0
        assert (np.diff(found.time) > 0).all()
        assert 18 < found.at.max() <= 20
        assert 60 <= len(found.at) <= 700
        assert (found.returns[-1] == 0) == (kind in ONE_WAY)


def test_sizes_are_told_in_units() -> None:
    flaws: Mapping[str, FaultAtWork] = {n: fault(n, FAULTS[n].forms[0]) for n in ("clamp_slip", "force_offset")}
    rig = LiftingRig(film(), course(), flaws)
    assert rig.si("clamp_slip") == pytest.approx(MIDDLE * 0.02)
    assert rig.si("force_offset") == pytest.approx(MIDDLE * rig.top)
