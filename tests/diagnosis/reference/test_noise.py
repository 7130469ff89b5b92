import numpy as np
import pytest

from bayesmembrane.diagnosis.reference.inferred import own_noise
from bayesmembrane.diagnosis.reference.noise import decorrelated
from bayesmembrane.diagnosis.reference.smooth import smooth_reference
from tests.diagnosis.curves import SD, correlated, measured, triangle

N, SEEDS = 300, 16
TIME = np.arange(1.0, N + 1)
SMOOTH = 0.3 * (triangle(N) / 0.04) ** 1.7  # N


@pytest.mark.parametrize("rho", [0.0, 0.4, 0.7])
def test_restricted_likelihood_recovers_deviation_and_correlation(rho) -> None:
    rng = np.random.default_rng(1)
    found = []
    for _ in range(SEEDS):
        m = measured(SMOOTH + correlated(rng, TIME, rho))
        found.append(own_noise(m, smooth_reference(m)))
    sd, rhos = np.array([f.sd for f in found]), np.array([f.rho for f in found])
    errors = np.array([f.rho_sd for f in found])
    # Four standard errors of the mean; at zero the estimate is cut off from below.
    assert abs(sd.mean() / SD - 1) < 4 * max(sd.std() / SD, 0.03) / np.sqrt(SEEDS)
    assert abs(rhos.mean() - rho) < 4 * errors.mean() / np.sqrt(SEEDS) + (errors.mean() if rho == 0 else 0)
    spread = np.sqrt(np.mean((rhos - rho) ** 2))
    assert 0.3 * errors.mean() < spread < 2 * errors.mean()


def test_a_curve_that_the_reference_cannot_follow_looks_like_noise_that_remembers() -> None:
    m = measured(SMOOTH + correlated(np.random.default_rng(2), TIME, 0.0))
    poor = own_noise(m, np.ones((N, 1)))
    assert poor.rho > 0.9
    assert own_noise(m, smooth_reference(m)).rho < 0.3


def test_decorrelated_noise_is_white_also_between_uneven_points() -> None:
    time = np.cumsum(np.random.default_rng(3).uniform(0.2, 3.0, 40))
    for rho in (0.0, 0.3, 0.9):
        covariance = rho ** np.abs(time[:, None] - time[None, :]) if rho else np.eye(40)
        root = decorrelated(np.eye(40), rho, np.diff(time))
        np.testing.assert_allclose(root @ covariance @ root.T, np.eye(40), atol=1e-10)


def test_inferred_noise_whitens_what_it_was_inferred_from() -> None:
    m = measured(SMOOTH + correlated(np.random.default_rng(4), TIME, 0.6))
    noise = own_noise(m, smooth_reference(m))
    w = noise.white(m.force - SMOOTH)
    assert abs(np.corrcoef(w[1:], w[:-1])[0, 1]) < 3 / np.sqrt(N)
    assert w.std() == pytest.approx(1.0, abs=0.15)
    assert noise.cautious().rho == pytest.approx(noise.rho + noise.rho_sd)


def test_stated_noise_is_used_as_stated() -> None:
    time = TIME[:50]
    covariance = np.outer(a := np.linspace(1, 3, 50), a) * SD**2 * 0.5 ** np.abs(time[:, None] - time[None, :])
    force = SMOOTH[:50]
    noise = own_noise(measured(force, covariance=covariance), np.ones((50, 1)))
    assert noise.stated
    assert noise.rho == 0
    assert noise.sd == pytest.approx(SD * np.sqrt(np.mean(a**2)))
    assert noise.dof == np.inf
    assert noise.cautious() is noise
    w = noise.white(force)
    assert w @ w == pytest.approx(force @ np.linalg.solve(covariance, force))
    np.testing.assert_allclose(noise.white(np.stack([force, 2 * force], axis=1)), np.stack([w, 2 * w], axis=1))


