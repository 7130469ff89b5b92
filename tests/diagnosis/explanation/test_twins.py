"""Effects that a test cannot tell apart: which they are, and that no shape of a law chooses between them."""

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.diagnosis.candidates.speeds import one_speed
from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS
from bayesmembrane.diagnosis.explanation.twins import Near, Stands, levelled, swapped, twins, twins_one_way
from bayesmembrane.diagnosis.joint.case import JointCase
from bayesmembrane.diagnosis.joint.effects import effects_in_tests
from bayesmembrane.diagnosis.thresholds import TWINS
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.annulus import Annulus

A, B, C, D = (frozenset(names) for names in (["a"], ["b"], ["a", "c"], ["b", "c"]))
PAIRS = {frozenset(("a", "b")): Near(0.05, behind=8.0)}
UP = np.linspace(0.0, 0.03, 31)
LEG = np.concatenate([UP, UP[-2::-1]])
SHORT_OF_HALF = LEG[:44]


def curve(deflection: np.ndarray, time: np.ndarray | None) -> Measurement:
    return Measurement(deflection, 1 + deflection, Annulus(0.010, 0.035), Specimen("film", 5e-5), time=time)


def odds(weights: dict[frozenset[str], float], left: dict[frozenset[str], float]) -> dict[frozenset[str], float]:
    raised = levelled(weights, {names: Stands(part) for names, part in left.items()}, PAIRS)
    return {names: weights[names] + raised[names] for names in weights}


def test_a_twin_is_at_most_so_many_times_less_probable() -> None:
    weights, left = {A: 0.0, B: -60.0, C: -2.0, D: -3.0}, {A: 0.01, B: 0.02, C: 0.0, D: 0.0}
    found = odds(weights, left)
    assert found[A] - found[B] == pytest.approx(np.log(BELIEFS.apart))
    assert (found[A], found[C], found[D]) == (0.0, -2.0, -3.0)  # who is near enough stays


@pytest.mark.parametrize(("left", "told"), [(0.02, 0.0 - np.log(BELIEFS.apart)), (0.2, -60.0)])
def test_a_twin_beside_its_twin_may_be_an_error_of_its_law(left: float, told: float) -> None:
    both = A | B
    found = odds({A: -60.0, both: 0.0}, {A: left, both: 0.0})
    assert found[A] == pytest.approx(told)
    assert odds({A: 0.0, both: -60.0}, {A: 0.0, both: 0.0})[both] == -60.0  # and not the other way about


@pytest.mark.parametrize(("behind", "told"), [(11.0, 0.0 - np.log(BELIEFS.apart)), (13.0, -60.0)])
def test_an_error_of_a_law_is_never_far_behind(behind: float, told: float) -> None:
    """Not even where twins stand alike however far they are behind each other."""
    pairs, both = {A | B: Near(0.25)}, A | B
    stands = {A: Stands(0.02, -100.0 - behind), both: Stands(0.0, -100.0)}
    weights = {A: -60.0, both: 0.0}
    assert weights[A] + levelled(weights, stands, pairs)[A] == pytest.approx(told)


def test_a_twin_that_leaves_much_more_is_told_apart() -> None:
    found = odds({A: 0.0, B: -60.0}, {A: 0.01, B: 0.07})
    assert found[B] == -60.0


@pytest.mark.parametrize(("behind", "told"), [(7.9, 0.0 - np.log(BELIEFS.apart)), (8.1, -60.0)])
def test_a_twin_that_is_far_behind_is_told_apart(behind: float, told: float) -> None:
    weights, stands = {A: 0.0, B: -60.0}, {A: Stands(0.01, -100.0), B: Stands(0.01, -100.0 - behind)}
    assert weights[B] + levelled(weights, stands, PAIRS)[B] == pytest.approx(told)


@pytest.mark.parametrize(("left", "told"), [(0.02, 0.0 - np.log(BELIEFS.apart)), (1.0, -60.0)])
def test_an_implausible_set_raises_a_twin_that_leaves_as_little_and_no_other(left: float, told: float) -> None:
    weights, stands = {A: 0.0, B: -60.0}, {A: Stands(0.01, plausible=False), B: Stands(left)}
    assert weights[B] + levelled(weights, stands, PAIRS)[B] == pytest.approx(told)


def test_a_set_that_is_implausible_itself_is_not_raised() -> None:
    weights, stands = {A: 0.0, B: -60.0}, {A: Stands(0.01, plausible=False), B: Stands(0.01, plausible=False)}
    assert levelled(weights, stands, PAIRS)[B] == 0.0


def test_levels_are_those_of_a_first_look_whoever_is_raised() -> None:
    """b is raised by a, and c by b as it was: no chain of twins lifts what nobody near has."""
    pairs = {frozenset(("a", "b")): Near(0.05), frozenset(("b", "c")): Near(0.05)}
    weights = {A: 0.0, B: -60.0, frozenset(["c"]): -90.0}
    raised = levelled(weights, dict.fromkeys(weights, Stands(0.0)), pairs)
    assert weights[frozenset(["c"])] + raised[frozenset(["c"])] == pytest.approx(-60.0 - np.log(BELIEFS.apart))


