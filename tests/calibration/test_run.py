"""Runs: exact on a linear case, recovery on curves of another solver, stored, read back, continued, and refused."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm

from bayesmembrane.calibration import run as run_module
from bayesmembrane.calibration.run import Run, RunSettings, load_run, run_folders, sample
from bayesmembrane.calibration.sampling.walk import Progress, Settings
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.registry import material
from bayesmembrane.ground.sealed import write_json
from bayesmembrane.ground.stored import read, store
from bayesmembrane.physics.cache import CachedSolver
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics import request, solve
from bayesmembrane.words.sampling import sentences
from tests.physics.predicting import predict


def test_a_linear_posterior_is_exact(film) -> None:  # type: ignore[no-untyped-def]
    """F = c1 F(1) with a known noise: c1 ~ N(c, s^2 / <F, F>), times a prior that is flat on that scale."""
    noise = 0.02
    curve = film("neo_hookean", (7.5,), noise=noise, seed=21, stated=True)
    unit = solve(request(material("neo_hookean"), [1.0], curve.deflection, 0.01, 0.035)).force[0]
    mean, sd = unit @ curve.force / (unit @ unit), noise / np.sqrt(unit @ unit)
    run = sample(curve, hypothesis("neo_hookean", extra_noise=False), RunSettings(seed=1))
    answer = run.summary()["posterior"]["c1"]
    assert run.status["status"] == "converged"
    assert abs(answer["mean"] - mean) < 5 * sd / np.sqrt(run.status["ess_bulk"])
    assert answer["sd"] == pytest.approx(sd, rel=0.08)
    low, high = norm(mean, sd).interval(0.94)
    assert answer["hdi_94"] == pytest.approx([low, high], abs=0.3 * sd)
    assert run.path is None
    assert 0 < run.status["goodness"]["reduced_chi2"] < 4


@pytest.mark.parametrize(("name", "parameters"), [("yeoh", (8.0, -0.2, 0.03)), ("gent", (5.3, 30.0))])
def test_the_truth_is_recovered_with_a_noise_of_its_own(film, name: str, parameters: tuple[float, ...]) -> None:  # type: ignore[no-untyped-def]
    curve = film(name, parameters, noise=0.01, seed=33, points=20)
    run = sample(curve, hypothesis(name), RunSettings(seed=2))
    for field, truth in zip(material(name).field_names(), parameters, strict=True):
        answer = run.status["posterior"][field]
        assert abs(answer["mean"] - truth) < 3.5 * answer["sd"]
        assert answer["sd"] < 0.2 * abs(truth)
    assert run.status["posterior"]["noise.sd"]["mean"] == pytest.approx(0.01, rel=0.6)
    assert run.status["ess_bulk"] >= 1000
    assert run.status["r_hat"] <= 1.01
    assert run.status["crosscheck"]["largest"] < 1e-6
    assert run.status["prior_mass"]["none"]["value"] == 1.0
    assert not sentences(run.quality)


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Run:
    from bayesmembrane.data.measurement import Measurement, Specimen
    from bayesmembrane.physics.rigs.annulus import Annulus

    d = np.linspace(5e-3, 50e-3, 10)
    force = solve(request(material("gent"), [5.3, 30.0], d, 0.01, 0.035)).force[0]
    force += 0.01 * np.random.default_rng(4).standard_normal(10)
    a = np.random.default_rng(5).standard_normal((10, 10))
    curve = Measurement(
        d, force, Annulus(0.01, 0.035), Specimen("Film No. 1", 5e-5), covariance=1e-6 * (a @ a.T) + 2.5e-5 * np.eye(10)
    )
    out = tmp_path_factory.mktemp("chains")
    return sample(curve.up_to(35e-3), hypothesis("gent"), RunSettings(seed=7, out=out))


def test_a_run_is_read_back_as_it_was(stored: Run) -> None:
    assert stored.path is not None
    assert stored.name.startswith("film-no-1_gent_35mm_")
    again = load_run(stored.path)
    assert again.status == json.loads(json.dumps(stored.status))
    assert again.hypothesis == stored.hypothesis == hypothesis("gent")
    assert again.measurement.data_hash == stored.measurement.data_hash == again.settings["data"]["sha256"]
    assert again.measurement.full_range == 50e-3
    assert np.array_equal(again.draws(), stored.draws())
    assert np.array_equal(again.curves(), stored.curves())
    json.dumps(again.summary(), allow_nan=False)
    names = {"run.toml", "posterior.nc", "status.json", "predictions.nc", "segments"}
    assert {p.name for p in stored.path.iterdir()} == names
    assert again.quality == stored.quality


def test_an_answer_that_rests_on_a_run_finds_it_again(stored: Run, tmp_path: Path) -> None:
    """Also where both folders have moved; but not once other draws lie there."""
    assert stored.path is not None
    moved = tmp_path / "one" / "run"
    shutil.copytree(stored.path, moved)
    store(tmp_path / "one" / "answer", "loop", load_run(moved), {})
    (tmp_path / "one").rename(tmp_path / "other")
    again = read(tmp_path / "other" / "answer", "loop")
    assert again.path.resolve() == (tmp_path / "other" / "run").resolve()
    assert np.array_equal(again.draws(), stored.draws())
    status = tmp_path / "other" / "run" / "status.json"
    write_json(status, {**stored.status, "evaluations": 1}, "the run")
    with pytest.raises(StorageError, match="sampled anew"):
        read(tmp_path / "other" / "answer", "loop")
    with pytest.raises(StorageError, match="is not stored"):
        store(tmp_path / "answer", "loop", replace(stored, path=None), {})


def test_inference_data_is_complete(stored: Run) -> None:
    data = stored.data  # as arviz has it
    groups = {"posterior", "prior", "log_likelihood", "posterior_predictive", "observed_data", "sample_stats"}
    assert groups <= set(data.groups())
    names = {*stored.hypothesis.names, *stored.hypothesis.natural_names}
    assert set(data.posterior.data_vars) == set(data.prior.data_vars) == names
    assert data.posterior.sizes["chain"] == 2  # an ensemble is a chain
    count = data.posterior.sizes["chain"] * data.posterior.sizes["draw"]
    assert 1000 <= count <= 4000
    x = stored.draws()
    assert x.shape == (count, 3)
    natural = stored.hypothesis.natural(x, stored.measurement)
    assert data.posterior["gent.c1"].values.ravel() == pytest.approx(natural[:, 0])
    p = predict(stored.hypothesis, x, stored.measurement)
    assert stored.curves() == pytest.approx(p.force, rel=1e-6)
    assert np.all(p.convexity >= 0)
    noise = stored.hypothesis.noise.bind(stored.measurement)
    pointwise = noise.pointwise(stored.measurement.force - p.force, stored.hypothesis.noise_coordinates(x))
    assert data.log_likelihood["force"].values.reshape(count, -1) == pytest.approx(pointwise, rel=1e-4, abs=1e-4)


def test_runs_are_found_in_the_folder_that_holds_them(stored: Run, tmp_path: Path) -> None:
    assert stored.path is not None
    assert run_folders(stored.path.parent) == run_folders(stored.path) == [stored.path]
    assert run_folders(tmp_path) == [tmp_path]


def test_the_whole_walk_is_stored_in_means(stored: Run) -> None:
    """Burn-in included, thinned; and the measurement is read back without it."""
    means, steps = (stored.data.constant_data[n].values for n in ("ensemble_mean", "ensemble_step"))
    assert means.shape == (2, steps.size, 3)
    assert steps.size <= 500
    assert (steps[0], steps[-1]) == (0, stored.status["steps"] - 1)
    kept = means[:, steps >= stored.status["burn"]].mean(axis=(0, 1))
    x = stored.draws()
    assert np.all(np.abs(kept - x.mean(axis=0)) < 0.3 * x.std(axis=0))


def test_what_the_cache_did_is_stored(film, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    curve = film("neo_hookean", (7.5,), noise=0.02, seed=1)
    short = Settings(ess=1.0, chunk=30, most_steps=30, sampler="emcee")  # a walk that the last digit does not change
    cached = CachedSolver()
    how = RunSettings(settings=short, predictions=False)
    first = sample(curve, hypothesis("neo_hookean"), replace(how, out=tmp_path), solve=cached)
    again = sample(curve, hypothesis("neo_hookean"), replace(how, seed=1), solve=cached)
    plain = sample(curve, hypothesis("neo_hookean"), RunSettings(settings=short))
    assert "cache" not in plain.status
    assert first.status["cache"]["misses"] > 0
    assert again.status["cache"]["misses"] == 0  # a film that is known already, whatever its modulus
    assert again.status["cache"]["hits"] > 0
    assert cached.tally.hits == first.status["cache"]["hits"] + again.status["cache"]["hits"]
    assert np.allclose(first.draws(), plain.draws(), rtol=1e-6)
    assert first.path is not None
    assert load_run(first.path).status["cache"] == first.status["cache"]


def test_a_finished_run_is_not_sampled_again(stored: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def forbidden(*_: object) -> None:
        raise AssertionError("sampled again")

    monkeypatch.setattr(run_module, "run_ensembles", forbidden)
    assert stored.path is not None
    again = sample(stored.measurement, hypothesis("gent"), RunSettings(seed=7, out=stored.path.parent))
    assert again.status == load_run(stored.path).status


def test_a_foreign_folder_is_left_alone(stored: Run, tmp_path: Path) -> None:
    m = stored.measurement
    assert stored.path is not None
    with pytest.raises(StorageError, match="holds another run"):
        sample(m, hypothesis("gent"), RunSettings(seed=8, out=stored.path.parent, name=stored.name))
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("precious")
    with pytest.raises(StorageError, match="holds files that are no run"):
        sample(m, hypothesis("gent"), RunSettings(out=tmp_path, name="mine"))
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match="cannot be stored there"):
        sample(m, hypothesis("gent"), RunSettings(out=tmp_path / "file"))
    assert (tmp_path / "mine" / "thesis.tex").read_text() == "precious"


def test_damage_is_told(stored: Run, tmp_path: Path) -> None:
    assert stored.path is not None
    with pytest.raises(StorageError, match=r"run\.toml is missing"):
        load_run(tmp_path)
    for name in ("posterior.nc", "status.json", "run.toml"):
        folder = tmp_path / name.replace(".", "-")
        shutil.copytree(stored.path, folder)
        (folder / name).write_bytes(b"[garbage")
        with pytest.raises(StorageError, match="damaged"):
            load_run(folder)


def test_an_interrupted_run_is_stored_and_continued(film, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    curve = film("neo_hookean", (7.5,), noise=0.02, seed=1)
    settings = Settings(ess=1000, chunk=100, sampler="emcee")

    def stop(progress: Progress) -> None:
        raise KeyboardInterrupt

    how = RunSettings(3, tmp_path, settings=settings)
    partial = sample(curve, hypothesis("neo_hookean"), how, progress=stop)
    assert partial.interrupted
    assert partial.path is not None
    assert load_run(partial.path).interrupted
    assert "Not converged (the run was interrupted)" in sentences(partial.quality)[0]
    done = sample(curve, hypothesis("neo_hookean"), how)
    assert done.path == partial.path
    assert done.status["status"] == "converged"
    whole = sample(curve, hypothesis("neo_hookean"), RunSettings(seed=3, settings=settings))
    assert np.array_equal(whole.draws(), done.draws())


def test_a_run_that_stops_early_says_so(film) -> None:  # type: ignore[no-untyped-def]
    curve = film("neo_hookean", (7.5,), noise=0.02, seed=1)
    run = sample(curve, hypothesis("neo_hookean"), RunSettings(settings=Settings(ess=1e6, chunk=60, most_steps=60)))
    assert run.status["status"] == "step limit"
    assert "the limit of 60 steps" in sentences(run.quality)[0]


def test_noise_that_dominates_is_told(film) -> None:  # type: ignore[no-untyped-def]
    """A neo-Hookean film cannot follow a Yeoh curve: the misfit must not pass for noise."""
    curve = film("yeoh", (8.0, -0.2, 0.03), noise=0.002, seed=6, stated=True)
    run = sample(curve, hypothesis("neo_hookean"), RunSettings(seed=1))
    assert run.status["extra_noise_dominates"]
    assert any("the model misses something" in s for s in sentences(run.quality))
    assert run.status["goodness"]["reduced_chi2"] > 100
