"""Flaws and noise of the third generator: nothing at zero, loops that lose, laws that hold, stated deviations."""

from functools import cache

import numpy as np
import pytest

from tests.generator_three.curves import FilmCurves
from tests.generator_three.elements import ElementFilm, Rubber
from tests.generator_three.flaw_draws import draw_flaw
from tests.generator_three.flaws import FLAWS, Flaw
from tests.generator_three.instrument import Instrument
from tests.generator_three.journey import Journey, Ramp, Rest, read_along
from tests.generator_three.readings import noise_deviations, read_with_noise
from tests.generator_three.recipes import NoiseRecipe

DISSIPATIVE = ("viscoelastic", "hysteresis", "mullins", "permanent_set", "friction", "clamp_slip")


@cache
def curves() -> FilmCurves:
    return FilmCurves(ElementFilm(10.0, 30.0, 60), Rubber("gent", (6e-3, 20.0)), 2.0)


def cycled(slower: float = 1.0) -> Journey:
    """Two cycles, a rest and a quick cycle, all to the peak."""
    peak, v = curves().peak, 1.0 / slower
    pieces = [Ramp(peak, v), Ramp(0.0, v), Ramp(peak, v), Rest(30.0 * slower, 0.15), Ramp(0.0, v)]
    return read_along([*pieces, Ramp(peak, 8 * v), Ramp(0.0, 8 * v)], 400, "cycles")


@cache
def flaw_of(name: str, form: str) -> Flaw:
    """One of that form, with details as they come."""
    rng = np.random.default_rng(3)
    return next(f for f in (draw_flaw(rng, name, cycled(), curves().peak) for _ in range(200)) if f.form == form)


def instrument(name: str, form: str, journey: Journey | None = None) -> Instrument:
    return Instrument(curves(), journey or cycled(), {name: flaw_of(name, form)})


FORMS = [(name, form) for name, kind in FLAWS.items() for form in kind.forms]


# ---- flaws -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "form"), FORMS)
def test_a_flaw_of_size_zero_leaves_the_film_alone_and_it_fades_with_its_size(name, form) -> None:
    one, sound = instrument(name, form), curves().sound(cycled().at)
    top = one.scales.force
    change = [np.max(np.abs(one.with_sizes({name: s}).reading() - sound)) / top for s in (0.0, 1e-4, 1e-2)]
    assert change[0] < 1e-9
    assert 0 < change[1] < 5e-3
    assert 3 * change[1] < change[2]


@pytest.mark.parametrize(("name", "form"), [f for f in FORMS if f[0] in DISSIPATIVE])
def test_what_dissipates_unloads_below_the_loading(name, form) -> None:
    peak = curves().peak
    journey = read_along([Ramp(peak, 1.0), Ramp(0.0, 1.0)], 400, "up and down")
    turn, d = journey.turns[0], np.linspace(0.1, 0.95, 30) * peak

    def lost(size: float) -> np.ndarray:
        """Loading less unloading, in parts of the largest force."""
        force = instrument(name, form, journey).with_sizes({name: size}).reading()
        up = np.interp(d, journey.at[: turn + 1], force[: turn + 1])
        return (up - np.interp(d, journey.at[: turn - 1 : -1], force[: turn - 1 : -1])) / np.max(force)

    np.testing.assert_allclose(lost(0.0), 0.0, atol=2e-4)
    assert np.min(lost(0.05)) > -1e-3
    assert np.mean(lost(0.05)) > 1e-3


def test_hysteresis_and_friction_know_no_speed_and_relaxation_does() -> None:
    quick, slow = cycled(), cycled(slower=10.0)
    for name in ("hysteresis", "friction"):
        for form in FLAWS[name].forms:
            at_both = [instrument(name, form, j).with_sizes({name: 0.1}).reading() for j in (quick, slow)]
            np.testing.assert_allclose(*at_both, rtol=1e-9, atol=1e-12)
    held = (quick.speed == 0) & (quick.at > 0.99 * curves().peak)
    assert held.sum() > 10
    for form in FLAWS["viscoelastic"].forms:
        force = instrument("viscoelastic", form).with_sizes({"viscoelastic": 0.3}).reading()
        assert np.all(np.diff(force[held]) < 0), form


def test_a_step_relaxes_as_its_law_says() -> None:
    peak = curves().peak
    journey = read_along([Ramp(peak, 1e4), Rest(100.0, 0.5)], 300, "step and hold")
    lazy = Flaw("viscoelastic", 0.4, "power", {"tau": [2.0], "weights": [1.0], "exponent": 0.3})
    force = Instrument(curves(), journey, {"viscoelastic": lazy}).reading()
    after = journey.time > 1.0
    law = 0.6 + 0.4 * (1 + journey.time[after] / 2.0) ** -0.3
    np.testing.assert_allclose(force[after], curves().sound(peak) * law, rtol=1e-3)


@pytest.mark.parametrize("form", FLAWS["machine_compliance"].forms)
def test_the_frame_yields_until_it_balances_the_film(form) -> None:
    one = instrument("machine_compliance", form).with_sizes({"machine_compliance": 0.05})
    part, d = one.reading() / one.scales.force, one.flaws["machine_compliance"].details
    yields = {"linear": part, "hardening": part / (1 + d["h"] * part), "power": part ** d["q"]}[form]
    large = part > 0.01
    exact = curves().sound(cycled().at - 0.05 * one.scales.peak * yields)
    np.testing.assert_allclose(part[large], exact[large] / one.scales.force, atol=1e-5)


# ---- noise -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("correlated", [False, True])
@pytest.mark.parametrize("grows", [False, True])
def test_noise_has_the_deviation_and_the_correlation_that_it_claims(correlated, grows) -> None:
    clean, sd = np.tile(np.linspace(0.0, 2.0, 200), 200), 0.01
    recipe = NoiseRecipe(correlated, grows, False, False, False)
    deviations = noise_deviations(recipe, sd, clean)
    assert np.sqrt(np.mean(deviations**2)) == pytest.approx(sd)
    assert (np.ptp(deviations) > 0) == grows
    read = read_with_noise(np.random.default_rng(2), recipe, clean, deviations, sd, cycled())
    z = (read.force - clean) / deviations
    assert np.std(z) == pytest.approx(1.0, abs=0.03)
    assert np.std(z[deviations < np.median(deviations) + 1e-12]) == pytest.approx(1.0, abs=0.03)
    assert np.mean(z[1:] * z[:-1]) == pytest.approx(read.rho, abs=0.03)
    assert (read.rho >= 0.2) == correlated


def test_strays_are_far_off_and_alone_and_steps_are_even() -> None:
    journey = cycled()
    clean, sd = curves().sound(journey.at), 1e-3
    deviations = np.full(clean.size, sd)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        read = read_with_noise(rng, NoiseRecipe(False, False, True, False, False), clean, deviations, sd, journey)
        off = np.abs(read.force - clean) / sd
        assert 1 <= len(read.strays) <= 3
        assert np.all(off[list(read.strays)] > 1.5)
        assert np.max(np.delete(off, read.strays)) < 5
    plain, even = (
        read_with_noise(
            np.random.default_rng(1), NoiseRecipe(False, False, False, r, False), clean, deviations, sd, journey
        )
        for r in (False, True)
    )
    assert 0.3 * sd <= even.step <= 0.9 * sd
    np.testing.assert_allclose(even.force / even.step, np.round(even.force / even.step), atol=1e-6)
    away = np.abs(even.force - plain.force)
    assert 0.4 * even.step < np.max(away) <= 0.5001 * even.step
