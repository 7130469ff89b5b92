"""Sampling: exact on normal distributions, honest about what is not converged, and continued as if never stopped."""

from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import truncnorm

from bayesmembrane.calibration.posterior import Evaluation, Outcome
from bayesmembrane.calibration.sampling.chains import Chains
from bayesmembrane.calibration.sampling.convergence import convergence
from bayesmembrane.calibration.sampling.walk import Progress, Settings, run_ensembles
from bayesmembrane.ground.errors import SettingsError

MEAN = np.array([1.0, -2.0, 3.0])
ROOT = np.array([[1.0, 0.0, 0.0], [0.9, 0.3, 0.0], [-0.5, 0.2, 0.01]])
COVARIANCE = ROOT @ ROOT.T


class Normal:
    """A posterior that is known: N(MEAN, COVARIANCE), a long thin cigar."""

    size = readings = 3

    def __init__(self, stop_after: int | None = None) -> None:
        self.calls, self.stop_after = 0, stop_after

    def evaluate(self, x: np.ndarray) -> Evaluation:
        self.calls += 1
        if self.calls == self.stop_after:
            raise KeyboardInterrupt
        z = np.linalg.solve(ROOT, (x - MEAN).T).T
        return Evaluation(np.zeros(len(x)), self.given(z, x), np.full(len(x), Outcome.OK, np.int8), z)

    def given(self, force: np.ndarray, x: np.ndarray) -> np.ndarray:
        return -0.5 * np.sum(force**2, axis=1)


class Banana(Normal):
    """y = x2 + 2 sin(x1) is N(0, 0.3^2) and x1 is N(0, 1): no polynomial of the emulator's degrees is exact."""

    size = readings = 2

    def evaluate(self, x: np.ndarray) -> Evaluation:
        y = np.stack([x[:, 0], (x[:, 1] + 2 * np.sin(x[:, 0])) / 0.3], axis=1)
        ruled_out = x[:, 0] < -1.0
        value = np.where(ruled_out, -np.inf, self.given(y, x))
        return Evaluation(np.zeros(len(x)), value, np.where(ruled_out, Outcome.NOT_CONVEX, Outcome.OK), y)


def start(posterior: Normal, seed: int = 0, walkers: int = 32, spread: float = 2.0) -> Chains:
    rng = np.random.default_rng(seed)
    x = MEAN + spread * rng.standard_normal((2, walkers, 3)) @ ROOT.T
    lp = np.stack([Normal().evaluate(e).log_posterior for e in x])
    states = tuple(np.random.RandomState(np.random.MT19937(seed + e)).get_state() for e in range(2))
    return Chains(x[:, None], lp[:, None], states, Counter(), 0.0)


def test_mean_and_covariance_are_exact() -> None:
    target = Normal()
    found = run_ensembles(target, Settings(ess=3000), 0, chains=start(target))  # type: ignore[arg-type]
    c = found.convergence
    assert found.status == "converged"
    assert c.enough(3000)
    assert c.lengths >= 50
    assert np.max(c.r_hat) <= 1.01
    x = found.chains.x[:, c.burn :].reshape(-1, 3)
    sd = np.sqrt(np.diag(COVARIANCE))
    error = np.abs(x.mean(0) - MEAN) / (sd / np.sqrt(c.ess))
    assert np.all(error < 4)
    assert np.max(np.abs(np.cov(x.T) - COVARIANCE) / np.outer(sd, sd)) < 0.1
    assert 0.1 < c.acceptance < 0.9


def test_what_the_emulator_gets_wrong_the_posterior_puts_right() -> None:
    """Moments of a truncated sine valley, which walks on a polynomial follow badly, are exact all the same."""
    rng = np.random.default_rng(3)
    x = np.abs(rng.standard_normal((2, 32, 2))) * 0.3
    states = tuple(np.random.RandomState(np.random.MT19937(e)).get_state() for e in range(2))
    lp = np.stack([Banana().evaluate(e).log_posterior for e in x])
    chains = Chains(x[:, None], lp[:, None], states, Counter(), 0.0)
    found = run_ensembles(Banana(), Settings(ess=1500), 0, chains=chains)  # type: ignore[arg-type]
    assert found.status == "converged"
    assert found.chains.lessons
    c = found.convergence
    draws = found.chains.x[:, c.burn :].reshape(-1, 2)
    first = truncnorm(-1.0, np.inf)
    assert draws[:, 0].mean() == pytest.approx(first.mean(), abs=4 * first.std() / np.sqrt(c.ess[0]))
    assert draws[:, 0].std() == pytest.approx(first.std(), rel=0.05)
    across = draws[:, 1] + 2 * np.sin(draws[:, 0])
    assert across.mean() == pytest.approx(0.0, abs=0.03)
    assert across.std() == pytest.approx(0.3, rel=0.06)


@pytest.mark.study
def test_ess_predicts_the_scatter_of_means() -> None:
    """The variance of the mean over independent runs is that of the posterior over ESS."""
    errors = []
    for seed in range(5):
        target = Normal()
        found = run_ensembles(
            target, Settings(ess=100, chunk=300, most_steps=300), seed, chains=start(target, 100 + seed)
        )  # type: ignore[arg-type]
        x = found.chains.x[:, found.convergence.burn :].reshape(-1, 3)
        errors.append((x.mean(0) - MEAN) / np.sqrt(np.diag(COVARIANCE) / found.convergence.ess))
    assert 0.5 < np.sqrt(np.mean(np.square(errors))) < 1.7


