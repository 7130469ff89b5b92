"""Film and effects together: order, slack, memory, frame, and what no effect leaves."""

import itertools

import numpy as np
import pytest

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.registry import materials
from bayesmembrane.physics.effects._history import growth
from bayesmembrane.physics.effects.base import FilmState
from bayesmembrane.physics.effects.friction import Friction
from bayesmembrane.physics.effects.machine_compliance import MachineCompliance
from bayesmembrane.physics.effects.permanent_set import PermanentSet
from bayesmembrane.physics.effects.tearing import Tearing
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics import Status, request, solve
from bayesmembrane.physics.reach import Reach
from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from tests.physics.effects.protocols import FILMS, RIG, force, measured, path, staircase, timeless, two_speeds, vector

FIRM = (-20.0, -20.0, 1.0)  # of a frame: log odds of the part that stays, ln of its play, the force that takes this up
RADII = {"inner_radius": RIG.inner_radius, "outer_radius": RIG.outer_radius}


def direct(material: str, d: np.ndarray, **options: float) -> np.ndarray:
    return solve(request(materials()[material], FILMS[material], d, **RADII, **options)).force[0]


@pytest.mark.parametrize("material", FILMS)
def test_without_effects_it_is_the_solver(material: str) -> None:
    m = measured(np.concatenate([staircase(), [0.0]]))
    h = hypothesis(material)
    f = Forward(h, m, m.deflection)
    assert f.composes
    p = f(vector(h), sensitivities=True)
    curves = solve(request(materials()[material], FILMS[material], m.deflection, sensitivities=True, **RADII))
    assert p.force == pytest.approx(curves.force, rel=1e-6)
    chained = np.einsum("bni,bik->bnk", curves.sensitivity, f.jacobian(vector(h)[None]))
    assert np.max(np.abs(p.sensitivity - chained) / np.max(np.abs(chained), axis=1, keepdims=True)) < 2e-4
    short = m.select(np.arange(40))
    assert not Forward(h, short, short.deflection).composes
    whole, few = (Forward(h, s, s.deflection)(vector(h)) for s in (m, short))
    assert few.convexity[0] == pytest.approx(whole.convexity[0], abs=0.02)


def test_the_order_of_naming_does_not_matter() -> None:
    names = ("mullins", "machine_compliance", "friction", "permanent_set", "zero_offset")
    m, forces = measured(), []
    for order in itertools.islice(itertools.permutations(names), 0, 120, 31):
        forces.append(force(m, *order))
    assert all(np.array_equal(f, forces[0]) for f in forces)


def test_prestretch_is_that_of_the_solver() -> None:
    m = measured()
    for stretch in (1.002, 1.03, 1.2):
        f = direct("yeoh", m.deflection, prestretch=stretch)
        assert np.max(np.abs(force(m, "prestretch", x=np.array([stretch])) - f)) < 1e-5 * np.max(f)


def test_a_shifted_zero_shifts_the_curve_and_a_slack_film_carries_nothing() -> None:
    m = measured()
    f = force(m, "zero_offset", x=np.array([2e-3]))
    assert np.all(f[m.deflection < 2e-3] == 0)
    taut = m.deflection > 2e-3
    assert f[taut] == pytest.approx(direct("yeoh", m.deflection[taut] - 2e-3), rel=1e-6, abs=1e-9)


def test_a_taut_film_pulls_back_below_its_plane_and_what_it_has_lost_does_not() -> None:
    """Against the solver, which knows both sides of the plane; with a frame, too."""
    m, c = measured(), 8e-4
    for shift in (2e-3, 0.7 * m.full_range):
        d = m.deflection - shift
        exact = np.sign(d) * direct("yeoh", np.abs(d), prestretch=1.05)
        f = force(m, "prestretch", "zero_offset", x=np.array([1.05, shift]))
        assert np.min(f) < -1e-3 * np.max(f)
        assert np.max(np.abs(f - exact)) < 1e-5 * np.max(exact)
    names = ("machine_compliance", "prestretch", "zero_offset")
    f = force(m, *names, x=np.array([c, 1.0, *FIRM, 1.05, 2e-3]))
    d = m.deflection - 2e-3 - c * f
    assert np.max(np.abs(f - np.sign(d) * direct("yeoh", np.abs(d), prestretch=1.05))) < 1e-5 * np.max(f)
    lost = [1e-3 if p.name == "set" else p.typical for p in PermanentSet.coordinates]
    f = force(m, "permanent_set", "prestretch", x=np.array([*lost, 1.05]))
    assert np.all(f >= 0)
    assert np.any(f[m.deflection > 0] == 0)