def test_stated_deviations_are_believed_unless_the_readings_contradict() -> None:
    stated = SD * np.linspace(1, 3, N)
    basis = smooth_reference(measured(SMOOTH))
    believed = 0
    for seed in range(SEEDS):
        e = np.random.default_rng(seed).standard_normal(N)
        believed += own_noise(measured(SMOOTH + stated * e, force_sd=stated), basis).stated
        larger = own_noise(measured(SMOOTH + 1.6 * stated * e, force_sd=stated), basis)
        assert not larger.stated
        assert larger.excess == pytest.approx(1.6, rel=0.2)
        np.testing.assert_allclose(larger.each, larger.excess * stated)
        half = np.arange(N) < N // 2
        np.testing.assert_allclose(larger.part(larger_part(stated, half), half).each, larger.each[half])
        # A statement that is too careful is left alone: it may hold more than the readings show.
        assert own_noise(measured(SMOOTH + 0.5 * stated * e, force_sd=stated), basis).stated
        remembers = correlated(np.random.default_rng(seed), TIME, 0.6) / SD * stated
        assert not own_noise(measured(SMOOTH + remembers, force_sd=stated), basis).stated
    assert believed >= SEEDS - 1


def larger_part(stated, keep):
    return measured(SMOOTH, force_sd=stated).select(keep)


def test_a_part_of_stated_covariance_whitens_that_part() -> None:
    covariance = SD**2 * 0.5 ** np.abs(TIME[:60, None] - TIME[None, :60])
    m = measured(SMOOTH[:60], covariance=covariance)
    keep = np.arange(60) % 4 != 2
    part = own_noise(m, np.ones((60, 1))).part(m.select(keep), keep)
    w = part.white(SMOOTH[:60][keep])
    y = SMOOTH[:60][keep]
    assert w @ w == pytest.approx(y @ np.linalg.solve(covariance[np.ix_(keep, keep)], y))


@pytest.mark.parametrize("clock", ["time", "readings"])
def test_noise_that_forgets_by_time_or_by_reading_is_told_apart_at_two_speeds(clock) -> None:
    steps = np.where(np.arange(N) < N // 2, 1.0, 0.1)
    time = np.cumsum(steps)
    hits = 0
    for seed in range(6):
        noise = correlated(np.random.default_rng(seed), time if clock == "time" else TIME, 0.5)
        m = measured(SMOOTH + noise, time=time)
        found = own_noise(m, smooth_reference(m))
        hits += found.clock == clock
        half = m.select(np.arange(N) < N // 2)
        assert found.part(half, np.arange(N) < N // 2).gaps.size == N // 2 - 1
    assert hits >= 5


@pytest.mark.parametrize("rho", [0.0, 0.8])
def test_noise_that_does_not_grow_with_the_force_is_not_seen_to(rho: float) -> None:
    """One in a thousand is, by design; of readings that remember, too."""
    found = 0
    for seed in range(200):
        m = measured(SMOOTH + correlated(np.random.default_rng([5, seed]), TIME, rho))
        found += own_noise(m, smooth_reference(m)).profile.size > 1
    assert found <= 5  # of 0.2: by chance once in 10^7


def test_noise_that_grows_with_the_force_is_weighed_so() -> None:
    wrong, each = [], SD * np.hypot(1.0, 4 * SMOOTH / np.max(SMOOTH))
    for seed in range(20):
        m = measured(SMOOTH + each * np.random.default_rng([6, seed]).standard_normal(N))
        noise = own_noise(m, smooth_reference(m))
        wrong.append(noise.each / each)
        assert noise.sd == pytest.approx(np.sqrt(np.mean(noise.each**2)))
    assert np.mean(wrong) == pytest.approx(1.0, abs=0.1)
    assert np.max(np.abs(np.log(wrong))) < np.log(2)


def test_a_jump_at_the_largest_force_is_no_noise_that_grows() -> None:
    noise = SD * np.random.default_rng(7).standard_normal(N)
    m = measured(SMOOTH + noise - 20 * SD * (np.arange(N) > int(np.argmax(SMOOTH))))
    assert own_noise(m, smooth_reference(m)).profile.size == 1
