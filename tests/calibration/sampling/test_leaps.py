"""Chains proposed by a mixture: exact whatever it is, mended where it is bad, continued as if never stopped."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import kstest, norm, truncnorm

from bayesmembrane.calibration.posterior import Evaluation, Outcome, Outcomes, Posterior
from bayesmembrane.calibration.run import RunSettings, sample
from bayesmembrane.calibration.sampling import walk
from bayesmembrane.calibration.sampling.chains import Chains
from bayesmembrane.calibration.sampling.leaps import BLOCK, blocks, leap, mended, offers
from bayesmembrane.calibration.sampling.proposals.mixture import Mixture
from bayesmembrane.calibration.sampling.segments import Segments
from bayesmembrane.calibration.sampling.walk import Meanwhile, Sampled, Settings, run_ensembles
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.uniaxial import Uniaxial


class Cut:
    """x1 is N(0, 1) above -1, and x2 given it is N(sin x1, 0.5^2)."""

    size = readings = 2

    def evaluate(self, x: np.ndarray) -> Evaluation:
        out = x[:, 0] < -1.0
        lp = np.where(out, -np.inf, self.given(x, x))
        return Evaluation(np.zeros(len(x)), lp, np.where(out, Outcome.NOT_CONVEX, Outcome.OK), x)

    def given(self, force: np.ndarray, x: np.ndarray) -> np.ndarray:
        value = norm.logpdf(force[:, 0]) + norm.logpdf(force[:, 1], np.sin(force[:, 0]), 0.5)
        return np.asarray(value)


def mixture(spread: float = 1.3, degrees: float = 10.0) -> Mixture:
    return Mixture(np.zeros(1), np.zeros((1, 2)), spread * np.eye(2)[None], degrees)


def begin(seed: int, g: Mixture, walkers: int = 16) -> Chains:
    x = np.abs(np.random.default_rng(seed).standard_normal((2, walkers, 2)))
    lp = np.stack([Cut().evaluate(e).log_posterior for e in x])
    states = tuple(np.random.RandomState(np.random.MT19937([seed, e])).get_state() for e in range(2))
    return Chains(x[:, None], lp[:, None], states, Outcomes(), 0.0, mixture=g, offered=np.full((2, 1, walkers), np.nan))


def test_leaps_are_exact() -> None:
    """Draws a long way apart have the distribution that is known, and the mean weight is its integral."""
    found = leap(Cut(), mixture(), begin(1, mixture()), 8000, Outcomes())  # type: ignore[arg-type]
    x = found.x[:, 100::60].reshape(-1, 2)
    assert kstest(x[:, 0], truncnorm(-1.0, np.inf).cdf).pvalue > 1e-5
    assert kstest((x[:, 1] - np.sin(x[:, 0])) / 0.5, norm.cdf).pvalue > 1e-5
    judged = offers(replace(begin(1, mixture()), offered=found.offered))
    assert judged.log_mean == pytest.approx(norm.logsf(-1.0), abs=5 * judged.log_mean_sd)
    assert judged.log_mean_sd < 0.01


def test_what_is_refused_stays_where_it_was() -> None:
    found = leap(Cut(), mixture(3.0), begin(2, mixture(3.0)), 40, Outcomes())  # type: ignore[arg-type]
    moved = np.any(found.x[:, 1:] != found.x[:, :-1], axis=-1)
    assert 0.05 < moved.mean() < 0.9
    assert np.array_equal(found.log_posterior[:, 1:] != found.log_posterior[:, :-1], moved)
    flat = found.x.reshape(-1, 2)
    assert np.allclose(found.log_posterior.ravel(), Cut().evaluate(flat).log_posterior, rtol=1e-12)
    assert not np.any(flat[:, 0] < -1.0)


def test_blocks_end_at_multiples() -> None:
    assert blocks(1.0) == BLOCK
    assert blocks(BLOCK + 0.1) == 2 * BLOCK
    assert blocks(3 * BLOCK) == 3 * BLOCK


@pytest.mark.parametrize("stopped_after", [1, 3])
def test_stopped_and_continued_equals_never_stopped(stopped_after: int) -> None:
    settings, g = Settings(ess=1e9, chunk=BLOCK, most_steps=6 * BLOCK), mixture()
    whole = run_ensembles(Cut(), settings, 0, chains=begin(4, g))  # type: ignore[arg-type]
    calls: list[int] = []

    def stop() -> bool:
        calls.append(1)
        return len(calls) > stopped_after

    first = run_ensembles(Cut(), settings, 0, chains=begin(4, g), beside=Meanwhile(stop=stop))  # type: ignore[arg-type]
    assert first.status == "interrupted"
    assert first.chains.steps == stopped_after * BLOCK
    rest = run_ensembles(Cut(), settings, 0, chains=first.chains)  # type: ignore[arg-type]
    assert np.array_equal(rest.chains.x, whole.chains.x)
    assert np.array_equal(rest.chains.offered, whole.chains.offered, equal_nan=True)  # type: ignore[arg-type]


NARROW = Mixture(np.zeros(1), np.zeros((1, 2)), 0.25 * np.eye(2)[None], 50.0)
"""Proposals that are far too narrow look well at first; their weights say so."""


def narrow() -> Chains:
    return replace(begin(5, NARROW, 32), look=10 * BLOCK)


def is_cut(found: Sampled) -> None:
    """Of the two coordinates the mean, and what part lies where the narrow mixture hardly comes."""
    x = found.chains.x[:, found.convergence.burn :, :, 0]
    first, sure = truncnorm(-1.0, np.inf), found.convergence.ess[0]
    assert x.mean() == pytest.approx(first.mean(), abs=5 * first.std() / np.sqrt(sure))
    assert x.std() == pytest.approx(first.std(), rel=0.1)
    tail = first.sf(1.5)
    assert np.mean(x > 1.5) == pytest.approx(tail, abs=5 * np.sqrt(tail * (1 - tail) / sure))


@pytest.fixture(scope="module")
def whole() -> tuple[Sampled, list[Chains]]:
    """What a narrow mixture comes to, and what was kept on the way."""
    kept: list[Chains] = []
    how = Settings(ess=1000)
    return run_ensembles(Cut(), how, 0, chains=narrow(), beside=Meanwhile(kept.append)), kept  # type: ignore[arg-type]


def test_a_mixture_that_holds_walkers_up_is_mended_where_it_does(whole: tuple[Sampled, list[Chains]]) -> None:
    found, kept = whole
    assert found.status == "converged"
    assert found.chains.mixture is not None
    assert len(found.chains.mixture.means) > 1
    assert offers(found.chains).good
    assert found.convergence.burn >= found.chains.learned >= 10 * BLOCK
    # Every segment has steps of one mixture, and the first one those of the narrow one.
    sizes = [len(p.mixture.means) for p in kept if p.mixture is not None]
    assert sizes == sorted(sizes)
    assert sizes[0] == 1 < sizes[-1]
    is_cut(found)


@pytest.mark.parametrize("stopped_after", [10, *(pytest.param(n, marks=pytest.mark.study) for n in (9, 11, 14))])
def test_stopped_around_a_mending_and_continued_equals_never_stopped(
    stopped_after: int, whole: tuple[Sampled, list[Chains]]
) -> None:
    settings, (wanted, _) = Settings(ess=1000), whole
    left = iter(range(stopped_after))
    aside = Meanwhile(stop=lambda: next(left, None) is None)
    first = run_ensembles(Cut(), settings, 0, chains=narrow(), beside=aside)  # type: ignore[arg-type]
    assert first.status == "interrupted"
    rest = run_ensembles(Cut(), settings, 0, chains=first.chains)  # type: ignore[arg-type]
    assert rest.chains.lessons == wanted.chains.lessons
    assert np.array_equal(rest.chains.x, wanted.chains.x)
    assert offers(rest.chains) == offers(wanted.chains)


def test_a_bad_mixture_that_is_not_mended_is_left_to_emcee(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(walk, "MOST_MENDINGS", 0)
    kept: list[Chains] = []
    found = run_ensembles(Cut(), Settings(ess=400), 0, chains=narrow(), beside=Meanwhile(kept.append))  # type: ignore[arg-type]
    assert found.status == "converged"
    assert found.chains.mixture is None
    assert found.chains.lessons[0] >= 10 * BLOCK
    assert found.convergence.burn >= found.chains.lessons[0]
    assert [p.mixture is None for p in kept] == sorted(p.mixture is None for p in kept)
    is_cut(found)


def strip() -> Measurement:
    """A rubber band: no solver, so that a step takes a millisecond."""
    stretch = np.linspace(1.1, 2.5, 12)
    force = 100 * (stretch - stretch**-2) + np.random.default_rng(31).standard_normal(12)
    return Measurement(stretch, force, Uniaxial(), Specimen("band", 5e-4))


class KilledError(Exception):
    """Stands for the end of the process: nothing of the program handles it."""


def test_killed_anywhere_and_continued_equals_never_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """While starts are sought, a mixture is learned, and steps are proposed by it; what is stored says so."""
    monkeypatch.setattr(walk, "SAVE_AFTER", 0.0)
    how = RunSettings(3, settings=Settings(ess=6000.0), predictions=False)
    claim, evaluate, calls = hypothesis("gent"), Posterior.evaluate, Counter[str]()

    def counted(posterior: Posterior, x: np.ndarray) -> Evaluation:
        calls["made"] += 1
        if calls["made"] > calls["fatal"] > 0:
            raise KilledError
        return evaluate(posterior, x)

    monkeypatch.setattr(Posterior, "evaluate", counted)
    whole = sample(strip(), claim, replace(how, out=tmp_path / "whole"))
    assert whole.status["sampler"] == "mixture"
    wanted, needed = Segments(whole.path).read(), calls["made"]  # type: ignore[arg-type]
    for fatal in (needed // 2, needed - 4):
        calls.update({"made": -calls["made"], "fatal": fatal - calls["fatal"]})
        with pytest.raises(KilledError):
            sample(strip(), claim, replace(how, out=tmp_path / f"{fatal}"))
        calls["fatal"] = 0
        done = sample(strip(), claim, replace(how, out=tmp_path / f"{fatal}"))
        found = Segments(done.path).read()  # type: ignore[arg-type]
        assert np.array_equal(found.x, wanted.x)  # type: ignore[union-attr]
        assert np.array_equal(found.offered, wanted.offered, equal_nan=True)  # type: ignore[union-attr, arg-type]
        assert {**done.status, "seconds": 0} == {**whole.status, "seconds": 0}


def test_more_draws_go_on_with_the_same_mixture(tmp_path: Path) -> None:
    few = sample(strip(), hypothesis("neo_hookean"), RunSettings(5, tmp_path, ess=500.0, predictions=False))
    more = sample(strip(), hypothesis("neo_hookean"), RunSettings(5, tmp_path, ess=5000.0, predictions=False))
    a, b = Segments(few.path).read(), Segments(more.path).read()  # type: ignore[arg-type]
    assert a is not None
    assert b is not None
    assert b.steps > a.steps
    assert np.array_equal(b.x[:, : a.steps], a.x)
    assert more.status["importance"]["log_evidence_sd"] < few.status["importance"]["log_evidence_sd"]


@pytest.mark.parametrize(
    "material", ["gent", *(pytest.param(m, marks=pytest.mark.study) for m in ("neo_hookean", "mooney_rivlin"))]
)
def test_mixture_equals_emcee(material: str) -> None:
    """Means and spreads of all coordinates are those of emcee's walk, within six errors of the difference."""
    claim = hypothesis(material)
    runs = [
        sample(strip(), claim, RunSettings(seed, settings=Settings(ess=2000.0, sampler=sampler), predictions=False))
        for seed, sampler in ((7, "auto"), (8, "emcee"))
    ]
    assert [r.status["sampler"] for r in runs] == ["mixture", "emcee"]
    a, b = (r.draws() for r in runs)
    error = a.std(axis=0) * np.sqrt(sum(1 / r.status["ess_bulk"] for r in runs))
    assert np.all(np.abs(a.mean(axis=0) - b.mean(axis=0)) < 6 * error)
    assert np.all(np.abs(np.log(a.std(axis=0) / b.std(axis=0))) < 0.3)


