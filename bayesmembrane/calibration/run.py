"""A run: a posterior sampled, judged and stored under ``chains/<name>/``, and read back.

run.toml         what was asked: data, hypothesis, settings, seed, versions, fingerprint
segments/        the whole walk, written while it is made: what is needed to go on as if it had never stopped
posterior.nc     draws and what belongs to them, laid out as arviz InferenceData (`calibration.layout`)
status.json      what came out in numbers, written last
predictions.nc   what the draws predict, made for every finished run

However a run ends, the next call with the same folder goes on after its last segment, and finishes it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.calibration import prediction_store
from bayesmembrane.calibration.few import weighing
from bayesmembrane.calibration.layout import Groups, measurement_of
from bayesmembrane.calibration.outcome import MOST_DRAWS, outcome
from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.calibration.prediction_store import read_predictions, write_predictions
from bayesmembrane.calibration.predictions import Predictions, Wanted, predict_draws
from bayesmembrane.calibration.quality import Quality, quality_of
from bayesmembrane.calibration.resume import Origin, check_same, ends, origin
from bayesmembrane.calibration.ruled_out import ruled_out_gain
from bayesmembrane.calibration.sampling.chains import Chains
from bayesmembrane.calibration.sampling.segments import Segments
from bayesmembrane.calibration.sampling.walk import (
    Callback,
    Meanwhile,
    Sampled,
    Settings,
    begun,
    run_ensembles,
    walkers_of,
)
from bayesmembrane.calibration.sampling.weights import GOOD_K
from bayesmembrane.calibration.store import (
    ASKED,
    STATUS,
    claimed,
    describe,
    read_run,
    run_name,
    serves,
    shorter,
    write_run,
)
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.interrupts import Stop, never
from bayesmembrane.ground.jobs import give_back
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.quiet import arviz
from bayesmembrane.ground.showable import Showable
from bayesmembrane.physics.cache import CachedSolver, Tally
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.hypothesis import Hypothesis, from_settings
from bayesmembrane.physics.mechanics import api

_FAULTS = (KeyError, TypeError, ValueError, AttributeError, IndexError, ArithmeticError, OSError, RuntimeError)


@dataclass(frozen=True, eq=False, repr=False)
class Run(Showable):
    """A sampled posterior.

    Attributes
    ----------
    name : name of the run, and of its folder
    path : where it is stored, None if it is not
    settings : what stands in run.toml
    status : what stands in status.json
    groups : draws and what belongs to them; they carry coordinates and natural parameters under their full names
    """

    name: str
    path: Path | None
    settings: dict[str, Any]
    status: dict[str, Any]
    groups: Groups

    @cached_property
    def data(self) -> Any:
        """The groups as arviz InferenceData."""
        return arviz.InferenceData(**self.groups)

    @cached_property
    def hypothesis(self) -> Hypothesis:
        """What was sampled."""
        return from_settings(self.settings["hypothesis"]).on(self.measurement)

    @cached_property
    def measurement(self) -> Measurement:
        """What it was sampled against."""
        return measurement_of(self.groups)

    @property
    def interrupted(self) -> bool:
        """True if the run was stopped from outside; the same call goes on with it."""
        return bool(self.status["status"] == "interrupted")

    @property
    def finished(self) -> bool:
        """True if it came to its own end: enough draws, or the limit of steps."""
        return not self.interrupted

    @property
    def integral(self) -> tuple[float, float] | None:
        """(ln int p0(x) p(y | x) dx, its standard error) by the weights of its proposals; None if they say little."""
        found = self.status.get("importance")
        if found is None or found["k_hat"] > GOOD_K:
            return None
        return float(found["log_integral"]), float(found["log_integral_sd"])

    def draws(self) -> Array:
        """Coordinates of all draws, all ensembles together, shape (B, k)."""
        return np.stack([self.groups.posterior[n].values.ravel() for n in self.hypothesis.names], axis=1)

    def walk(self, every: int | None = None) -> Iterator[Array]:
        """The walk after burn-in, (E, n, walkers, k) at a time: every ``every``-th step, None for the largest tau.

        One segment is held at a time, so that a chain of any length can be looked at. Raises `StorageError` if the walk
        is not stored, or damaged.
        """
        if self.path is None or not Segments(self.path).paths:
            raise StorageError("the walk is not stored", self.name, "sample again with out=")
        taus = [tau for tau in self.status["tau"].values() if tau is not None]
        every = every or max(1, int(np.ceil(max(taus, default=1.0))))
        return Segments(self.path).thinned(every, int(self.status["burn"]))

    def curves(self) -> Array:
        """Force curves of all draws without noise, shape (B, N), N."""
        values = self.groups.posterior_predictive["curve"].values
        return np.asarray(values.reshape(-1, values.shape[-1]), dtype=float)

    @cached_property
    def quality(self) -> Quality:
        """How far the draws can be trusted."""
        posterior = self.groups.posterior
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
    fork : folder of another run, at whose end this one begins, whatever made that; None begins at starts of its own
    """

    seed: int = 0
    out: str | Path | None = None
    name: str | None = None
    ess: float = 1000.0
    settings: Settings | None = None
    predictions: bool = True
    rest: Measurement | None = None
    fork: str | Path | None = None

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
    stop: Stop = never,
) -> Run:
    """Sample p(parameters | measurement) until every coordinate is worth enough independent draws, and store it.

    What lies in the folder decides what is done: a finished run of the same question is read back; one that was
    stopped or killed goes on after its last complete segment, and ends with the same draws as if it had not been; a
    finished one of fewer draws goes on to more. SIGINT, SIGTERM, or ``stop()`` being true after a step end the walk
    there: everything is stored, and the run that is returned is ``interrupted`` and not ``finished``. A run that is
    stored and finished gets its predictions.

    Raises `SettingsError` for hypotheses that the data cannot reach, `StorageError` if the folder cannot be written,
    is worked on by another process, belongs to something else, or holds a walk that would not go on alike.
    """
    how, hypothesis = how or RunSettings(), hypothesis.with_frame(measurement)
    start = None if how.fork is None else origin(how.fork, hypothesis)
    asked = describe(measurement, hypothesis, how.sampling, how.seed, None if start is None else start.described)
    work = _Work(how, asked, Posterior(hypothesis, measurement, solve), start, progress, stop)
    name = how.name or run_name(measurement, hypothesis, asked)
    folder = None if how.out is None else Path(how.out) / name
    if folder is None:
        run = work.done(name, None)
    elif serves(folder, asked):
        run = load_run(folder)
    else:
        with claimed(folder, asked) as segments:
            run = work.done(name, segments)
    if how.predictions and folder is not None and run.finished:
        predictions_of(run, None if how.rest is None else Wanted(rest=how.rest), solve)
    return run


