"""From a stored run to what a report shows of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.calibration.run import Run, load_run, predictions_of
from bayesmembrane.ground.errors import SettingsError, StorageError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.report.view import Sampling, Shown, Specimen

_SHOWN_APART = ("hypothesis", "sampling", "data", "code", "versions", "seed", "fingerprint")


def read(run: Run | Path | str) -> Shown:
    """A run, or the folder that holds one, as a report shows it.

    Raises `StorageError` if the folder holds no run; `SettingsError` for a run that is not stored.
    """
    if not isinstance(run, Run):
        folder = Path(run)
        if not folder.is_dir():
            raise StorageError("there is no such run folder", str(folder), "name a folder under chains/")
        run = load_run(folder)
    if run.path is None:
        raise SettingsError(f'the run "{run.name}" is not stored', remedy="sample with out=")
    m, h = run.measurement, run.hypothesis
    p = m.provenance
    return Shown(
        folder=str(run.path),
        hypothesis=h,
        specimen=Specimen(
            m.specimen.name,
            m.specimen.thickness,
            m.rig,
            p.origin,
            (p.curve, p.specimen, p.covariance),
            p.notes,
        ),
        data_hash=m.data_hash,
        digest=predictions_of(run),
        x=run.draws(),
        natural=_stacked(run.data.posterior, h.natural_names),
        prior=_stacked(run.data.prior, h.names) if "prior" in run.data.groups() else np.empty((0, len(h.names))),
        sampling=_sampling(run),
        goodness=run.status["goodness"],
        dominated=bool(run.status["extra_noise_dominates"]),
        outcomes=run.status["tally"],
        masses={mode: (v["value"], v["sd"]) for mode, v in run.status["prior_mass"].items()},
        cache=run.status.get("cache", {}),
        crosscheck=run.status["crosscheck"],
        facts=_facts(run),
    )


def _stacked(group: Any, names: tuple[str, ...]) -> Array:
    """Draws (S, k) of the named variables, all ensembles together."""
    return np.stack([np.asarray(group[n].values, dtype=float).ravel() for n in names], axis=1)


def _sampling(run: Run) -> Sampling:
    status = run.status
    means, steps = _means(run)
    tau = np.array([np.nan if v is None else v for v in (status["tau"][n] for n in run.hypothesis.names)], dtype=float)
    return Sampling(
        status=status["status"],
        ess=_number(status["ess_bulk"], 0.0),
        wanted=status["ess_wanted"],
        r_hat=_number(status["r_hat"], np.inf),
        tau=tau,
        acceptance=status["acceptance"],
        ensembles=int(run.data.posterior.sizes["chain"]),
        walkers=status["walkers"],
        steps=status["steps"],
        burn=status["burn"],
        evaluations=status["evaluations"],
        seconds=status["seconds"],
        means=means,
        steps_at=steps,
    )


def _number(value: float | None, missing: float) -> float:
    return missing if value is None else float(value)


def _means(run: Run) -> tuple[Array, Array]:
    """Means over the walkers (E, T, k) at steps (T,): of the whole walk if it was stored, else of the stored draws."""
    constant = run.data.constant_data
    if "ensemble_mean" in constant:
        return np.asarray(constant["ensemble_mean"].values, float), np.asarray(constant["ensemble_step"].values, float)
    x = np.stack([np.asarray(run.data.posterior[n].values, float) for n in run.hypothesis.names], axis=-1)
    ensembles, draws, k = x.shape
    walkers = run.status["walkers"] if draws % run.status["walkers"] == 0 else 1
    means = x.reshape(ensembles, -1, walkers, k).mean(axis=2)
    return means, np.linspace(run.status["burn"], run.status["steps"], means.shape[1])


def _facts(run: Run) -> dict[str, Any]:
    """Settings and versions as names and values."""
    asked = run.settings
    facts: dict[str, Any] = {f"hypothesis: {k}": v for k, v in asked["hypothesis"].items()}
    facts |= {f"sampling: {k}": v for k, v in asked["sampling"].items()}
    facts |= {"seed": asked["seed"], "fingerprint": asked["fingerprint"], "code (SHA-256)": asked["code"]["sha256"]}
    facts |= {f"version of {k}": v for k, v in asked["versions"].items()}
    facts |= {k: v for k, v in asked.items() if k not in _SHOWN_APART}
    return facts | {"folder": run.name}
