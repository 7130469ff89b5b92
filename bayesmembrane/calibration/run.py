"""A run: a posterior sampled, judged and stored under ``chains/<name>/``, and read back.

run.toml       what was asked: data, hypothesis, settings, seed, versions, fingerprint
posterior.nc   arviz InferenceData: posterior, prior, log_likelihood, posterior_predictive, observed_data,
               constant_data (the means of the ensembles over the whole walk among it), sample_stats; a chain is
               an ensemble
status.json    what came out, written last
chains.npz     only where a run was interrupted: everything needed to go on as if it had not been
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.calibration import store as storage
from bayesmembrane.calibration.crosscheck import crosscheck
from bayesmembrane.calibration.goodness import dominates, dominates_sentence, goodness
from bayesmembrane.calibration.posterior import Posterior, failure_sentence
from bayesmembrane.calibration.sampling.walk import Callback, Chains, Sampled, Settings, run_ensembles
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.quiet import arviz
from bayesmembrane.physics.cache import CachedSolver, Tally
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.hypothesis import Hypothesis, from_settings
from bayesmembrane.physics.mechanics import api

MOST_DRAWS, LONG, DRAWS_IF_LONG = 4000, 100, 1000
PRIOR_DRAWS = 500
WALK_STEPS = 500


@dataclass(frozen=True, eq=False)
class Run:
    """A sampled posterior.

    Attributes
    ----------
    name : name of the run, and of its folder
    path : where it is stored, None if it is not
    settings : what stands in run.toml
    status : what stands in status.json
    data : arviz InferenceData; draws carry coordinates and natural parameters under their full names
    """

    name: str
    path: Path | None
    settings: dict[str, Any]
    status: dict[str, Any]
    data: Any

    @cached_property
    def hypothesis(self) -> Hypothesis:
        """What was sampled."""
        return from_settings(self.settings["hypothesis"])

    @cached_property
    def measurement(self) -> Measurement:
        """What it was sampled against."""
        return storage.measurement_of(self.data)

    @property
    def interrupted(self) -> bool:
        """True if the run was stopped from outside; the same call goes on with it."""
        return bool(self.status["status"] == "interrupted")

    def draws(self) -> Array:
        """Coordinates of all draws, all ensembles together, shape (B, k)."""
        return np.stack([self.data.posterior[n].values.ravel() for n in self.hypothesis.names], axis=1)

    def curves(self) -> Array:
        """Force curves of all draws without noise, shape (B, N), N."""
        values = self.data.posterior_predictive["curve"].values
        return np.asarray(values.reshape(-1, values.shape[-1]), dtype=float)

    def summary(self) -> dict[str, Any]:
        """Plain values for the JSON answer of ``sample``."""
        return {"run": str(self.path) if self.path else self.name, **self.status}


def sample(
    measurement: Measurement,
    hypothesis: Hypothesis,
    *,
    seed: int = 0,
    out: str | Path | None = None,
    name: str | None = None,
    ess: float = 1000.0,
    settings: Settings | None = None,
    progress: Callback | None = None,
    solve: Solve = api.solve,
) -> Run:
    """Sample p(parameters | measurement) until every coordinate is worth ``ess`` independent draws, and store it.

    ``out`` is the folder of all runs (None: nothing is stored), ``name`` that of this one in it (None: made from
    specimen, hypothesis, range and a fingerprint of everything that the answer depends on). A finished run with this
    fingerprint is read back, an interrupted one continued. Ctrl-C stores what is there, with the status "interrupted".

    Raises `SettingsError` for hypotheses that the data cannot reach, `StorageError` if the folder cannot be written
    or belongs to something else.
    """
    settings, cached = settings or Settings(ess=ess), _tally(solve)
    posterior = Posterior(hypothesis, measurement, solve)
    asked = storage.describe(measurement, hypothesis, settings, seed)
    name = name or storage.run_name(measurement, hypothesis, asked)
    folder = None if out is None else storage.claim(Path(out) / name, asked)
    if folder is not None and (folder / storage.STATUS).exists() and not (folder / storage.CHAINS).exists():
        return load_run(folder)
    before = storage.read_chains(folder) if folder is not None else None
    sampled = run_ensembles(posterior, settings, seed, progress, before)
    run = _assemble(posterior, sampled, settings, seed, name, folder, asked)
    if cached is not None and (now := _tally(solve)) is not None:
        run.status["cache"] = now.since(cached).summary()
    if folder is not None:
        storage.write_run(folder, asked, run.data, run.status, sampled.chains if run.interrupted else None)
    return run


def load_run(path: str | Path) -> Run:
    """The run stored in the folder ``path``; raises `StorageError` if there is none, or it is damaged."""
    path = Path(path)
    settings, status, data = storage.read_run(path)
    return Run(path.name, path, settings, status, data)


def _tally(solve: Solve) -> Tally | None:
    """A copy of what the cache did so far; None if there is no cache."""
    return replace(solve.tally) if isinstance(solve, CachedSolver) else None


def run_folders(path: str | Path) -> list[Path]:
    """The runs, finished or interrupted, in the folder ``path``; ``path`` itself if it is a run or holds none."""
    path = Path(path)
    runs = sorted(p.parent for p in path.glob(f"*/{storage.STATUS}") if (p.parent / storage.ASKED).is_file())
    return runs if runs and not (path / storage.ASKED).is_file() else [path]


def _assemble(
    posterior: Posterior, sampled: Sampled, settings: Settings, seed: int, name: str, folder: Path | None, asked: Any
) -> Run:
    """Everything that is derived from the chains."""
    hypothesis, measurement = posterior.hypothesis, posterior.measurement
    x, lp = sampled.draws(MOST_DRAWS if len(measurement) <= LONG else DRAWS_IF_LONG)
    flat = x.reshape(-1, x.shape[-1])
    evaluation = posterior.evaluate(flat)
    rng = np.random.default_rng([seed, 1])
    noise = posterior.noise.draw(hypothesis.noise_coordinates(flat), rng)
    masses, prior = posterior.prior.survey(measurement, seed, solve=posterior.solve)
    prior = prior[:PRIOR_DRAWS]
    shape = x.shape[:2]

    def folded(values: Array) -> Array:
        return values.reshape(*shape, *values.shape[1:]).astype(np.float32)

    data = storage.inference_data(
        measurement,
        _walk(sampled.chains),
        posterior=named(hypothesis, measurement, flat, shape),
        prior=named(hypothesis, measurement, prior, (1, len(prior))) if len(prior) else None,
        log_likelihood={"force": folded(posterior.pointwise(flat, evaluation.force))},
        posterior_predictive={"force": folded(evaluation.force + noise), "curve": folded(evaluation.force)},
        sample_stats={"lp": lp, "log_prior": evaluation.log_prior.reshape(shape)},
    )
    status = {
        **_answer(hypothesis, data, sampled, settings),
        "prior_mass": {mode: {"value": m.value, "sd": m.sd} for mode, m in masses.items()},
        **_judgement(posterior, data, evaluation.force[int(np.argmax(lp))]),
        "crosscheck": crosscheck(posterior.forward, flat, seed).summary(),
        "best": _best(hypothesis, measurement, flat[int(np.argmax(lp))]),
    }
    status["sentences"] = [*_sentences(sampled, settings, status), *status.pop("_more")]
    return Run(name, folder, asked, status, data)


def _walk(chains: Chains) -> dict[str, Array]:
    """Means over the walkers of each ensemble at `WALK_STEPS` steps at most, burn-in included."""
    at = np.unique(np.linspace(0, chains.steps - 1, WALK_STEPS).round().astype(int))
    return {"ensemble_mean": chains.x[:, at].mean(axis=2), "ensemble_step": at.astype(float)}


def named(hypothesis: Hypothesis, measurement: Measurement, x: Array, shape: tuple[int, ...]) -> dict[str, Array]:
    """Coordinates and natural parameters by full name, each of ``shape``, of draws x (B, k)."""
    natural = hypothesis.natural(x, measurement)
    values = {n: natural[:, i] for i, n in enumerate(hypothesis.natural_names)}
    values |= {n: x[:, i] for i, n in enumerate(hypothesis.names)}
    return {n: v.reshape(shape) for n, v in values.items()}


def short(hypothesis: Hypothesis, name: str) -> str:
    """The name in JSON answers: the material's parameters without their component."""
    return name.removeprefix(f"{hypothesis.material.name}.")