@dataclass(frozen=True, eq=False)
class _Work:
    """One run while it is made; ``origin`` is the run at whose end it begins, if that is another."""

    how: RunSettings
    asked: dict[str, Any]
    posterior: Posterior
    origin: Origin | None
    progress: Callback | None
    stop: Stop

    @cached_property
    def weighed(self) -> Posterior:
        """The posterior as the walk asks for it: of a long curve at few deflections."""
        return weighing(self.posterior)

    def done(self, name: str, segments: Segments | None) -> Run:
        """The run, with what was walked already in ``segments``, and stored there (None: nowhere)."""
        counted = _tally(self.posterior.solve)
        sampled = self._walked(segments)
        give_back()
        data, status = outcome(self.posterior, sampled, self.how.sampling.ess, self.how.seed)
        status["checks"]["ruled_out"] = ruled_out_gain(self.posterior, *sampled.draws(MOST_DRAWS), self.how.seed)
        if counted is not None and (now := _tally(self.posterior.solve)) is not None:
            status["cache"] = now.since(counted).summary()
        if segments is None:
            return Run(name, None, self.asked, status, data)
        write_run(segments.run, data, status)
        return Run(name, segments.run, self.asked, status, data)

    def _walked(self, segments: Segments | None) -> Sampled:
        settings, seed = self.how.sampling, self.how.seed
        if segments is None:
            begin, beside = self._at_the_end_of_another(), Meanwhile(stop=self.stop)
        else:
            begin, beside = self._continued(segments), Meanwhile(segments.write, self.stop)
        return run_ensembles(self.weighed, settings, seed, self.progress, begin, beside)

    def _continued(self, segments: Segments) -> Chains | None:
        """The walk to go on with: what lies there, or a shorter one that lies beside it, or the end of another."""
        beside = None if self.how.name else shorter(segments.run, self.asked)
        if beside is not None and segments.steps < Segments(beside).steps:
            found = Segments(beside).read()
            if found is not None:
                check_same(self.weighed, found, beside)
            segments.take(Segments(beside))  # one by one: who is killed here goes on with what lacks
        stored = segments.read()
        if stored is not None:
            check_same(self.weighed, stored, segments.run)
            return stored
        begin = self._at_the_end_of_another()
        if begin is not None:
            check_same(self.weighed, begin, segments.run)
            segments.write(begin)
        return begin

    def _at_the_end_of_another(self) -> Chains | None:
        if self.origin is None:
            return None
        settings, seed = self.how.sampling, self.how.seed
        wanted = settings.ensembles, walkers_of(self.weighed, settings)
        return begun(self.weighed, ends(self.weighed, self.origin.chains, wanted, seed), seed)


def load_run(path: str | Path) -> Run:
    """The run stored in the folder ``path``; raises `StorageError` if there is none, or it is damaged."""
    path = Path(path)
    run = Run(path.name, path, *read_run(path))
    try:
        # What an earlier version or another hand wrote is looked at before anybody relies on it.
        run.quality, run.draws(), run.measurement, run.draws_name
    except _FAULTS as error:
        raise StorageError(
            f"another version wrote the run ({type(error).__name__}: {error})", str(path), "sample again"
        ) from None
    return run


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


def has_predictions(run: Run) -> bool:
    """Whether predictions of these draws are stored with a run; raises `StorageError` if they are damaged."""
    return run.path is not None and prediction_store.has_predictions(run.path, run.draws_name)


def _tally(solve: Solve) -> Tally | None:
    """A copy of what the cache did so far; None if there is no cache."""
    return replace(solve.tally) if isinstance(solve, CachedSolver) else None


def run_folders(path: str | Path) -> list[Path]:
    """The runs, finished or interrupted, in the folder ``path``; ``path`` itself if it is a run or holds none."""
    path = Path(path)
    runs = sorted(p.parent for p in path.glob(f"*/{STATUS}") if (p.parent / ASKED).is_file())
    return runs if runs and not (path / ASKED).is_file() else [path]