def test_a_set_is_the_same_on_both_sides_of_a_taut_film_and_pushes_no_less_on_a_block() -> None:
    """A film that is only lowered is one that is only lifted; a lost length moves a block by as much, either way."""
    given = {"set": 1e-3, "repeated": 0.0}  # being lowered is a second loading
    law, p = PermanentSet(), np.array([[given.get(c.name, c.typical) for c in PermanentSet.coordinates]])
    d = np.concatenate([np.linspace(0, 0.03, 61), np.linspace(0.03, -0.03, 121)[1:]])[None]
    up, down = law.deflect_taut(p, d, path(d[0])), law.deflect_taut(p, -d, path(d[0]))
    left = law.deflect(p, d, path(d[0]))
    assert np.array_equal(up, -down)
    assert np.array_equal(up[d >= 0], np.maximum(left, 0.0)[d >= 0])
    assert np.min(up) == pytest.approx(-np.max(up), rel=1e-3)
    assert np.any(left[d > 0] < 0)


def test_a_frame_with_play_takes_it_up_at_small_forces() -> None:
    """delta_film + C F + k C f (1 - exp(-F / f)) = delta."""
    m, c, small = measured(), 5e-4, 0.05
    f = force(m, "machine_compliance", x=np.array([c, 1.0, -20.0, np.log(20.0), small]))
    lost = c * f + 20.0 * c * small * (1 - np.exp(-f / small))
    assert f == pytest.approx(direct("yeoh", m.deflection - lost), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("exponent", [2 / 3, 1.0, 1.3])
def test_the_frame_takes_its_part(exponent: float) -> None:
    """delta_film + C F^n = delta, with a film force that is itself solved at delta_film; with memory too."""
    m, c = measured(), 8e-4
    f = force(m, "machine_compliance", x=np.array([c, exponent, *FIRM]))
    assert f == pytest.approx(direct("yeoh", m.deflection - c * f**exponent), rel=1e-6, abs=1e-9)
    names = ("machine_compliance", "mullins", "viscoelastic", "clamp_slip")
    h = hypothesis("yeoh", names)
    forward, x = Forward(h, m, m.deflection), vector(h)
    theta = x[None, 3:]
    law, _ = forward.law(h.films(x), theta)
    delta, total, _ = forward.composition.closed(law, theta)
    before = np.maximum.accumulate(np.append(0.0, total))[None, :-1]
    yielded, _ = MachineCompliance().yielding(MachineCompliance().typical[None], total, before)
    assert np.max(np.abs(delta + yielded - m.deflection)) < 1e-9 * m.full_range
    again, _ = forward.composition.film(law, theta, delta)
    assert again == pytest.approx(total, rel=1e-12)


@pytest.mark.parametrize(("measure", "tilt"), [(0.0, 0.0), (-2.0, 0.0), (0.0, 0.4), (-1.0, -0.3)])
def test_relaxation_is_the_convolution(measure: float, tilt: float) -> None:
    """Against direct quadrature of int (1 - G(t - s)) d(F / w^m)(s), with F / w^m linear between points."""
    d = staircase((0.03, 0.05), 15)
    rng = np.random.default_rng(3)
    time = np.cumsum(rng.uniform(0.2, 8.0, d.size))
    m = measured(d, time)
    g, tau, decades = 0.4, 12.0, 1.5
    f, pushed = (force(m, "viscoelastic", x=np.array([g, tau, decades, part, measure, tilt])) for part in (0.0, 1.0))
    clock, whole, weight = m.path.clock, direct("yeoh", d), (1 + d / np.max(d)) ** measure
    knots, values = np.concatenate([[0.0], clock]), np.concatenate([[0.0], whole / weight])
    times = tau * 10 ** (decades * np.linspace(-11 / 24, 11 / 24, 12))
    share = times**-tilt / np.sum(times**-tilt)
    fine = np.unique(np.concatenate([np.linspace(a, b, 400) for a, b in itertools.pairwise(knots)]))
    rate = np.diff(np.interp(fine, knots, values))
    middle = 0.5 * (fine[1:] + fine[:-1])
    for n in (0, 5, 20, d.size - 1):
        past = middle < clock[n]
        gone = 1 - np.exp(-(clock[n] - middle[past][:, None]) / times) @ share
        left = whole[n] - g * weight[n] * (gone @ rate[past])
        assert pushed[n] == pytest.approx(left, rel=1e-4, abs=1e-6)
        assert f[n] == pytest.approx(max(left, 0.0), rel=1e-4, abs=1e-6)


def test_a_softened_film_unloads_below_and_rejoins() -> None:
    m = measured(staircase((0.03, 0.03, 0.05)))
    f, plain = force(m, "mullins", x=np.array([0.2, 0.5, 1.0, 2.0, 0.0, 0.0])), force(m)
    first, again, third = (m.cycle == i for i in (1, 2, 3))
    up, down = m.leg > 0, m.leg < 0
    assert f[first & up] == pytest.approx(plain[first & up], rel=1e-12)
    inside = first & down & (m.deflection < 0.028) & (m.deflection > 2e-3)
    assert np.all(f[inside] < 0.99 * plain[inside])
    back = np.interp(m.deflection[again & up], m.deflection[first & down][::-1], f[first & down][::-1])
    middle = (m.deflection[again & up] > 5e-3) & (m.deflection[again & up] < 0.027)
    assert f[again & up][middle] == pytest.approx(back[middle], rel=0.02)
    beyond = third & up & (m.deflection >= 0.03)
    assert f[beyond] == pytest.approx(plain[beyond], rel=1e-12)


def test_damage_that_is_repeated_goes_on_with_the_way_of_the_energy() -> None:
    """(1 - exp(-[(1 - c) M + c A] / w)) / (1 - exp(-1 / w)) by sums over the path; beyond 1 what is kept falls off."""
    m = measured(staircase((0.03, 0.03, 0.05), 15))
    softening, width, power, part = 0.2, 0.8, 2.0, 0.4
    kept = force(m, "mullins", x=np.array([softening, width, 1.0, power, 1.0, part])) / force(m)
    way = (np.append(0.0, m.path.deflection) / m.full_range) ** power
    energy = np.cumsum(np.abs(np.diff(way)))[m.on_path]
    most = np.maximum.accumulate(way)[1:][m.on_path]
    told = np.expm1(-((1 - part) * most + part * energy) / width) / np.expm1(-1 / width)
    beyond = (1 - softening) * np.exp(-softening / (1 - softening) * (told - 1))
    assert np.min(told) < 1 < np.max(told)
    assert kept == pytest.approx(np.where(told < 1, 1 - softening * told, beyond), rel=1e-6)
    first, again = (m.cycle == i for i in (1, 2))
    assert np.max(kept[again]) < np.min(kept[first & (m.leg > 0)])


@pytest.mark.parametrize("noise", [1e-5, 1e-4])
def test_a_hold_is_no_damage_where_the_encoder_trembles(noise: float) -> None:
    rng = np.random.default_rng(5)
    d = np.append(np.linspace(0.001, 0.05, 60), 0.05 + noise * 0.05 * rng.standard_normal(2000))
    m = measured(d, np.arange(d.size) + 1.0)
    kept = force(m, "mullins", x=np.array([0.3, 1.0, 1.0, 2.0, 1.0, 0.5])) / force(m)
    assert np.min(kept[60:]) > kept[59] - 2e-3


def test_continuum_damage_softens_first_loading_too_and_is_the_same_wherever_the_film_is() -> None:
    """F / F0 is a function of the largest deflection alone."""
    m = measured(staircase((0.03, 0.03, 0.05)))
    part = force(m, "mullins", x=np.array([0.2, 0.5, 1.0, 2.0, 1.0, 0.0])) / force(m)
    most = np.maximum.accumulate(m.deflection) / m.full_range
    lost = np.expm1(-(most**2) / 0.5) / np.expm1(-1 / 0.5)
    pulled = m.deflection > 2e-3
    assert part[pulled] == pytest.approx(1 - 0.2 * lost[pulled], rel=1e-5)


@pytest.mark.parametrize("name", ["clamp_slip", "permanent_set", "tearing"])
def test_what_grows_never_shrinks(name: str) -> None:
    """At the same deflection on loading the force falls from cycle to cycle, or stays."""
    m = measured(staircase((0.02, 0.02, 0.04, 0.04, 0.06), 400))
    f = force(m, name)
    d = 0.015
    loading = [np.interp(d, m.deflection[c], f[c]) for c in ((m.cycle == i) & (m.leg > 0) for i in range(1, 6))]
    assert np.all(np.diff(loading) < 1e-5 * max(loading))
    assert loading[-1] < 0.99 * loading[0]


def test_a_clamp_that_slips_at_once_does_so_at_its_place_and_stays() -> None:
    """As one that sticks until then: nothing before that deflection is reached for the first time."""
    m = measured(staircase((0.02, 0.06, 0.02), 400))
    f, plain = force(m, "clamp_slip", x=np.array([0.03, 2.0, 0.0, 0.0, 1.0, 0.5, 0.5, 0.0, 0.5, 0.015, 0.0])), force(m)
    first, last = m.cycle == 1, m.cycle == 3
    over = (m.cycle == 2) & (m.leg > 0) & (m.deflection > 0.034)
    assert f[first] == pytest.approx(plain[first], rel=1e-2)
    assert np.all(f[over] < 0.98 * plain[over])
    well = last & (m.deflection > 0.012)
    assert np.all(f[well] < 0.98 * plain[well])


def test_a_tear_runs_at_its_moment_in_a_hold_too_and_comes_to_rest() -> None:
    """Half a minute up, a minute of hold, half a minute down; from 50 s on a tenth is lost, within some seconds."""
    time = np.arange(1.0, 121.0)
    d = np.interp(time, [0, 30, 90, 120], [0, 0.06, 0.06, 0])
    m = measured(d, time)
    whole, plain = float(m.path.clock[-1]), force(m)
    torn = Tearing().on(Reach(0.06, 1.0, whole))
    clock = m.path.clock
    p = np.array([[0.1, 2.0, 0.0, 0.0, 1.0, 50.0, 3.0, 0.5, 0.0, 0.0]])
    f = torn.carried(p, plain[None], FilmState(m.path, d[None], plain[None], plain[None]))[0]
    assert f[clock <= 50] == pytest.approx(plain[clock <= 50])
    assert f[clock > 50] == pytest.approx(plain[clock > 50] * np.exp(-0.1 * -np.expm1(-(clock[clock > 50] - 50) / 3)))
    moment = next(c for c in torn.coordinates if c.name == "moment")
    assert moment.bounds == (0.0, pytest.approx(whole))


def test_what_creeps_grows_in_a_hold_and_on_a_first_loading_like_what_does_not() -> None:
    a, c = np.array([[0.5], [2.0], [4.0]]), np.array([[0.4], [1.0], [1.0]])
    time = np.concatenate([np.linspace(1, 40, 40), np.linspace(41, 100, 60)])
    d = np.interp(time, [0, 40], [0, 0.06])
    held = Motion(d, time, 0.06)
    crept, not_crept = (growth(a, c, np.tile(d, (3, 1)), held, 0.0, np.full((3, 1), q)) for q in (1.0, 0.0))
    assert held.pace == pytest.approx(0.06 / 40)
    assert crept[:, :40] == pytest.approx(not_crept[:, :40], rel=1e-6)
    # In the hold (x / D)^a is one: it goes on by (a + 1) c v t / D.
    assert crept[:, -1] - 1.0 == pytest.approx(((a + 1) * c)[:, 0] * 60 / 40, rel=1e-6)
    assert not_crept[:, -1] == pytest.approx(1.0)


def test_slip_of_a_longer_film_is_a_film_of_that_length() -> None:
    """A film with excess length and one without have the same stretch at deflections that belong together."""
    h = hypothesis("yeoh", ["clamp_slip"])
    m = measured()
    f = Forward(h, m, m.deflection)
    law, _ = f.law(h.films(vector(h)), vector(h)[None, 3:])
    d, e = np.linspace(0.001, 0.05, 60)[None, :], np.full((1, 60), 0.03)
    force_e, slope_e = law(d, e)
    length = RIG.outer_radius - RIG.inner_radius
    q = (length**2 + d**2) / 1.03**2 - length**2
    taut = q > 0
    root = np.sqrt(np.where(taut, q, 1.0))
    expected = np.where(taut, law(root)[0] * d / root / 1.03, 0.0)
    assert force_e == pytest.approx(expected, rel=1e-9, abs=1e-15)
    assert np.gradient(force_e[0], d[0])[20:-1] == pytest.approx(slope_e[0, 20:-1], rel=0.02)


def test_friction_changes_sign_at_each_turn() -> None:
    m = measured()
    extra = force(m, "friction", x=np.array([0.02, 1e-4, 2e3, 1.0, 0.0])) - force(m)
    settled = np.abs(np.gradient(m.leg)) == 0
    assert extra[settled & (m.leg > 0)][3:] == pytest.approx(0.02, rel=0.01)
    assert extra[settled & (m.leg < 0)] == pytest.approx(-0.02, rel=0.01)


@pytest.mark.parametrize("load", [0.5, 1.0, 2.0])
def test_a_guide_rubs_the_more_the_larger_the_force_is(load: float) -> None:
    m = measured()
    plain = force(m)
    x = np.array([0.02, 1e-4, 0.7, load, 0.0])
    level, more = (force(m, "friction", x=np.where(np.arange(5) == 2, f, x)) - plain for f in (2e3, 0.7))
    assert more / level == pytest.approx((1 + (plain / 0.7) ** load) / (1 + (plain / 2e3) ** load), rel=1e-6)


def test_a_dry_guide_rubs_more_where_it_is_slower_and_at_rest_as_before() -> None:
    """At a tenth of the speed 10^0.2 times as much; what the last motion left stays in a hold."""
    x = np.linspace(0.0, 0.03, 61)
    d = np.concatenate([x, np.full(20, x[-1]), x[-2::-1]])
    t = np.cumsum(np.concatenate([np.full(81, 1.0), np.full(60, 10.0)]))
    p = np.array([[0.02, 1e-4, 2e3, 1.0, 0.2]])
    found = Friction().read(p, np.zeros((1, d.size)), Motion(d, t, 0.03))[0]
    assert found[10:81] == pytest.approx(0.02, rel=1e-6)
    assert found[100:] == pytest.approx(-0.02 * 10**0.2, rel=1e-6)


def test_a_drift_comes_to_rest() -> None:
    m = measured()
    t = m.path.clock
    first = t[np.argmax(np.diff(m.path.leg) != 0)]
    one_way = (np.array([1e-3, 1.0, rest, 0.0, 35.0, 0.3]) for rest in (1e7, 50.0))
    steady, soon = (force(m, "force_drift", x=x) - force(m) for x in one_way)
    assert steady == pytest.approx(1e-3 * t, rel=1e-3, abs=1e-9)
    assert soon == pytest.approx(1e-3 * t * (50.0 + first) / (50.0 + t), rel=1e-6, abs=1e-12)


def test_a_drift_swings_back() -> None:
    m = measured()
    t = m.path.clock
    period = t[-1] / 1.5
    swung = force(m, "force_drift", x=np.array([1e-3, 1.0, 1e7, 1.0, period, 0.25])) - force(m)
    assert swung == pytest.approx(1e-3 * period / 4 * (np.cos(2 * np.pi * t / period) - 1), rel=1e-9, abs=1e-12)
    once = force(m, "force_drift", x=np.array([1e-3, 1.0, 1e7, 0.0, period, 0.25])) - force(m)
    half = force(m, "force_drift", x=np.array([1e-3, 1.0, 1e7, np.sqrt(0.5), period, 0.25])) - force(m)
    assert half == pytest.approx((swung + once) / 2, rel=1e-9, abs=1e-12)


def test_speed_counts_as_a_power_far_above_the_slow_one() -> None:
    m = measured()
    ratio = force(m, "rate", x=np.array([0.1, -14.0, 0.0, 0.0])) / force(m)
    fast = m.path.clock > m.path.clock[m.deflection.size // 2 + 8]
    slow = m.path.clock < m.path.clock[m.deflection.size // 2 - 8]
    assert np.median(ratio[fast]) / np.median(ratio[slow]) == pytest.approx(5**0.1, rel=1e-3)


def test_what_resists_the_motion_is_gone_at_rest_and_changes_its_sign_on_the_way_back() -> None:
    """A viscosity, far below the slow speed: a loop that is as much wider as the disc is faster, none at rest."""
    way = np.concatenate([np.linspace(0.001, 0.02, 30), np.full(20, 0.02), np.linspace(0.0195, 0.002, 30)])
    at = np.concatenate([np.arange(30.0), 30 + np.arange(20.0), 50 + 0.5 * np.arange(30)])
    m = measured(way, at)
    viscous = np.array([0.4, 2.0, 1.0, 1.0])
    extra = force(m, "rate", x=viscous) * (1 + np.exp(-2.0)) ** 0.4 / force(m) - 1
    up, rest, back = slice(5, 25), slice(31, 50), slice(55, 78)
    assert extra[rest] == pytest.approx(0.0, abs=1e-12)
    assert np.all(extra[up] > 0)
    assert extra[up] * way[up] == pytest.approx(np.mean(extra[up] * way[up]), rel=1e-3)
    pushed, pulled = np.mean(extra[up] * way[up]), -np.mean(extra[back] * way[back])
    speeds = [0.019 / 29, 2 * 0.0175 / 29]
    assert pulled / pushed == pytest.approx(speeds[1] / speeds[0], rel=0.05)


def test_without_times_travel_is_the_clock() -> None:
    m = timeless(measured())
    assert m.path.clock == pytest.approx(np.cumsum(np.abs(np.diff(m.deflection, prepend=0.0))) / 1e-3)
    at_1mm_s = measured(m.deflection, np.cumsum(np.abs(np.diff(m.deflection, prepend=0.0))) / 1e-3)
    for name in ("viscoelastic", "force_drift"):
        assert force(m, name) == pytest.approx(force(at_1mm_s, name), rel=1e-9)
    with pytest.raises(SettingsError, match="needs times"):
        force(m, "rate")


def test_odd_protocols_are_fine() -> None:
    """Legs of one point, deflections that repeat, a single point, holds, uneven times."""
    names = ("mullins", "viscoelastic", "rate", "friction", "clamp_slip", "permanent_set", "machine_compliance")
    d = np.array([0.01, 0.03, 0.02, 0.03, 0.03, 0.03, 0.001, 0.04, 0.04])
    time = np.array([1.0, 2.0, 2.1, 30.0, 31.0, 90.0, 91.0, 91.5, 400.0])
    assert np.isfinite(force(measured(d, time), *names)).all()
    held = force(measured(d, time), "viscoelastic")
    assert held[5] < held[4] < held[3]
    one = Measurement(np.array([0.02]), np.array([1.0]), RIG, Specimen("film", 5e-5), time=np.array([3.0]))
    assert np.isfinite(force(one, *names)).all()


def test_a_film_that_locks_says_so_and_the_others_are_used() -> None:
    m = measured()
    h = hypothesis("gent", ["mullins", "zero_offset"])
    x = np.tile(vector(h), (3, 1))
    x[1, :2] = materials()["gent"].to_coordinates([5.3, 2.0])
    p = Forward(h, m, m.deflection)(x, sensitivities=True)
    assert p.ok.tolist() == [True, False, True]
    assert np.isnan(p.force[1, np.argmax(m.deflection)])
    assert Status(int(p.status[1, np.argmax(m.deflection)])).physical
    assert p.force[0] == pytest.approx(p.force[2], rel=1e-12)
    assert np.all(np.isfinite(p.sensitivity[0]))


def test_a_frame_that_yields_keeps_a_film_from_locking() -> None:
    m = measured(staircase((0.02, 0.04)))
    h = hypothesis("gent", ["machine_compliance"])
    limits = np.linspace(0.5, 4.0, 101)
    every = solve(request(materials()["gent"], np.stack([np.full(101, 5.3), limits], 1), [0.04], **RADII))
    limit = limits[np.argmax(every.ok[:, 0]) - 1]
    film = materials()["gent"].to_coordinates([5.3, limit])
    stiff, soft = (Forward(h, m, m.deflection)([*film, c, 1.0, *FIRM]) for c in (0.0, 2e-4))
    assert not stiff.ok[0]
    assert soft.ok[0]
    delta = m.deflection - 2e-4 * soft.force[0]
    alone = solve(request(materials()["gent"], [5.3, limit], delta, **RADII)).force[0]
    assert soft.force[0] == pytest.approx(alone, rel=1e-5)


def test_many_draws_are_worked_off_in_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    m, h = measured(), hypothesis("mooney_rivlin", ["zero_offset", "mullins"])
    x = vector(h) + np.zeros((7, 1))
    x[:, 0] += np.linspace(0, 1, 7)
    f = Forward(h, m, m.deflection)
    whole = f(x, sensitivities=True)
    monkeypatch.setattr("bayesmembrane.physics.forward.COMPOSED", 20 * len(m))
    parts = f(x, sensitivities=True)
    assert parts.force == pytest.approx(whole.force, rel=1e-12)
    assert parts.sensitivity == pytest.approx(whole.sensitivity, rel=1e-9, abs=1e-12)
    assert parts.convexity == pytest.approx(whole.convexity)


def test_other_deflections_are_a_path_of_their_own() -> None:
    """A grid up to the end is a first loading at the speed of the measurement."""
    m, h = measured(), hypothesis("yeoh", ["mullins", "viscoelastic"])
    grid = np.linspace(0.0, 0.06, 31)
    found = Forward(h, m, grid)(vector(h)).force[0]
    speed = float(np.median(m.path.speed))
    loading = measured(grid[1:], grid[1:] / speed)
    assert found[1:] == pytest.approx(force(loading, "mullins", "viscoelastic"), rel=1e-6)


@pytest.mark.parametrize("name", ["zero_offset", "mullins", "viscoelastic", "clamp_slip", "machine_compliance"])
def test_effects_occur_on_strips(name: str) -> None:
    rig = Uniaxial()
    d = staircase((0.05, 0.1, 0.1), 20)
    m = Measurement(d, d, rig, Specimen("strip", 1e-3), time=two_speeds(d))
    f = Forward(hypothesis("yeoh", [name]), m, d)
    p = f(vector(f.hypothesis), sensitivities=True)
    plain = Forward(hypothesis("yeoh"), m, d)(vector(hypothesis("yeoh")))
    assert np.all(p.ok)
    assert np.max(np.abs(p.force - plain.force)) > 1e-3 * np.max(plain.force)
    null = f(vector(f.hypothesis, "null"))
    assert np.array_equal(null.force, plain.force)


def test_an_effect_of_another_rig_is_refused() -> None:
    m = Measurement(np.array([0.01, 0.02]), np.array([1.0, 2.0]), Uniaxial(), Specimen("strip", 1e-3))
    with pytest.raises(SettingsError, match='"prestretch" does not occur on the rig "uniaxial"'):
        Forward(hypothesis("yeoh", ["prestretch"]), m, m.deflection)(vector(hypothesis("yeoh", ["prestretch"])))


def test_growth_is_the_same_function_of_path_for_any_sampling() -> None:
    coarse, fine = staircase((0.03, 0.03, 0.06), 11), staircase((0.03, 0.03, 0.06), 201)
    a, c = np.array([[0.5], [2.0], [4.0]]), np.array([[0.0], [0.3], [1.0]])
    ends = [growth(a, c, np.tile(d, (3, 1)), path(d))[:, -1] for d in (coarse, fine)]
    assert ends[0] == pytest.approx(ends[1], rel=2e-3)
    once = np.linspace(0, 0.06, 50)
    assert growth(a, c, np.tile(once, (3, 1)), path(once))[:, -1] == pytest.approx(1.0)
    assert np.all(np.diff(growth(a, c, np.tile(fine, (3, 1)), path(fine)), axis=1) >= 0)