def _answer(hypothesis: Hypothesis, data: Any, sampled: Sampled, settings: Settings) -> dict[str, Any]:
    c = sampled.convergence
    table = {}
    for name in hypothesis.natural_names:
        values = data.posterior[name].values.ravel()
        low, high = arviz.hdi(values, hdi_prob=0.94)  # type: ignore[no-untyped-call]
        table[short(hypothesis, name)] = {
            "mean": float(np.mean(values)),
            "sd": float(np.std(values)),
            "hdi_94": [float(low), float(high)],
        }
    return {
        "status": sampled.status,
        "posterior": table,
        "ess_bulk": float(np.min(c.ess)),
        "ess_wanted": settings.ess,
        "r_hat": float(np.max(c.r_hat)),
        "tau": {n: float(t) for n, t in zip(hypothesis.names, c.tau, strict=True)},
        "acceptance": c.acceptance,
        "steps": sampled.chains.steps,
        "burn": c.burn,
        "walkers": int(sampled.chains.x.shape[2]),
        "evaluations": sampled.chains.evaluations,
        "seconds": sampled.chains.seconds,
        "tally": dict(sampled.chains.counts),
    }


def _judgement(posterior: Posterior, data: Any, best: Array) -> dict[str, Any]:
    """Goodness of the best draw's curve, by the measurement's own noise, and what the inferred noise says."""
    found = goodness(posterior.measurement, best, posterior.hypothesis.curve_size)
    answer: dict[str, Any] = {"goodness": found.summary(), "extra_noise_dominates": False, "_more": []}
    if "noise.sd" in data.posterior and found.own_noise_N is not None:
        sd = data.posterior["noise.sd"].values.ravel()
        if dominates(found.own_noise_N, sd):
            answer["extra_noise_dominates"] = True
            answer["_more"] = [dominates_sentence(found.own_noise_N, sd)]
    return answer


def _best(hypothesis: Hypothesis, measurement: Measurement, x: Array) -> dict[str, float]:
    """Natural parameters of the draw with the largest posterior density."""
    values = hypothesis.natural(x, measurement)[0]
    return {short(hypothesis, n): float(v) for n, v in zip(hypothesis.natural_names, values, strict=True)}


def _sentences(sampled: Sampled, settings: Settings, status: dict[str, Any]) -> list[str]:
    """What a reader must know before trusting the numbers."""
    c, sentences = sampled.convergence, []
    if not c.enough(settings.ess):
        why = (
            "the run was interrupted"
            if sampled.status == "interrupted"
            else f"the limit of {sampled.chains.steps} steps"
        )
        sentences.append(
            f"Not converged ({why}): ESS {np.min(c.ess):.0f} of {settings.ess:.0f} wanted, {c.lengths:.0f} of 50 "
            f"autocorrelation times walked, R-hat {np.max(c.r_hat):.3f}."
        )
    failures = failure_sentence(sampled.chains.counts)
    return [*sentences, failures] if failures else sentences
