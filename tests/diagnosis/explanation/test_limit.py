"""A load cell at its limit: exact to a digit, or with the noise of all readings; and a peak that is none."""

from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.explanation import limit as module
from bayesmembrane.diagnosis.explanation.limit import limit_of, log_evidence_alone
from bayesmembrane.diagnosis.explanation.saturation import promises
from bayesmembrane.diagnosis.left.shape import plateau_of
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics import api
from tests.diagnosis.curves import SD, measured, triangle, white_noise

CLAIM = hypothesis("neo_hookean")
SHARE = 0.9
"""Of the largest force: where the load cell ends."""


def film_of(measurement: Measurement) -> Array:
    """(N,) N: a neo-Hookean film without noise or limit, by the mechanics that no table speeds up."""
    forward = Forward(CLAIM, measurement, measurement.deflection, api.solve)
    return forward(np.array([[np.log(16.0)]]), reached=False).force[0]


def searched(m: Measurement) -> tuple[Search, Candidate]:
    """The search for what ``m`` shows, and its plain fit."""
    search = Search(m, white_noise(m), 0, api.solve)
    base = search.fit(CLAIM, search.material_starts(CLAIM))
    assert base is not None
    return search, base


def fitted(limit: float, noise_first: bool, seed: int) -> tuple[Search, Candidate, float]:
    """A neo-Hookean film over a triangle, cut off at the part ``limit`` of its largest force, its plain fit, and N."""
    empty = measured(np.ones(240), triangle(240))
    film = film_of(empty)
    noise = SD * np.random.default_rng(seed).standard_normal(film.size)
    most = limit * float(np.max(film))
    force = np.minimum(film + noise, most) if noise_first else np.minimum(film, most) + noise
    m = replace(empty, force=force)
    return *searched(m), most


@pytest.mark.parametrize("noise_first", [True, False])
def test_a_limit_is_found_where_it_is(noise_first: bool) -> None:
    search, base, most = fitted(SHARE, noise_first, 4101)
    found = limit_of(search, base)
    assert found is not None
    assert found.gain > 10.0
    assert found.force == pytest.approx(most, abs=3 * SD)
    assert abs(search.measurement.force[found.first] - most) < 6 * SD


@pytest.mark.parametrize("seed", range(4110, 4116))
def test_a_peak_is_no_limit(seed: int) -> None:
    search, base, _ = fitted(2.0, True, seed)
    found = limit_of(search, base)
    assert found is None or found.gain < 0.0


@pytest.mark.parametrize("noise_first", [True, False])
def test_a_limit_that_leaves_noise_explains_all_of_a_clipped_film(noise_first: bool) -> None:
    search, base, _ = fitted(SHARE, noise_first, 4121)
    found = limit_of(search, base)
    assert found is not None
    assert log_evidence_alone(search, base) == pytest.approx(base.log_evidence + found.gain)


def test_one_that_leaves_more_does_not() -> None:
    """A wave of five standard deviations of the noise beside the limit; and a film without one."""
    search, base, _ = fitted(SHARE, False, 4122)
    wave = 5 * SD * np.sin(np.arange(240) / 3)
    m = replace(search.measurement, force=search.measurement.force + wave)
    moved = Search(m, white_noise(m), 0, api.solve)
    again = moved.fit(CLAIM, [base.x])
    assert again is not None
    assert log_evidence_alone(moved, again) == -np.inf
    plain, film, _ = fitted(2.0, True, 4110)
    assert log_evidence_alone(plain, film) == -np.inf


def test_a_limit_is_not_looked_for_where_more_than_noise_is_left_far_below_it(monkeypatch: pytest.MonkeyPatch) -> None:
    search, base, _ = fitted(SHARE, True, 4123)
    wave = 5 * SD * np.sin(np.arange(240) / 3) * (search.measurement.force < 0.7 * np.max(search.measurement.force))
    m = replace(search.measurement, force=search.measurement.force + wave)
    moved = Search(m, white_noise(m), 0, api.solve)
    again = moved.fit(CLAIM, [base.x])
    assert again is not None
    assert promises(moved, again)
    monkeypatch.setattr(module, "limit_of", lambda *_: pytest.fail("looked for"))
    assert log_evidence_alone(moved, again) == -np.inf


@pytest.mark.parametrize("step", [1.5, 3.0])
def test_a_hold_at_the_top_in_coarse_readings_is_no_limit(step: float) -> None:
    """The film stands still, and its readings share the largest digit: that says nothing of the load cell."""
    path = np.concatenate([np.linspace(0.0, 0.04, 121)[1:], np.full(60, 0.04), np.linspace(0.04, 0.0, 120)[1:]])
    empty = measured(np.ones(path.size), path)
    film = film_of(empty)
    force = film + SD * np.random.default_rng(4141).standard_normal(film.size)
    m = replace(empty, force=step * SD * np.round(force / (step * SD)))
    assert plateau_of(m.force) is not None
    found = limit_of(*searched(m))
    assert found is None or found.gain < 1.0


def test_single_readings_that_go_astray_at_the_top_are_no_limit() -> None:
    """Three cycles, the last reading of two of the loadings 2 % low: a limit is met by more than those."""
    up = triangle(80)
    path = np.concatenate([up, up[1:], up[1:]])
    empty = measured(np.ones(path.size), path)
    film = film_of(empty)
    force = film + SD * np.random.default_rng(4131).standard_normal(film.size)
    tops = np.flatnonzero(film == np.max(film))[:2]
    force[tops] -= 0.02 * np.max(film)
    m = replace(empty, force=force)
    found = limit_of(*searched(m))
    assert found is None or found.gain < 1.0


@pytest.mark.parametrize("seed", [4151, 4152])
def test_what_readings_go_far_beyond_is_no_limit(seed: int) -> None:
    """The first cycle is bent at its top, and the second one, which goes as far, is not."""
    empty = measured(np.ones(240), triangle(240, (0.04, 0.04)))
    film = film_of(empty)
    most = SHARE * float(np.max(film))
    bent = np.where(np.arange(240) < 120, film * (1 + (film / most) ** 60) ** (-1 / 60), film)
    m = replace(empty, force=bent + SD * np.random.default_rng(seed).standard_normal(240))
    assert limit_of(*searched(m)) is None


@pytest.mark.parametrize("seed", [4161, 4162])
def test_what_the_inertia_of_a_grip_takes_at_a_turn_is_no_limit(seed: int) -> None:
    """The last two readings of the loading and the first of the unloading are 2 to 3 % low."""
    empty = measured(np.ones(160), triangle(160, (0.04,)))
    film = film_of(empty)
    turn = int(np.argmax(empty.deflection))
    film[turn - 1 : turn + 2] *= 0.98, 0.97, 0.98
    m = replace(empty, force=film + SD * np.random.default_rng(seed).standard_normal(160))
    assert limit_of(*searched(m)) is None


@pytest.mark.parametrize(("readings", "share"), [(160, 0.95), (240, 0.95), (480, 0.98)])
def test_a_limit_that_few_readings_of_one_cycle_meet_is_found(readings: int, share: float) -> None:
    empty = measured(np.ones(readings), triangle(readings, (0.04,)))
    film = film_of(empty)
    most = share * float(np.max(film))
    m = replace(empty, force=np.minimum(film, most) + SD * np.random.default_rng(4171).standard_normal(readings))
    found = limit_of(*searched(m))
    assert found is not None
    assert found.gain > 10.0
    assert found.force == pytest.approx(most, abs=3 * SD)
