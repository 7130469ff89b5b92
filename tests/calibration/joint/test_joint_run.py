"""Joint runs: draws against an integral, storage, interruption, and what several tests are worth."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import bayesmembrane as bm
from bayesmembrane.calibration.joint.claim import Joint, joint
from bayesmembrane.calibration.joint.fit import fit_jointly
from bayesmembrane.calibration.joint.posterior import JointPosterior
from bayesmembrane.calibration.joint.run import JointRun, sample_jointly
from bayesmembrane.calibration.run import RunSettings
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import Hypothesis, hypothesis
from bayesmembrane.physics.rigs.biaxial import Biaxial
from tests.calibration.joint.tests_of import SHEET, STRIP, made

FEW = Settings(ess=1e6, walkers=16, chunk=40, most_steps=80)


def stated_only(name: str) -> Hypothesis:
    return hypothesis(name, extra_noise=False)


def test_draws_of_two_strips_are_those_of_the_integral() -> None:
    a, b = made(STRIP, "neo_hookean", (10.0,), seed=5, noise=0.03), made(STRIP, "neo_hookean", (10.0,), seed=6)
    both = joint([a, b], stated_only("neo_hookean"))
    run = sample_jointly(both, RunSettings(ess=1500))
    posterior, x = JointPosterior(both), run.draws()[:, 0]
    grid = np.linspace(x.mean() - 8 * x.std(), x.mean() + 8 * x.std(), 2001)
    lp = posterior.evaluate(grid[:, None]).log_posterior
    p = np.exp(lp - np.max(lp))
    p /= p.sum()
    mean = float(p @ grid)
    sd = float(np.sqrt(p @ (grid - mean) ** 2))
    ess = float(run.status["ess_bulk"])
    assert abs(x.mean() - mean) < 6 * sd / np.sqrt(min(ess, x.size))
    assert abs(np.log(x.std() / sd)) < 6 / np.sqrt(min(ess, x.size))


def test_one_measurement_twice_has_half_the_variance() -> None:
    m = made(STRIP, "mooney_rivlin", (8.0, 2.0), seed=3)
    claim = stated_only("mooney_rivlin")
    again = replace(m, full_range=1.01 * m.full_range)  # the same file twice is refused
    once, twice = (JointPosterior(joint(ms, claim)) for ms in ([m], [m, again]))
    at = fit_jointly(once.joint).coordinates

    def precision(p: JointPosterior) -> np.ndarray:
        h = 1e-3 * np.eye(2)
        corners = [at + s * h[i] + t * h[j] for i in range(2) for j in range(2) for s in (1, -1) for t in (1, -1)]
        values = p.log_likelihood(np.array(corners)).reshape(2, 2, 4)
        return -(values @ np.array([1.0, -1.0, -1.0, 1.0])) / 4e-6

    variance_once, variance_twice = (np.linalg.inv(precision(p)) for p in (once, twice))
    np.testing.assert_allclose(variance_twice, 0.5 * variance_once, rtol=1e-6)


def test_membrane_strip_and_biaxial_sheet_cut_each_other_s_valleys(film: Callable[..., Measurement]) -> None:
    """Along the direction that a test leaves most open, all tests together leave less."""
    disc = film("mooney_rivlin", (8.0, 2.0), noise=0.02, stated=True, seed=4)
    strip = made(STRIP, "mooney_rivlin", (16.0, 4.0), thickness=5e-5, seed=5, noise=0.02)
    l1, l2 = np.linspace(1.1, 1.6, 6), np.linspace(1.05, 1.2, 6)
    rig = Biaxial()
    x, across = rig.length * (np.concatenate([l1, l2]) - 1), np.concatenate([l2, l1])
    clean = Measurement(x, np.ones(12), rig, disc.specimen, across=across)
    force = Forward(hypothesis("mooney_rivlin"), clean, x).film_force(np.array([[8.0, 2.0]]))[0]
    sd = 0.02 * float(np.max(force))
    noisy = force + sd * np.random.default_rng(6).standard_normal(12)
    sheet = Measurement(x, noisy, rig, disc.specimen, across=across, force_sd=np.full(12, sd))
    tests = {"disc": disc, "strip": strip, "sheet": sheet}
    claim = hypothesis("mooney_rivlin")
    together = fit_jointly(joint(tests, claim))
    for label, m in tests.items():
        alone = fit_jointly(joint({label: m}, claim))
        _, vectors = np.linalg.eigh(alone.covariance)
        open_ = vectors[:, -1]
        assert open_ @ together.covariance @ open_ < 0.7 * open_ @ alone.covariance @ open_
    values = np.array([v for v, _ in together.parameters.values()])
    sds = np.array([s for _, s in together.parameters.values()], dtype=float)
    assert np.all(np.abs(values - (8.0, 2.0)) < 6 * sds)


def small() -> Joint:
    tests = {"strip": made(STRIP, "neo_hookean", (10.0,), seed=1), "sheet": made(SHEET, "neo_hookean", (10.0,), seed=2)}
    return joint(tests, hypothesis("neo_hookean", ["zero_offset"]))


def test_a_mixture_equals_ensembles() -> None:
    """Means and standard deviations by both, in standard errors of independent draws."""
    settings = {"ess": 3000.0, "ensembles": 2}
    runs = [
        sample_jointly(small(), RunSettings(seed=7, settings=Settings(sampler=s, **settings), predictions=False))  # type: ignore[arg-type]
        for s in ("auto", "emcee")
    ]
    assert [r.status["sampler"] for r in runs] == ["mixture", "emcee"]
    (a, b), n = (r.draws() for r in runs), 3000
    sd = np.hypot(np.std(a, axis=0), np.std(b, axis=0))
    assert np.all(np.abs(np.mean(a, axis=0) - np.mean(b, axis=0)) < 5.5 * sd / np.sqrt(n))
    # ln of a standard deviation of n normal draws is off by 1 / sqrt(2 n); tails of noises are longer.
    assert np.all(np.abs(np.log(np.std(a, axis=0) / np.std(b, axis=0))) < 8 / np.sqrt(n))


@pytest.mark.parametrize(("sampler", "asked"), [("emcee", 30), ("auto", 1)])
def test_a_run_that_was_stopped_ends_with_the_same_draws(tmp_path: Path, sampler: str, asked: int) -> None:
    """Ensembles are asked after every step, a mixture after every block of them."""
    few = replace(FEW, sampler=sampler)
    whole = sample_jointly(small(), RunSettings(settings=few))
    assert whole.status["sampler"] == ("emcee" if sampler == "emcee" else "mixture")
    left = iter(range(asked))
    how = RunSettings(settings=few, out=tmp_path, predictions=False)
    stopped = sample_jointly(small(), how, stop=lambda: next(left, None) is None)
    assert stopped.interrupted
    assert 0 < stopped.status["steps"] < whole.status["steps"]
    found = sample_jointly(small(), how)
    assert not found.interrupted
    np.testing.assert_array_equal(found.x, whole.x)
    np.testing.assert_array_equal(found.log_posterior, whole.log_posterior)


@pytest.mark.usefixtures("blank_pictures")
def test_a_stored_run_is_read_back_and_shown_with_the_band_of_every_test(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    how = RunSettings(settings=FEW, out=tmp_path)
    made_ = sample_jointly(small(), how)
    assert made_.folder is not None
    monkeypatch.setattr("bayesmembrane.calibration.joint.run._walked", lambda *_: pytest.fail("walked again"))
    again = sample_jointly(small(), how)
    np.testing.assert_array_equal(again.x, made_.x)
    assert again.summary() == made_.summary()
    stored = bm.load(made_.folder)
    assert isinstance(stored[made_.folder.name, "joint"], JointRun)
    assert {(label, "run") for label in ("strip", "sheet")} <= set(stored)
    page = bm.report(made_.folder, out=tmp_path / "page").read_text()
    shift = "strip: offset of the deflection zero, shift"
    for words in ("Several tests together", shift, "sheet: extra noise", "joint posterior predicts"):
        assert words in page
    document = bm.as_dict(made_)
    assert set(document["tests"]) == {"strip", "sheet"}
    assert {"c1", "strip.zero_offset.shift", "sheet.noise.sd"} <= set(document["posterior"])


def test_the_door_takes_several_measurements() -> None:
    tests = [p.measurement for p in small().parts]
    found = bm.fit(tests, bm.hypothesis("neo_hookean"))
    assert found.joint.labels == ("strip", "strip-2")
    assert found.parameters["c1"][0] == pytest.approx(10.0, rel=0.02)
    assert "strip and strip-2 together" in repr(found)
    with pytest.raises(bm.SettingsError, match="one measurement has one hypothesis"):
        bm.fit(tests[0], {"a": bm.hypothesis("neo_hookean")})  # type: ignore[call-overload]
