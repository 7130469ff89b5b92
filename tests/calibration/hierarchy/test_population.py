"""Populations of specimens: calibrated intervals, exact integrals, and what pooling does."""

import numpy as np
import pytest
from scipy import stats

from bayesmembrane.calibration.beside_paper import paper_break_points
from bayesmembrane.calibration.hierarchy.next_curve import population_of_runs
from bayesmembrane.calibration.hierarchy.population import WIDE, Population, population
from bayesmembrane.calibration.hierarchy.specimens import LN_MODULUS, Specimens, of_runs
from bayesmembrane.calibration.run import Run, RunSettings, sample
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.physics.hypothesis import hypothesis
from tests.calibration.joint.tests_of import STRIP, made

NAMES = ("ln_modulus", "bend", "rise")


def specimens(values: np.ndarray, sds: np.ndarray, spread: float = 2.0) -> Specimens:
    """Of values and standard deviations (J, q)."""
    j, q = values.shape
    labels = tuple(f"s{i}" for i in range(j))
    covariances = np.array([np.diag(sd**2) for sd in sds])
    return Specimens(labels, NAMES[:q], values, covariances, np.zeros(q), np.full(q, spread))


def simulated(rng: np.random.Generator, j: int, q: int) -> tuple[Specimens, np.ndarray, np.ndarray, np.ndarray]:
    """Specimens of a population that is drawn from the prior, with its mean, its scatter and the next specimen."""
    mean, scatter = 2.0 * rng.standard_normal(q), np.abs(rng.standard_normal(q)) * WIDE * 2.0
    sds = np.exp(rng.uniform(np.log(0.01), np.log(0.5), (j, q)))
    values = mean + scatter * rng.standard_normal((j, q)) + sds * rng.standard_normal((j, q))
    return specimens(values, sds), mean, scatter, mean + scatter * rng.standard_normal(q)


@pytest.mark.parametrize(("j", "q", "sets"), [pytest.param(5, 1, 150, marks=pytest.mark.study), (4, 2, 80)])
def test_intervals_hold_the_truth_as_often_as_they_say(j: int, q: int, sets: int) -> None:
    rng = np.random.default_rng(31)
    inside = []
    for i in range(sets):
        found, *truths = simulated(rng, j, q)
        p = population(found, seed=i, draws=800)
        for draws, truth in zip((p.mean, p.scatter, p.following), truths, strict=True):
            low, high = np.quantile(draws, (0.2, 0.8), axis=0)
            inside.append((low < truth) & (truth < high))
    share = np.mean(np.reshape(inside, (sets, 3, q)), axis=0)
    # 60 % intervals; 4.5 standard errors, and the few draws of each interval's ends.
    assert np.all(np.abs(share - 0.6) < 4.5 * np.sqrt(0.24 / sets) + 0.02)


def test_draws_are_those_of_the_integral_over_mean_and_scatter() -> None:
    values = np.array([0.1, -0.2, 0.4, 0.15, 0.0])
    sds = np.array([0.05, 0.1, 0.02, 0.2, 0.01])
    found = population(specimens(values[:, None], sds[:, None]), draws=20000)
    mu, tau = np.meshgrid(np.linspace(-1.2, 1.4, 801), np.linspace(1e-4, 2.0, 1000), indexing="ij")
    log_p = stats.norm(0, 2.0).logpdf(mu) + stats.halfnorm(scale=0.5).logpdf(tau)
    for z, sd in zip(values, sds, strict=True):
        log_p = log_p + stats.norm(mu, np.hypot(tau, sd)).logpdf(z)
    p = np.exp(log_p - log_p.max())
    p /= p.sum()
    for draws, x in ((found.mean, mu), (found.scatter, tau)):
        mean = float(np.sum(p * x))
        sd = float(np.sqrt(np.sum(p * (x - mean) ** 2)))
        error = sd / np.sqrt(min(found.effective, 20000))
        assert abs(draws.mean() - mean) < 7 * error
        assert abs(draws.std() / sd - 1) < 0.15


def test_alike_specimens_are_pooled_and_different_ones_are_not() -> None:
    sds = np.full((6, 1), 0.1)
    alike = population(specimens(np.array([[0.1], [-0.1], [0.05], [0.0], [-0.05], [0.1]]), sds))
    apart = population(specimens(3.0 * np.array([[1.0], [-1.0], [0.5], [0.0], [-0.5], [1.0]]), sds))
    assert np.all(alike.own.std(axis=0) < 0.8 * 0.1)
    assert np.all(apart.own.std(axis=0) > 0.9 * 0.1)
    assert apart.following.std() > 5 * alike.following.std()


def test_strips_that_differ_by_1_9_kPa_at_a_noise_of_0_06() -> None:
    """The scatter is found although each strip is known thirty times better, and the next one is as unsure as that."""
    g = 30.0 + 1.9 * np.array([0.3, -1.2, 0.9, -0.4, 1.1, -0.6, 0.2, -0.3])  # kPa
    found = population(specimens(np.log(g)[:, None], np.full((8, 1), 0.06 / 30.0)))
    told = found.modulus()
    low, high = (1e6 * v for v in told["scatter"]["hdi_94"])  # the logarithms are those of kPa here
    assert low < np.std(g, ddof=1) < high
    assert np.std(found.own[:, 0, 0]) == pytest.approx(0.06 / 30.0, rel=0.1)
    assert found.following.std() > 10 * 0.06 / 30.0