class Sheet:
    """Three coordinates are N(0, 1), and two more are next to polynomials of those."""

    size = readings = 5

    def evaluate(self, x: np.ndarray) -> Evaluation:
        return Evaluation(np.zeros(len(x)), self.given(x, x), np.full(len(x), Outcome.OK), x)

    def given(self, force: np.ndarray, x: np.ndarray) -> np.ndarray:
        return np.asarray(np.sum(norm.logpdf(self.straight(force)), axis=1) - 2 * np.log(0.02))

    def straight(self, x: np.ndarray) -> np.ndarray:
        """All N(0, 1)."""
        a, b, c = x[:, :3].T
        bent = np.stack([0.3 * a * a - 0.1 * b * c, 0.3 * c * c + 0.05 * a**3], axis=1)
        return np.concatenate([x[:, :3], (x[:, 3:] - bent) / 0.02], axis=1)


def test_a_bent_valley_is_followed(tmp_path: Path) -> None:
    """Mixtures that are fitted to what walkers fill follow it along its bend, and are stored with that."""
    rng = np.random.default_rng(71)
    x = 0.2 * rng.standard_normal((2, 32, 5))
    g = Mixture(np.zeros(1), np.zeros((1, 5)), 0.7 * np.eye(5)[None], 5.0)
    lp = np.stack([Sheet().evaluate(e).log_posterior for e in x])
    states = tuple(np.random.RandomState(np.random.MT19937([71, e])).get_state() for e in range(2))
    offered = np.full((2, 1, 32), np.nan)
    begun = Chains(x[:, None], lp[:, None], states, Outcomes(), 0.0, mixture=g, offered=offered, look=10 * BLOCK)
    segments = Segments(tmp_path)
    segments.folder.mkdir()
    segments.write(begun)
    found = run_ensembles(Sheet(), Settings(ess=1000), 0, chains=begun, beside=Meanwhile(segments.write))  # type: ignore[arg-type]
    assert found.status == "converged"
    assert found.chains.mixture is not None
    assert found.chains.mixture.bend is not None
    every = int(3 * np.max(found.convergence.tau))
    z = Sheet().straight(found.chains.x[:, found.convergence.burn :: every].reshape(-1, 5))
    assert all(kstest(column, norm.cdf).pvalue > 1e-6 for column in z.T)
    stored = segments.read()
    assert stored is not None
    assert stored.mixture is not None
    u = rng.standard_normal((9, 5))
    assert np.array_equal(stored.mixture.bend.back(u), found.chains.mixture.bend.back(u))  # type: ignore[union-attr]
    assert np.array_equal(stored.mixture.bend.of(u), found.chains.mixture.bend.of(u))  # type: ignore[union-attr]


class Straight(Sheet):
    """What is only asked for its size."""

    size = 3


def test_a_narrow_straight_valley_is_fitted_as_it_is() -> None:
    """States that are moved a little, lest one place many times were a component, are moved along it."""
    rng = np.random.default_rng(72)
    root = np.linalg.cholesky(0.0001 * np.eye(3) + np.ones((3, 3)))
    x = rng.standard_normal((2, 100, 16, 3)) @ root.T
    wide = Mixture(np.zeros(1), np.zeros((1, 3)), np.eye(3)[None], 5.0)
    chains = Chains(x, np.zeros(x.shape[:3]), (), Outcomes(), 0.0, mixture=wide)
    found = mended(Straight(), chains)  # type: ignore[arg-type]
    assert found is not None
    assert found.bend is None
    z = rng.standard_normal((2000, 3)) @ root.T
    exact = Mixture(np.zeros(1), np.zeros((1, 3)), root[None], 1e6)
    assert np.mean(found.log_density(z)) > np.mean(exact.log_density(z)) - 0.4