def test_loops_losses_and_longer_films_of_whatever_law_are_twins_whatever_the_motion() -> None:
    every = [cls() for cls in components("effects").values()]
    alike = (("friction", "hysteresis"), ("mullins", "tearing"), ("clamp_slip", "permanent_set"))
    alike += (("rate", "friction"), ("rate", "hysteresis"))
    found = twins(every, ())
    assert set(found) == {frozenset(pair) for pair in alike}
    # Of loops no shape is sure: what is no more than a little behind is alike, whatever it leaves.
    loose = [pair for pair, near in found.items() if near.left == np.inf and near.behind > TWINS.behind]
    assert loose == [frozenset({"friction", "hysteresis"})]
    assert not twins([e for e in every if e.name not in ("friction", "mullins", "clamp_slip", "rate")], ())


def test_sets_differ_by_one_twin() -> None:
    assert list(swapped(C, PAIRS)) == [("a", "b", D)]
    assert list(swapped(frozenset(["a", "b"]), PAIRS)) == []
    assert list(swapped(frozenset(["c"]), PAIRS)) == []


def test_one_speed_is_one_speed_until_a_leg_is_faster_or_the_disc_stands() -> None:
    even = np.arange(LEG.size, dtype=float)
    assert one_speed(curve(LEG, even))
    assert one_speed(curve(LEG, None))
    faster = np.where(even < 31, even, 30 + 0.1 * (even - 30))
    assert not one_speed(curve(LEG, faster))
    on_the_way = np.where(even < 15, even, 14 + 0.1 * (even - 14))
    assert not one_speed(curve(UP, on_the_way[: UP.size]))
    gently = np.concatenate([np.linspace(0.5, 1, 5), np.ones(20), np.linspace(1, 0.5, 6)])
    assert one_speed(curve(UP, np.cumsum(1 / gently)))
    still = np.insert(LEG, 31, np.full(20, LEG[30]))
    assert not one_speed(curve(still, np.arange(still.size, dtype=float)))


def test_of_several_tests_each_counts_by_how_much_of_its_range_it_goes_through() -> None:
    even = np.arange(LEG.size, dtype=float)
    assert one_speed(curve(LEG, even), curve(2 * LEG, even))
    assert not one_speed(curve(LEG, even), curve(LEG, 0.2 * even))
    assert one_speed(curve(LEG, even), curve(LEG, None))


@pytest.mark.parametrize("name", sorted(components("effects")))
def test_effects_that_do_not_remember_are_alike_on_every_leg(name: str) -> None:
    """And those that say they do, are not; a frame that is seated already."""
    claim = hypothesis("neo_hookean", [name])
    effect = claim.effects[0]
    slow_fast = np.cumsum(np.where(np.arange(4 * 31 - 3) < 60, 1.0, 0.1))
    m = curve(np.concatenate([LEG, LEG[1:]]), slow_fast)
    sizes = np.array([0.5 * p.typical if p.null is None else p.null + 0.5 * p.scale for p in effect.coordinates])
    sizes[[p.name == "log_odds_seated" for p in effect.coordinates]] = -np.inf
    x = np.concatenate([np.log([10.0]), np.clip(sizes, *zip(*((p.bounds) for p in effect.coordinates), strict=True))])
    force = Forward(claim, m, m.deflection)(x[None, :]).force[0]
    legs = force[:31], force[30:61][::-1], force[60:91], force[90:][::-1]
    alike = all(leg == pytest.approx(legs[0], rel=1e-8, abs=1e-12) for leg in legs)
    assert alike is not effect.remembers


@pytest.mark.parametrize("way", [UP, LEG, SHORT_OF_HALF])
def test_what_only_the_way_back_tells_apart_are_twins_where_there_is_none(way: np.ndarray) -> None:
    effects = [components("effects")[n]() for n in ("tearing", "clamp_slip", "mullins")]
    found = set(twins_one_way(effects, curve(way, None)))
    assert found == (set() if way is LEG else {frozenset(("tearing", "clamp_slip"))})
    assert not twins_one_way(effects[:1], curve(way, None))  # the other one cannot be at work
    guide = [components("effects")[n]() for n in ("friction", "force_offset")]
    assert bool(twins_one_way(guide, curve(way, None))) is (way is not LEG)


def test_twins_by_nature_are_twins_in_joint_answers_where_both_are_at_work() -> None:
    """Of the material in all tests and of a rig in one: with the tests' names."""
    known = components("effects")
    each = [{n: known[n]() for n in own} for own in (("friction", "hysteresis", "mullins", "tearing"),) * 2]
    alone = [SimpleNamespace(effects=tuple(own.values()), measurement=curve(LEG, None)) for own in each]
    every = effects_in_tests(each, ("a", "b"))
    case = SimpleNamespace(effects=every, signatures=(), alone=alone)
    found = {tuple(sorted(pair)) for pair in JointCase.twins(cast(JointCase, case))}
    rig = {u.name for u in every if "@" in u.name}
    assert {("friction@a", "hysteresis"), ("friction@b", "hysteresis")} <= found
    assert {p for p in found if p[0] in rig and p[1] in rig and p[0][-1] != p[1][-1]} == set()