def test_the_paper_s_six_break_points() -> None:
    """Five forces at break foretell the sixth; the scatter is that which their logarithms have."""
    force = np.log([b.force for b in paper_break_points()])[:, None]
    read = np.full_like(force, 0.05 / 20.0)  # N, as they are rounded
    whole = population(specimens(force - force.mean(), read))
    low, high = np.quantile(whole.scatter, (0.03, 0.97))
    assert low < np.std(force, ddof=1) < high
    inside = 0
    for i in range(6):
        rest = np.delete(force, i, axis=0)
        found = population(specimens(rest - rest.mean(), read[:5]), seed=i)
        low, high = np.quantile(found.following, (0.03, 0.97))
        inside += int(low < force[i, 0] - rest.mean() < high)
    assert inside == 6


def walked(moduli: tuple[float, ...]) -> list[Run]:
    how = RunSettings(settings=Settings(ess=1e6, walkers=16, chunk=60, most_steps=60))
    claim = hypothesis("neo_hookean")
    strips = [
        made(STRIP, "neo_hookean", (c,), seed=i, thickness=(1 + i) * 1e-4, specimen=f"strip {i}")
        for i, c in enumerate(moduli)
    ]
    return [sample(m, claim, how) for m in strips]


def test_runs_of_films_of_any_thickness_become_one_population() -> None:
    """c1 = 10, 12, 11 N/m in a film 0.1 mm thick: G = 0.2, 0.24, 0.22 MPa, whatever the thickness was."""
    runs = walked((10.0, 12.0, 11.0))
    found = of_runs(runs)
    assert found.names == (LN_MODULUS,)
    assert found.labels == ("strip-0", "strip-1", "strip-2")
    np.testing.assert_allclose(np.exp(found.values[:, 0]), (2e5, 2.4e5, 2.2e5), rtol=0.03)
    for run, covariance in zip(runs, found.covariances, strict=True):
        assert covariance[0, 0] == pytest.approx(np.var(run.draws()[:, 0], ddof=1), rel=1e-3)
    told = population(found).summary()
    assert told["modulus_MPa"]["mean"]["mean"] == pytest.approx(0.22, rel=0.25)
    assert set(told["parameters"]["ln_modulus"]["specimens"]) == set(found.labels)
    with pytest.raises(SettingsError, match="coordinate"):
        of_runs(runs, ["bend"])


def test_the_band_of_the_next_curve_is_that_of_its_modulus() -> None:
    """A neo-Hookean strip: F = G d width (l - l^-2), so that every quantile of F is one of G."""
    runs = walked((10.0, 12.0, 11.0))
    found = population_of_runs(runs)
    curve = found.next_curve
    assert curve is not None
    assert not curve.without_form
    stretch = 1 + curve.deflection / STRIP.length
    unit = STRIP.width * 1e-4 * (stretch - stretch**-2)
    for theta, band in ((found.following, curve.curve), (found.mean, curve.middle)):
        modulus = np.exp(theta[:, 0])
        for q, force in zip((0.05, 0.5, 0.95), band, strict=True):
            at = force / unit
            assert at == pytest.approx(at[0], rel=1e-9)
            share = np.mean(modulus < at[0])
            assert abs(share - q) < 5.5 * np.sqrt(q * (1 - q) / 400)
    assert np.all(curve.reading[2] > curve.curve[1])
    assert np.all(curve.lost == 0)
    assert [label for label, *_ in curve.tested] == list(found.specimens.labels)
    for (_, at, force), c1 in zip(curve.tested, (10.0, 12.0, 11.0), strict=True):  # as if all were 0.1 mm thick
        stretch = 1 + at / STRIP.length
        assert force == pytest.approx(STRIP.width * 2 * c1 * (stretch - stretch**-2), rel=0.2, abs=0.1)
    told = found.summary()["next_curve"]
    assert told["force_N"]["q95"] == curve.curve[2].tolist()


def test_what_is_not_pooled_is_that_of_a_tested_specimen() -> None:
    """Only the modulus is pooled: the shape of the next curve is one that was calibrated."""
    how = RunSettings(settings=Settings(ess=1e6, walkers=16, chunk=60, most_steps=60))
    claim = hypothesis("mooney_rivlin", convexity="none")
    runs = [
        sample(made(STRIP, "mooney_rivlin", (c, 0.5 * c), seed=i, specimen=f"strip {i}"), claim, how)
        for i, c in enumerate((10.0, 11.0))
    ]
    found = population_of_runs(runs, ["ln_modulus"])
    curve = found.next_curve
    assert curve is not None
    share = np.concatenate([run.draws()[:, 1] for run in runs])
    stretch = 1 + curve.deflection[-1] / STRIP.length
    shape = (stretch - stretch**-2) * ((1 - share) + share / stretch)  # of G d (1 - s, s) / 2
    force = STRIP.width * 1e-4 * np.exp(found.following[:, [0]]) * shape[::7]  # every modulus with every shape
    for q, at in zip((0.05, 0.5, 0.95), curve.curve[:, -1], strict=True):
        assert abs(np.mean(force < at) - q) < 5.5 * np.sqrt(q * (1 - q) / 400)


def test_what_makes_no_population_is_said() -> None:
    with pytest.raises(SettingsError, match="two specimens"):
        specimens(np.zeros((1, 1)), np.ones((1, 1)))
    with pytest.raises(SettingsError, match="no run"):
        of_runs([])
    (run,) = walked((10.0,))
    with pytest.raises(SettingsError, match="of the same readings"):
        of_runs([run, run])
    with pytest.raises(SettingsError, match="do not go together"):
        specimens(np.full((2, 1), np.nan), np.ones((2, 1)))
    assert isinstance(population(specimens(np.zeros((2, 1)), np.ones((2, 1)))), Population)
