"""A run: a posterior sampled, judged and stored under ``chains/<name>/``, and read back.

run.toml         what was asked: data, hypothesis, settings, seed, versions, fingerprint
posterior.nc     draws and what belongs to them, as arviz InferenceData (`calibration.layout`)
status.json      what came out in numbers, written last
predictions.nc   what the draws predict, made for every finished run
chains.npz       only where a run was interrupted: everything needed to go on as if it had not been
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.calibration.layout import measurement_of
from bayesmembrane.calibration.outcome import outcome
from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.calibration.prediction_store import read_predictions, write_predictions
from bayesmembrane.calibration.predictions import Predictions, Wanted, predict_draws
from bayesmembrane.calibration.quality import Quality, quality_of
from bayesmembrane.calibration.sampling.chains import read_chains
from bayesmembrane.calibration.sampling.walk import Callback, Settings, run_ensembles
from bayesmembrane.calibration.store import (
    ASKED,
    CHAINS,
    STATUS,
    claim,
    describe,
    is_finished,
    read_run,
    run_name,
    write_run,
)
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.showable import Showable
from bayesmembrane.physics.cache import CachedSolver, Tally
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.hypothesis import Hypothesis, from_settings
from bayesmembrane.physics.mechanics import api


@dataclass(frozen=True, eq=False, repr=False)
class Run(Showable):
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
        return measurement_of(self.data)

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

    @cached_property
    def quality(self) -> Quality:
        """How far the draws can be trusted."""
        posterior = self.data.posterior
        return quality_of(self.status, posterior["noise.sd"].values.ravel() if "noise.sd" in posterior else np.empty(0))

    @property
    def draws_name(self) -> str:
        """What tells these draws from others: an interrupted run that went on has more evaluations."""
        return f"{self.settings['fingerprint']} {self.status['evaluations']}"

    def to_stored(self) -> dict[str, Any]:
        """Where it lies and which draws those are: what is kept of a run in an answer that rests on it."""
        if self.path is None:
            raise StorageError(f'the run "{self.name}" is not stored', remedy="sample with out=")
        return {"folder": self.path, "draws": self.draws_name}

    @classmethod
    def from_stored(cls, value: dict[str, Any]) -> Run:
        """The inverse of `to_stored`; raises `StorageError` if the run has gone, or was sampled anew."""
        run = load_run(value["folder"])
        if run.draws_name != value["draws"]:
            raise StorageError("the run was sampled anew", str(run.path), "ask for the answer that rests on it again")
        return run

    def summary(self) -> dict[str, Any]:
        """Plain values of the JSON answer of ``sample``."""
        return {"run": str(self.path) if self.path else self.name, **self.status}


@dataclass(frozen=True, eq=False)
class RunSettings:
    """How a run is made, and where it lies.

    seed : of all that is drawn
    out : folder of all runs; None stores nothing
    name : of this run's folder in it; None makes it of specimen, hypothesis, range and a fingerprint of everything that
        the answer depends on
    ess : wanted effective sample size of the worst coordinate
    settings : how to walk, instead of the usual way to ``ess``
    predictions : make them at once; else `predictions_of` does when they are asked for
    rest : points that were left out, to be predicted as well
    """

    seed: int = 0
    out: str | Path | None = None
    name: str | None = None
    ess: float = 1000.0
    settings: Settings | None = None
    predictions: bool = True
    rest: Measurement | None = None

    @property
    def sampling(self) -> Settings:
        """How to walk."""
        return self.settings or Settings(ess=self.ess)


def sample(
    measurement: Measurement,
    hypothesis: Hypothesis,
    how: RunSettings | None = None,
    *,
    progress: Callback | None = None,
    solve: Solve = api.solve,
) -> Run:
    """Sample p(parameters | measurement) until every coordinate is worth enough independent draws, and store it.

    A finished run with the same fingerprint is read back, an interrupted one continued. Ctrl-C stores what is there,
    with the status "interrupted". A run that is stored and finished gets its predictions.

    Raises `SettingsError` for hypotheses that the data cannot reach, `StorageError` if the folder cannot be written
    or belongs to something else.
    """
    how = how or RunSettings()
    settings, seed = how.sampling, how.seed
    asked = describe(measurement, hypothesis, settings, seed)
    name = how.name or run_name(measurement, hypothesis, asked)
    folder = None if how.out is None else claim(Path(how.out) / name, asked)
    if folder is not None and is_finished(folder):
        run = load_run(folder)
    else:
        posterior, counted = Posterior(hypothesis, measurement, solve), _tally(solve)
        before = None if folder is None else read_chains(folder / CHAINS)
        sampled = run_ensembles(posterior, settings, seed, progress, before)
        data, status = outcome(posterior, sampled, settings.ess, seed)
        if counted is not None and (now := _tally(solve)) is not None:
            status["cache"] = now.since(counted).summary()
        run = Run(name, folder, asked, status, data)
        if folder is not None:
            write_run(folder, asked, data, status, sampled.chains if run.interrupted else None)
    if how.predictions and folder is not None and not run.interrupted:
        predictions_of(run, None if how.rest is None else Wanted(rest=how.rest), solve)
    return run


def load_run(path: str | Path) -> Run:
    """The run stored in the folder ``path``; raises `StorageError` if there is none, or it is damaged."""
    path = Path(path)
    settings, status, data = read_run(path)
    return Run(path.name, path, settings, status, data)


def predictions_of(run: Run, wanted: Wanted | None = None, solve: Solve = api.solve) -> Predictions:
    """What the draws of a run predict; read back if it is stored with them, else computed and, if they are, stored.

    ``wanted`` None takes what there is, or makes what `Wanted` asks for. Raises `StorageError` if what is stored is
    damaged, or the folder cannot be written.
    """
    found = stored_predictions(run, wanted)
    if found is None:
        asked, seed = wanted or Wanted(), int(run.settings["seed"])
        found = predict_draws(run.hypothesis, run.measurement, run.draws(), asked, seed, solve)
        if run.path is not None:
            write_predictions(found, run.path, run.draws_name, asked)
    return found


def stored_predictions(run: Run, wanted: Wanted | None = None) -> Predictions | None:
    """The predictions stored with a run; None if there are none, or not of these draws, or not what is ``wanted``.

    Raises `StorageError` if they are damaged.
    """
    return None if run.path is None else read_predictions(run.path, run.draws_name, wanted)


def _tally(solve: Solve) -> Tally | None:
    """A copy of what the cache did so far; None if there is no cache."""
    return replace(solve.tally) if isinstance(solve, CachedSolver) else None


def run_folders(path: str | Path) -> list[Path]:
    """The runs, finished or interrupted, in the folder ``path``; ``path`` itself if it is a run or holds none."""
    path = Path(path)
    runs = sorted(p.parent for p in path.glob(f"*/{STATUS}") if (p.parent / ASKED).is_file())
    return runs if runs and not (path / ASKED).is_file() else [path]