def test_a_step_limit_is_told() -> None:
    target = Normal()
    found = run_ensembles(target, Settings(ess=1e6, chunk=50, most_steps=120), 0, chains=start(target))  # type: ignore[arg-type]
    assert found.status == "step limit"
    assert found.chains.steps == 120
    assert not found.convergence.enough(1e6)


def test_ensembles_in_different_valleys_do_not_pass() -> None:
    """Walkers that never meet: each ensemble is happy, together they are not."""
    rng = np.random.default_rng(0)
    x = rng.standard_normal((2, 4000, 32, 2))
    x[1] += 5.0
    c = convergence(Chains(x, x[..., 0], (), Counter(), 0.0))
    assert np.all(c.r_hat > 1.5)
    assert not c.enough(100)
    x[1] -= 5.0
    assert convergence(Chains(x, x[..., 0], (), Counter(), 0.0)).enough(100)


def test_tau_of_a_known_process() -> None:
    """AR(1) walkers with coefficient a have tau = (1 + a) / (1 - a)."""
    rng, a = np.random.default_rng(1), 0.8
    x = np.zeros((2, 6000, 16, 1))
    for t in range(1, 6000):
        x[:, t] = a * x[:, t - 1] + rng.standard_normal((2, 16, 1))
    c = convergence(Chains(x, x[..., 0], (), Counter(), 0.0))
    assert c.tau[0] == pytest.approx(9.0, rel=0.15)
    assert c.ess[0] == pytest.approx(2 * (6000 - c.burn) * 16 / c.tau[0], rel=0.1)


def test_interrupted_and_continued_is_never_stopped() -> None:
    settings = Settings(ess=500, chunk=100)
    whole = run_ensembles(Normal(), settings, 0, chains=start(Normal()))  # type: ignore[arg-type]
    assert whole.status == "converged"
    broken = run_ensembles(Normal(stop_after=450), settings, 0, chains=start(Normal()))  # type: ignore[arg-type]
    assert broken.status == "interrupted"
    assert 1 < broken.chains.steps < whole.chains.steps
    resumed = run_ensembles(Normal(), settings, 0, chains=broken.chains)  # type: ignore[arg-type]
    assert resumed.status == "converged"
    assert np.array_equal(resumed.chains.x, whole.chains.x)


def test_an_interruption_at_once_is_survived_in_silence(capsys: pytest.CaptureFixture[str]) -> None:
    """Ctrl-C amid a solution is what a user asked for, and no failure that a traceback explains."""
    found = run_ensembles(Normal(stop_after=3), Settings(), 0, chains=start(Normal()))  # type: ignore[arg-type]
    assert capsys.readouterr() == ("", "")
    assert found.status == "interrupted"
    assert found.chains.steps == 1
    x, lp = found.draws(1000)
    assert x.shape == (2, 32, 3)
    assert lp.shape == (2, 32)


@pytest.mark.parametrize("most", [10, 19, 2000])
def test_looks_that_come_before_anything_is_known(most: int) -> None:
    """Before 20 steps there is neither tau nor ESS: nothing is foretold, and the walk goes on."""
    told: list[Progress] = []
    target = Normal()
    how = Settings(ess=500, chunk=10, most_steps=most)
    found = run_ensembles(target, how, 0, told.append, start(target))  # type: ignore[arg-type]
    assert found.status == ("converged" if most == 2000 else "step limit")
    assert (told[0].steps, told[0].ess) == (10, 0.0)
    assert np.isnan(told[0].seconds_left)
    assert all(np.isfinite(p.seconds_left) for p in told if p.steps >= 20)


def test_progress_tells_what_is_left() -> None:
    seen: list[Progress] = []
    target = Normal()
    run_ensembles(target, Settings(ess=2000, chunk=50), 0, seen.append, start(target))  # type: ignore[arg-type]
    assert [p.steps for p in seen] == sorted(p.steps for p in seen)
    assert seen[-1].ess >= 2000
    assert seen[-1].seconds_left == 0.0
    assert seen[0].seconds_left > 0.0


def test_draws_are_thinned_evenly() -> None:
    x = np.arange(2 * 100 * 8 * 1, dtype=float).reshape(2, 100, 8, 1)
    fake = SimpleNamespace(burn=20)
    chains = Chains(x, x[..., 0], (), Counter(), 0.0)
    from bayesmembrane.calibration.sampling.walk import Sampled

    draws, lp = Sampled(chains, fake, "converged").draws(160)  # type: ignore[arg-type]
    assert draws.shape == (2, 80, 1)
    assert np.array_equal(draws[..., 0], lp)
    assert draws.min() >= 20 * 8
    assert draws[0, -1, 0] == x[0, -1, -1, 0]
    few, _ = Sampled(chains, fake, "converged").draws(6)  # type: ignore[arg-type]
    assert few.shape == (2, 3, 1)


def test_settings_make_sense() -> None:
    for wrong in ({"ess": 0}, {"ensembles": 1}, {"chunk": 5}, {"most_steps": 10}):
        with pytest.raises(SettingsError):
            replace(Settings(), **wrong)  # type: ignore[arg-type]
