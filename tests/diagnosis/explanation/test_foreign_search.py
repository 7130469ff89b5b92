"""What is foreign is found beside a film, under the noise that is left beside it, and in holds, too."""

from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.explanation import foreign_search as search_module
from bayesmembrane.diagnosis.explanation.foreign import (
    CLIPPED,
    LOST,
    PASSING,
    RANGE,
    STOP,
    SUDDEN,
    UNNAMED,
    WAVE,
    Foreign,
)
from bayesmembrane.diagnosis.explanation.foreign_search import beside, foreign, the_only
from bayesmembrane.diagnosis.reference.inferred import own_noise
from bayesmembrane.diagnosis.reference.smooth import smooth_reference
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics import api
from tests.diagnosis.curves import SD, measured, triangle

CLAIM = hypothesis("neo_hookean")
PITCH = 2.6e-3


def film_on(deflection: Array, time: Array) -> Measurement:
    """A neo-Hookean film without noise."""
    empty = measured(np.ones(deflection.size), deflection, time)
    film = Forward(CLAIM, empty, deflection, api.solve)(np.array([[np.log(16.0)]]), reached=False).force[0]
    return replace(empty, force=film)


def searched(m: Measurement, change: Array, seed: int, rho: float = 0.0) -> tuple[Search, Candidate]:
    """The plain fit of a film with a change of its force and noise, which is inferred."""
    rng = np.random.default_rng(seed)
    noise = SD * rng.standard_normal(len(m))
    for i in range(1, len(m)):
        noise[i] = rho * noise[i - 1] + np.sqrt(1 - rho**2) * noise[i]
    m = replace(m, force=m.force + change + noise)
    search = Search(m, own_noise(m, smooth_reference(m)), 0, api.solve)
    base = search.fit(CLAIM, search.material_starts(CLAIM))
    assert base is not None
    return search, base


def told(search: Search, base: Candidate) -> list[Foreign]:
    return foreign(the_only(search), base)


def kind(found: list[Foreign], name: str) -> Foreign:
    return next(f for f in found if f.kind == name)


def cycles(points: int = 400) -> tuple[Array, Array]:
    return triangle(points, (0.02, 0.04, 0.03, 0.04)), np.arange(1.0, points + 1)


def with_holds() -> tuple[Array, Array]:
    """Two cycles, with a hold of 20 readings at each peak; no two legs at the same places, which would alias."""
    ends, counts = ((0, 0.04), (0.04, 0), (0, 0.04), (0.04, 0)), (73, 67, 71, 69)
    legs = [np.linspace(a, b, n, endpoint=False) for (a, b), n in zip(ends, counts, strict=True)]
    d = np.concatenate([legs[0], np.full(20, 0.04), legs[1], legs[2], np.full(20, 0.04), legs[3]])[1:]
    return d, np.arange(1.0, d.size + 1)


@pytest.mark.parametrize("path", [cycles, with_holds])
def test_a_wave_of_the_deflection_is_found_with_its_length_with_and_without_holds(path) -> None:
    m = film_on(*path())
    found = kind(told(*searched(m, SD * np.sin(2 * np.pi * m.deflection / PITCH + 1.0), 4401)), WAVE)
    assert found.gain > 20.0
    assert found.against == "deflection"
    assert found.period == pytest.approx(PITCH, rel=0.03)


