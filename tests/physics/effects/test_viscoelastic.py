"""Relaxation that stress quickens: a flow of the network."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from bayesmembrane.physics.effects._flow import USUAL, flowing
from bayesmembrane.physics.effects._history import relaxing
from bayesmembrane.physics.effects.viscoelastic import TERMS, Viscoelastic
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.reach import Reach, reach_of
from tests.physics.effects.protocols import measured, path, vector


def spectrum(middle: float, decades: float) -> np.ndarray:
    return middle * 10 ** (decades * ((np.arange(TERMS) + 0.5) / TERMS - 0.5))


TIMES = spectrum(15.0, 1.5)
EVEN = np.full(TERMS, 1 / TERMS)


def two_loadings(points: int = 40, wait: int = 6, seconds: float = 60.0) -> tuple[np.ndarray, np.ndarray]:
    """Up to 50 mm, held there, down and up again; (N,) deflections in m, and times in s."""
    up = np.linspace(0.0, 0.05, points + 1)
    d = np.concatenate([up[1:], np.full(wait, 0.05), up[-2::-1], up[1:]])
    return d, np.cumsum(np.where(np.diff(d, prepend=0.0) == 0, 10.0, seconds / points))


def stiffening(d: np.ndarray) -> np.ndarray:
    x = d / np.max(d)
    return 0.3 * x + x**3


def integrated(stress: np.ndarray, time: np.ndarray, flow) -> np.ndarray:  # type: ignore[no-untyped-def]
    """(N,) what is left of a ``stress`` (N,) that moves evenly between times, h' = stress' - flow(h)."""
    h, left = np.zeros(TERMS), []
    for (before, value), (begin, end) in zip(
        itertools.pairwise(np.append(0.0, stress)), itertools.pairwise(np.append(0.0, time)), strict=True
    ):
        rate = (value - before) / (end - begin)
        run = solve_ivp(lambda _, h, r=rate: r - flow(h), (0, end - begin), h, "LSODA", rtol=1e-8, atol=1e-10)
        h = run.y[:, -1]
        left.append(h @ EVEN)
    return np.array(left)


@pytest.mark.parametrize("points", [12, 60])
@pytest.mark.parametrize("quickens", [3.0, 12.0, 30.0])
def test_a_flow_equals_an_integrator_with_error_control(points: int, quickens: float) -> None:
    d, time = two_loadings(points)
    stress = stiffening(d)
    exact = integrated(stress, time, lambda h: h / TIMES * np.exp(quickens * (abs(h @ EVEN) - USUAL)))
    found = flowing(stress[None], path(d, time), TIMES[None], EVEN[None], np.array([quickens]))[0]
    assert found == pytest.approx(exact, abs=0.015 * np.max(np.abs(exact)))
    assert np.sqrt(np.mean((found - exact) ** 2)) < 0.004 * np.max(np.abs(exact))


@pytest.mark.parametrize("decades", [1.5, 7.0])
def test_one_that_stress_hardly_quickens_is_linear(decades: float) -> None:
    """To less than a step of a difference moves it: times from far above to far below a gap, too."""
    d, time = two_loadings()
    stress, way, times = stiffening(d)[None], path(d, time), spectrum(2.0, decades)[None]
    linear = relaxing(stress, np.diff(way.clock, prepend=0.0), times, EVEN[None])
    assert flowing(stress, way, times, EVEN[None], np.zeros(1)) == pytest.approx(linear, abs=1e-11)
    assert flowing(stress, way, times, EVEN[None], np.full(1, 1e-7)) == pytest.approx(linear, abs=1e-7)


@pytest.mark.parametrize("names", [["viscoelastic"], ["viscoelastic", "machine_compliance"]])
def test_slopes_where_nothing_quickens_are_differences(names: list[str]) -> None:
    """Searches begin there: films beside each other may flow and not."""
    d, time = two_loadings(20)
    m = measured(d + 1e-4, time)
    h = hypothesis("yeoh", names).on(m)
    f, x = Forward(h, m, m.deflection), vector(h)
    place = {p.name: i for i, p in enumerate(h.parameters)}
    x[place["viscoelastic.time"]], x[place["viscoelastic.decades"]] = 1.0, 5.0
    x[place["viscoelastic.quickens"]] = 0.0
    slopes = f(x, sensitivities=True).sensitivity
    assert slopes is not None
    for name in ("viscoelastic.strength", "viscoelastic.time", "viscoelastic.measure"):
        step = np.zeros(x.size)
        step[place[name]] = 1e-4
        central = (f(x + step).force - f(x - step).force)[0] / 2e-4
        assert slopes[0, :, place[name]] == pytest.approx(central, abs=2e-3 * np.max(np.abs(central)))


@pytest.mark.parametrize("creep", [0.0, 1e-9, 1e-6])
def test_a_wait_is_one_where_the_encoder_still_moves(creep: float) -> None:
    """Read seldom, so that most of it is gone by the first reading; the disc goes on by a little."""
    up, rest = np.linspace(0.0, 0.05, 41)[1:], 0.05 + creep * np.arange(1, 7)
    d, time = np.append(up, rest), np.append(np.arange(1, 41) * 0.5, 20 + 60.0 * np.arange(1, 7))
    stress = stiffening(np.minimum(d, 0.05))
    exact = integrated(stress, time, lambda h: h / TIMES * np.exp(20 * (abs(h @ EVEN) - USUAL)))
    found = flowing(stress[None], path(d, time), TIMES[None], EVEN[None], np.array([20.0]))[0]
    assert found == pytest.approx(exact, abs=0.01 * np.max(np.abs(exact)))


@pytest.mark.parametrize("measure", [-4.0, 2.0])
def test_stress_counts_in_parts_of_the_largest_whatever_its_measure(measure: float) -> None:
    d, time = two_loadings()
    law, weight = Viscoelastic(reach=Reach(0.05, 2.0, 100.0)), 1 + d / 0.05
    force = 2.0 * stiffening(d) / 1.3
    x = np.array([[0.5, 15.0, 1.5, 1.0, measure, 0.0, 10.0]])
    scaled = force / weight**measure * 2**measure / 2.0
    left = integrated(scaled, time, lambda h: h / TIMES * np.exp(10 * (abs(h @ EVEN) - USUAL)))
    expected = force - 0.5 * (force - 2.0 * (weight / 2) ** measure * left)
    assert law.remember(x, force[None], path(d, time))[0] == pytest.approx(expected, abs=0.004 * np.max(force))


def test_a_part_of_a_test_knows_the_largest_force_of_all_of_it() -> None:
    """Cycles that are held out are foretold by the model that was fitted."""
    m = measured()
    part = m.select(m.cycle == 1)
    assert np.max(part.force) < np.max(m.force)
    assert reach_of(part).whole_force == np.max(m.force)


def test_films_side_by_side_equal_films_alone() -> None:
    d, time = two_loadings()
    way, force = path(d, time), stiffening(d)
    p = np.repeat(Viscoelastic().typical[None], 3, axis=0)
    p[:, 6] = 0.0, 5.0, 20.0
    together = Viscoelastic().remember(p, np.repeat(force[None], 3, axis=0), way)
    alone = [Viscoelastic().remember(row[None], force[None], way)[0] for row in p]
    assert together == pytest.approx(np.array(alone), rel=1e-9)


def test_loops_of_a_flow_depend_less_on_speed() -> None:
    """Twenty times slower a loop of what relaxes linearly closes by two thirds; that of a flow by one."""

    def width(quickens: float, seconds: float) -> float:
        d, time = two_loadings(wait=0, seconds=seconds)
        p = Viscoelastic().typical[None].copy()
        p[0, 1], p[0, 2], p[0, 6] = 5.0, 0.0, quickens
        kept = Viscoelastic().remember(p, stiffening(d)[None], path(d, time))[0]
        up, down = kept[:40], kept[40:80][::-1]
        return float(np.mean(up[1:] - down[:-1]))

    linear, flow = (width(q, 400.0) / width(q, 20.0) for q in (0.0, 30.0))
    assert linear < 0.6 * flow


def test_a_flow_with_a_power_of_the_stress_is_followed() -> None:
    """A Maxwell element whose rate of flow is the fourth power of its stress, which is not the law's own form."""
    d, time = two_loadings(60)
    stress, way = stiffening(d), path(d, time)
    element = integrated(stress, time, lambda h: np.sign(h) * 0.5 * (np.abs(h) / 0.2) ** 4)
    measured = stress - 0.3 * (stress - element)

    def misfit(q: np.ndarray, flows: bool) -> np.ndarray:
        p = np.array([[q[0], np.exp(q[1]), abs(q[2]), 1.0, 0.0, 0.0, abs(q[3]) if flows else 0.0]])
        return Viscoelastic().remember(p, stress[None], way)[0] - measured

    rms = [
        np.sqrt(2 * least_squares(misfit, (0.3, np.log(10.0), 1.0, 8.0), args=(flows,)).cost / d.size)
        for flows in (False, True)
    ]
    assert rms[1] < 0.4 * rms[0]
    assert rms[1] < 0.005 * np.max(measured)


@pytest.mark.parametrize("height", [0.05, 0.0])
def test_a_test_that_begins_at_the_top_has_moved_there_once(height: float) -> None:
    """Its first reading is at no time, and what is left then is all of it; be it that the film alone has moved."""
    d, time = np.full(6, height), np.array([0.0, 1.0, 5.0, 50.0, 200.0, 1000.0])
    stress, way = np.ones(6), replace(path(d, time), full_range=0.05)
    found = flowing(stress[None], way, TIMES[None], EVEN[None], np.array([12.0]))[0]
    run = solve_ivp(
        lambda _, h: -h / TIMES * np.exp(12 * (abs(h @ EVEN) - USUAL)),
        (0.0, 1000.0),
        np.ones(TERMS),
        "LSODA",
        time,
        rtol=1e-8,
        atol=1e-10,
    )
    assert found[0] == pytest.approx(1.0)
    assert found == pytest.approx(EVEN @ run.y, abs=0.01)
