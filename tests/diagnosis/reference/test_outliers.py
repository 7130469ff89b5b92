"""Single readings that nothing could follow are set aside; what moves many of them is not."""

from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.diagnosis.diagnose import diagnose
from bayesmembrane.diagnosis.reference.outliers import without_outliers
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from bayesmembrane.words.diagnosis import document, sentence

SD = 0.004
seeds = pytest.mark.parametrize("seed", range(6))


def cycles(seed: int, sd: float = SD, grows: bool = False) -> Measurement:
    """Three cycles, 300 readings in all, unloading below loading, with white noise, growing with the force or not."""
    up, down = np.linspace(0.01, 1.0, 50), np.linspace(0.99, 0.0, 50)
    d = np.concatenate([peak * way for peak in (0.02, 0.03, 0.04) for way in (up, down)])
    leg = np.concatenate([s * np.ones(50) for _ in range(3) for s in (1, -1)])
    force = 40 * d * (1 + 0.05 * leg) + 2e4 * d**3
    noise = np.random.default_rng(seed).standard_normal(d.size)
    noisy = force + sd * noise * (force / np.max(force) if grows else 1.0)
    return Measurement(d, noisy, Annulus(0.010, 0.035), Specimen("film", 5e-5), time=np.arange(d.size) + 1.0)


def moved(m: Measurement, change: np.ndarray) -> Measurement:
    return replace(m, force=m.force + change)


@seeds
@pytest.mark.parametrize("grows", [False, True])
def test_of_noise_nothing_is_set_aside(seed: int, grows: bool) -> None:
    m = cycles(seed, grows=grows)
    part, aside = without_outliers(m)
    assert aside is None
    assert part is m


@seeds
def test_one_reading_at_a_turn_or_anywhere_is(seed: int) -> None:
    for where, size in ((149, -0.15), (255, -0.2), (20, 0.15), (120, 0.15)):
        change = np.zeros(300)
        change[where] = size
        m = moved(cycles(seed), change)
        part, aside = without_outliers(m)
        assert aside is not None
        assert aside.numbers == (where + 1,)
        assert aside.measured == 300
        assert aside.farthest > 6
        assert np.array_equal(part.force, np.delete(m.force, where))
        assert np.array_equal(part.path.deflection, m.deflection)


@seeds
def test_how_far_off_it_is_does_not_know_of_the_reading_itself(seed: int) -> None:
    change = np.zeros(300)
    change[120] = 150 * SD
    _, aside = without_outliers(moved(cycles(seed), change))
    assert aside is not None
    assert aside.farthest == pytest.approx(150, rel=0.4)  # the scale is that of some neighbours


def stairs(seed: int) -> Measurement:
    """Up and down in steps with holds, whose first readings relax within a few."""
    up = np.concatenate([np.concatenate([np.linspace(a, a + 0.01, 20)[1:], np.full(20, a + 0.01)]) for a in STEPS])
    down = np.concatenate([np.concatenate([np.linspace(a + 0.01, a, 20)[1:], np.full(20, a)]) for a in STEPS[::-1]])
    d = np.concatenate([up, down])
    still = np.diff(d, prepend=0.0) == 0
    since = np.arange(d.size) - np.maximum.accumulate(np.where(still, 0, np.arange(d.size)))
    way = np.where(np.arange(d.size) < up.size, 1.0, -1.0)
    force = 40 * d + 2e4 * d**3 + 0.05 * way * np.exp(-since / 2.0) * (d > 0)
    noisy = force + SD * np.random.default_rng(seed).standard_normal(d.size)
    return Measurement(d, noisy, Annulus(0.010, 0.035), Specimen("film", 5e-5), time=np.arange(d.size) + 1.0)


STEPS = (0.0, 0.01, 0.02)


@seeds
def test_a_hold_that_begins_against_the_way_is_no_relaxation(seed: int) -> None:
    """The first reading of a hold is followed by whatever relaxes; none begins below what comes before and after."""
    m = stairs(seed)
    assert without_outliers(m)[1] is None
    first = np.flatnonzero((np.diff(m.deflection, append=np.nan) == 0) & (np.diff(m.deflection, prepend=0.0) != 0))
    for where, size in ((first[0], -0.1), (first[2], -0.1), (first[3], 0.1)):
        change = np.zeros(len(m))
        change[where] = size
        aside = without_outliers(moved(m, change))[1]
        assert aside is not None
        assert aside.numbers == (where + 1,)
        assert aside.farthest > 6