def test_a_wave_that_was_taken_for_noise_with_a_memory_is_weighed_by_the_noise_beside_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Nine readings a wave look like neighbours that are correlated by cos(40 degrees)."""
    m = film_on(*cycles())
    search, base = searched(m, 1.5 * SD * np.sin(2 * np.pi * m.time / 9.0), 4402)
    assert search.noise.rho > 0.3
    found = kind(told(search, base), WAVE)
    monkeypatch.setattr(search_module, "_with_its_own_noise", lambda test, find: find(test, None))
    before = kind(told(search, base), WAVE)
    assert found.gain > before.gain + 10.0
    assert found.period == pytest.approx(9.0, rel=0.03)


@pytest.mark.parametrize(("seed", "rho"), [(4403, 0.0), (4404, 0.0), (4405, 0.0), (4406, 0.5), (4407, 0.5)])
def test_in_noise_nothing_is_foreign(seed: int, rho: float) -> None:
    m = film_on(*cycles())
    search, base = searched(m, np.zeros(len(m)), seed, rho)
    assert max(f.gain for f in told(search, base)) < 1.0


def test_legs_read_half_a_step_apart_show_no_wave_of_their_steps() -> None:
    """cos(2 pi x / step) is 1 on each loading and -1 on each unloading: it imitates any loop."""
    up = np.linspace(1e-3, 0.04, 40)
    d = np.concatenate([up, up[::-1] - 5e-4, up, up[::-1] - 5e-4])
    loop = np.where(np.diff(d, prepend=0.0) > 0, 6 * SD, -6 * SD)
    found = kind(told(*searched(film_on(d, np.arange(1.0, d.size + 1)), loop, 7)), WAVE)
    assert found.period > 2e-3 or found.against == "time"


def test_what_has_no_name_is_smaller_than_the_force() -> None:
    """A loop as wide as the force: no smooth error of a film without one is that large."""
    d, time = triangle(240, (0.04, 0.04)), np.arange(1.0, 241)
    plain = film_on(d, time)
    loop = np.where(np.diff(d, prepend=0.0) > 0, 1.0, -1.0) * 0.9 * plain.force
    assert kind(told(*searched(plain, loop, 11)), UNNAMED).size <= 0.4 + 1e-9


def test_a_step_is_told_with_its_moment_and_its_part_of_the_force() -> None:
    m = film_on(*cycles())
    found = kind(told(*searched(m, 0.02 * m.force * (m.time > 140.0), 4408)), SUDDEN)
    assert found.gain > 20.0
    assert found.relative
    assert found.moment == pytest.approx(140.0, abs=4.0)
    assert found.size == pytest.approx(0.02, abs=0.006)


def most_probable(m: Measurement, change: Array, seed: int) -> Foreign:
    """Of all kinds, beside the plain fit of a film whose force is changed."""
    return max(told(*searched(m, change, seed)), key=lambda f: f.gain)


@pytest.mark.parametrize("lost", [0.4e-3, -0.4e-3])
def test_lost_steps_are_told_with_their_moment_and_their_length(lost: float) -> None:
    m = film_on(*cycles())
    after = m.time > 240.0
    shifted = film_on(np.maximum(m.deflection - np.where(after, lost, 0.0), 0.0), m.time).force
    found = most_probable(m, shifted - m.force, 4411)
    assert found.kind == LOST
    assert found.gain > 20.0
    assert found.moment == pytest.approx(240.0, abs=4.0)
    assert found.size == pytest.approx(lost, rel=0.3)
    assert found.falls is (lost > 0)


@pytest.mark.parametrize("part", [0.02, -0.02])
def test_a_range_of_an_amplifier_is_told_with_its_force_and_its_part(part: float) -> None:
    m = film_on(*cycles())
    level = 0.4 * np.max(m.force)
    found = most_probable(m, np.where(m.force > level, part * m.force, 0.0), 4412)
    assert found.kind == RANGE
    assert found.gain > 20.0
    assert found.relative
    assert found.level == pytest.approx(level, rel=0.1)
    assert found.size == pytest.approx(part, rel=0.4)


def test_what_the_disc_meets_is_told_with_where_it_is_and_never_pulls() -> None:
    m = film_on(*cycles())
    push = 25 * SD * np.maximum(m.deflection - 0.032, 0.0) / 0.008
    found = most_probable(m, push, 4413)
    assert found.kind == STOP
    assert found.gain > 10.0
    assert found.level == pytest.approx(0.032, abs=0.0015)
    assert found.size == pytest.approx(25 * SD, rel=0.3)
    assert kind(told(*searched(m, -push, 4413)), STOP).gain < 0.0


def test_what_comes_and_goes_is_told_with_when_it_begins() -> None:
    m = film_on(*cycles())
    x = np.maximum(m.time - 150.0, 0.0) / 12.0
    found = most_probable(m, 0.05 * m.force * x * np.exp(1 - x), 4414)
    assert found.kind == PASSING
    assert found.gain > 20.0
    assert found.relative
    assert found.moment == pytest.approx(150.0, abs=6.0)
    assert found.size == pytest.approx(0.05, rel=0.4)


def test_a_limit_is_looked_for_beside_every_energy_and_other_things_beside_the_bases() -> None:
    m = film_on(*cycles())
    search, base = searched(m, np.minimum(m.force, 0.93 * np.max(m.force)) - m.force, 4409)
    other = search.fit(hypothesis("gent"), search.material_starts(hypothesis("gent")))
    assert other is not None
    found = beside(the_only(search), [base], [other])
    limits = [f for f in found if f.kind == CLIPPED]
    assert {f.base.hypothesis.material.name for f in limits} == {"neo_hookean", "gent"}
    assert {f.base.hypothesis.material.name for f in found if f.kind == WAVE} == {"neo_hookean"}
    best = max(limits, key=lambda f: f.gain + f.base.log_evidence)
    assert best.gain > 20.0
    assert best.share > 0.3