@seeds
def test_so_is_the_first_or_the_last_one_and_not_what_the_test_ends_with(seed: int) -> None:
    for where in (0, 299):
        change = np.zeros(300)
        change[where] = -0.3
        aside = without_outliers(moved(cycles(seed), change))[1]
        assert aside is not None
        assert aside.numbers == (where + 1,)
    for last in (2, 3, 5):  # a tear just before the end
        change = np.zeros(300)
        change[-last:] = -0.2
        assert without_outliers(moved(cycles(seed), change))[1] is None


@seeds
def test_doing_it_again_changes_nothing(seed: int) -> None:
    change = np.zeros(300)
    change[[49, 149, 255]] = 0.2, -0.15, -0.2
    part, aside = without_outliers(moved(cycles(seed), change))
    assert aside is not None
    assert len(aside.numbers) == 3
    again, nothing = without_outliers(part)
    assert nothing is None
    assert again is part


@pytest.mark.parametrize("size", [0.02, 0.05, 0.1, 0.3, 1.0])
@seeds
def test_a_step_a_ripple_and_a_limit_stay(seed: int, size: float) -> None:
    m = cycles(seed)
    number = np.arange(300)
    limited = np.minimum(m.force, np.max(m.force) * (0.9 - 0.3 * size)) - m.force
    dropped = size * ((number > 130) & (number < 150))
    for name, change in {
        "step": size * (number > 130),
        "quick ripple": size * np.sin(2 * np.pi * number / 7.3),
        "slow ripple": size * np.sin(2 * np.pi * number / 23),
        "limit": limited,
        "a stretch of readings": dropped,
        "play": size * (m.leg < 0),
    }.items():
        assert without_outliers(moved(m, change))[1] is None, name


@pytest.mark.parametrize("seed", [3, 4])
def test_four_in_a_hundred_are_found(seed: int) -> None:
    rng, change = np.random.default_rng(seed), np.zeros(300)
    hit = np.sort(5 + 10 * rng.choice(29, 12, replace=False) + rng.integers(0, 4, 12))
    change[hit] = rng.choice([-1, 1], 12) * rng.uniform(0.25, 0.5, 12)
    _, aside = without_outliers(moved(cycles(seed), change))
    assert aside is not None
    assert set(aside.numbers) == set(hit + 1)


def test_too_many_are_no_outliers() -> None:
    change = np.zeros(300)
    change[15::15] = 0.3
    m = moved(cycles(1), change)
    assert without_outliers(m) == (m, None)


def test_noise_that_is_stated_is_believed() -> None:
    change = np.zeros(300)
    change[77] = 0.15
    m = moved(cycles(2), change)
    assert without_outliers(replace(m, force_sd=np.full(300, SD)))[1] is not None
    assert without_outliers(replace(m, force_sd=np.full(300, 0.06)))[1] is None
    assert without_outliers(replace(m, covariance=SD**2 * np.eye(300)))[1] is None


def test_states_without_an_order_and_few_readings_stay() -> None:
    change = np.zeros(300)
    change[77] = 0.15
    m = moved(cycles(3), change)
    assert without_outliers(replace(m, across=np.ones(300), rig=Uniaxial()))[1] is None
    assert without_outliers(m.select(np.arange(300) < 40))[1] is None


def test_one_reading_changes_no_verdict_and_is_told() -> None:
    """The answer is that of the other readings, with the count of those that were set aside."""
    stretch = np.concatenate([np.linspace(1.01, 1.5, 60), np.linspace(1.49, 1.0, 60)])
    force = 20 * (stretch - stretch**-2) + 0.02 * np.random.default_rng(5).standard_normal(120)
    force[59] *= 0.9
    m = Measurement(0.05 * (stretch - 1), force, Uniaxial(), Specimen("strip", 1e-3), time=np.arange(120) + 1.0)
    found = diagnose(m, hypothesis("neo_hookean"))
    others = diagnose(m.select(np.arange(120) != 59), hypothesis("neo_hookean"))
    assert found.set_aside is not None
    assert found.set_aside.numbers == (60,)
    assert others.set_aside is None
    assert found.verdict == others.verdict
    assert found.noise.sd == others.noise.sd
    assert found.probabilities == others.probabilities
    assert document(found)["set_aside_readings"] == 1
    assert document(others)["set_aside_readings"] == 0
    assert "Set aside as outliers: 1 of the 120 readings (number 60)" in sentence(found)
