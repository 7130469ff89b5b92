"""What is computed for one hypothesis of a comparison, and kept beside its run so that it is computed once.

nested.json, again.json, bridge.json, loo.json, widths.json, modes.json, range.json lie in the folder of the run, each
with the key of what it was made from.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import tomllib
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.errors import DataError, SettingsError, StorageError
from bayesmembrane.hypothesis import Hypothesis
from bayesmembrane.inference import storage
from bayesmembrane.inference.evidence_bridge import bridge
from bayesmembrane.inference.evidence_convexity import ByMode, by_convexity
from bayesmembrane.inference.evidence_nested import nested
from bayesmembrane.inference.evidence_sensitivity import Widened, prior_widths
from bayesmembrane.inference.evidence_target import Estimate, PosteriorTarget
from bayesmembrane.inference.initial import starting_points
from bayesmembrane.inference.posterior import Posterior
from bayesmembrane.inference.predictive_comparison import LeaveOneOut, LeaveRangeOut, leave_one_out, leave_range_out
from bayesmembrane.inference.prior import DRAWS, Mass
from bayesmembrane.inference.run import Run, load_run, sample
from bayesmembrane.inference.sampling import Progress, Settings
from bayesmembrane.measurement import Measurement
from bayesmembrane.parameters import Array

Tell = Callable[[str, str], None]
"""(label of a hypothesis, what is being done for it)."""

AGAIN = 1_000_003  # added to the seed
STARTS = 100
# Standard error that nested sampling aims at, up to so many dimensions and beyond: with bridge sampling beside it,
# 0.3 together is what an agreement asks for.
NESTED_SD, FEW, NESTED_SD_MANY = 0.15, 4, 0.25


@dataclass(frozen=True, eq=False)
class Job:
    """One hypothesis on one measurement, and how it is to be judged.

    label : as tables name it
    whole : the measurement that ``measurement`` is the first part of, if the rest is to be predicted
    out : folder of all runs, None: nothing is stored
    modes : whether evidence under every convexity mode is wanted
    """

    label: str
    measurement: Measurement
    hypothesis: Hypothesis
    seed: int
    ess: float
    out: Path | None
    whole: Measurement | None
    modes: bool

    @property
    def settings(self) -> Settings:
        """How it is sampled."""
        return Settings(ess=self.ess)


@dataclass(frozen=True)
class Climbed:
    """What nested sampling says, and the part of the prior that convexity leaves; or why there is none."""

    nested: Estimate | None
    mass: Mass | None
    reason: str


@dataclass(frozen=True, eq=False)
class Walked:
    """What comes from the posterior draws; or why there are none.

    ``notes`` are sentences that a reader needs; ``run`` is the folder, if it is stored.
    """

    bridge: Estimate | None
    loo: LeaveOneOut | None
    rest: LeaveRangeOut | None
    widths: tuple[Widened, ...]
    modes: tuple[ByMode, ...]
    run: Path | None
    evaluations: int
    seconds: float
    notes: tuple[str, ...]
    reason: str


def climb(job: Job, tell: Tell) -> Climbed:
    """Mass and nested sampling, from nothing but the posterior."""
    tell(job.label, "prior mass")
    try:
        posterior = Posterior(job.hypothesis, job.measurement)
        mass = _mass(posterior, job.seed)
        if mass.value == 0.0:
            return Climbed(None, mass, _no_mass(job.hypothesis))

        def make() -> dict[str, Any]:
            return asdict(_nested(posterior, job.seed, lambda text: tell(job.label, text)))

        found = _kept(folder_of(job), "nested", _asked(job)["fingerprint"], make)
    except (SettingsError, DataError) as error:
        return Climbed(None, None, str(error))
    return Climbed(_estimate(found), mass, "")


def _mass(posterior: Posterior, seed: int) -> Mass:
    """The part of the prior that its own convexity mode leaves; as `JointPrior.survey`, without what it says of others.

    None of n draws inside is a mass of zero, with the error of one draw.
    """
    x = posterior.prior.draw(np.random.default_rng(seed), DRAWS)
    hits = int(np.count_nonzero(posterior.log_prior(x) > -np.inf))
    part = hits / DRAWS
    return Mass(part, float(np.sqrt(part * (1 - part) / DRAWS)) if hits else 1 / DRAWS)


def _nested(posterior: Posterior, seed: int, tell: Callable[[str], None]) -> Estimate:
    """Nested sampling that begins around every valley that a descent from prior draws finds."""
    rng = np.random.default_rng([seed, 7])
    starts = starting_points(posterior, rng, 2, STARTS, Counter()).reshape(-1, posterior.size)
    tolerance = NESTED_SD if posterior.size <= FEW else NESTED_SD_MANY
    return nested(PosteriorTarget(posterior), seed, tolerance, tell, starts)


def climb_again(job: Job, tell: Tell) -> Estimate:
    """Nested sampling with another seed."""
    posterior = Posterior(job.hypothesis, job.measurement)

    def make() -> dict[str, Any]:
        return asdict(_nested(posterior, job.seed + AGAIN, lambda text: tell(job.label, f"again: {text}")))

    return _estimate(_kept(folder_of(job), "again", _asked(job)["fingerprint"], make))


def walk(job: Job, tell: Tell) -> Walked:
    """The run, and everything that its draws tell. Raises KeyboardInterrupt once an interrupted run is stored."""
    try:
        return _from_draws(job, _run(job, tell), tell)
    except (SettingsError, DataError) as error:
        return Walked(None, None, None, (), (), None, 0, 0.0, (), str(error))


def _no_mass(hypothesis: Hypothesis) -> str:
    return (
        f'The convexity prior "{hypothesis.convexity}" leaves none of the prior draws of {hypothesis.label()}, so that '
        "there is nothing to be fitted."
    )


def _from_draws(job: Job, run: Run, tell: Tell) -> Walked:
    posterior = Posterior(job.hypothesis, job.measurement)
    key = f"{run.settings['fingerprint']} {run.status['evaluations']}"
    draws, worth = run.draws(), float(run.status["ess_bulk"])

    def kept(name: str, words: str, make: Callable[[], Any], more: str = "") -> Any:
        tell(job.label, words)
        return _kept(run.path, name, f"{key} {more}", make)

    found = kept("bridge", "bridge sampling", lambda: asdict(_bridged(posterior, run, job.seed)))
    told = lambda text: tell(job.label, text)  # noqa: E731 - too short for a name
    loo = kept("loo", "leave one out", lambda: asdict(leave_one_out(posterior, run.data, job.seed, told)))
    widths = kept("widths", "prior widths", lambda: [asdict(w) for w in _widths(posterior, draws, worth, job.seed)])
    rest = None
    if job.whole is not None:
        whole = job.whole
        rest = kept("range", "the rest", lambda: asdict(leave_range_out(posterior, draws, whole)), whole.data_hash)
    modes = []
    if job.modes:
        modes = kept("modes", "convexity modes", lambda: _modes(posterior, run, _estimate(found), job.seed))
    return Walked(
        bridge=_estimate(found),
        loo=LeaveOneOut(**_arrays(loo, "pointwise", "pareto_k"), refitted=tuple(loo["refitted"])),
        rest=None if rest is None else LeaveRangeOut(**_arrays(rest, "deflection", "predicted", "sd")),
        widths=tuple(Widened(**_numbers(w)) for w in widths),
        modes=tuple(ByMode(**m) for m in modes),
        run=run.path,
        evaluations=int(run.status["evaluations"]),
        seconds=float(run.status["seconds"]),
        notes=tuple(run.status["sentences"]),
        reason="",
    )


def _run(job: Job, tell: Tell) -> Run:
    """The run of a job, read back if it is stored."""

    def progress(p: Progress) -> None:
        tell(job.label, f"sampling: ESS {p.ess:.0f} of {p.wanted:.0f}")

    folder = folder_of(job)
    if folder is not None and _serves(folder, _asked(job)):
        return load_run(folder)
    run = sample(job.measurement, job.hypothesis, seed=job.seed, out=job.out, settings=job.settings, progress=progress)
    if run.interrupted:
        raise KeyboardInterrupt
    return run


def _bridged(posterior: Posterior, run: Run, seed: int) -> Estimate:
    """Bridge sampling on the draws of a run, ensemble by ensemble."""
    log_posterior = run.data.sample_stats["lp"].values.ravel().astype(float)
    return bridge(
        PosteriorTarget(posterior),
        run.draws(),
        seed=seed,
        effective=float(run.status["ess_bulk"]),
        log_posterior=log_posterior,
    )


def _widths(posterior: Posterior, draws: Array, worth: float, seed: int) -> tuple[Widened, ...]:
    return prior_widths(posterior, draws, worth, seed)


def _modes(posterior: Posterior, run: Run, found: Estimate, seed: int) -> list[dict[str, Any]]:
    masses = {mode: Mass(m["value"], m["sd"]) for mode, m in run.status["prior_mass"].items()}
    rows = by_convexity(posterior, run.draws(), found.log_evidence, found.sd, masses, seed)
    return [asdict(row) for row in rows]


# ---- kept beside the run ---------------------------------------------------------------------------------------------


def _asked(job: Job) -> dict[str, Any]:
    return storage.describe(job.measurement, job.hypothesis, job.settings, job.seed)


def folder_of(job: Job) -> Path | None:
    """The folder that the run of this job has, or will have: one with the same data, hypothesis, seed and code.

    A finished run may be worth more draws than were asked for, and may go by any name.
    """
    if job.out is None:
        return None
    asked = _asked(job)
    for path in sorted(job.out.glob(f"*/{storage.ASKED}")):
        if _serves(path.parent, asked):
            return path.parent
    return storage.claim(job.out / storage.run_name(job.measurement, job.hypothesis, asked), asked)


def _serves(folder: Path, asked: dict[str, Any]) -> bool:
    """Whether a folder holds a finished run that answers what is asked."""
    try:
        held = tomllib.loads((folder / storage.ASKED).read_text(encoding="utf-8"))
        same = all(held[part] == asked[part] for part in ("seed", "hypothesis", "code"))
        same = same and held["data"]["sha256"] == asked["data"]["sha256"]
        if not same or (folder / storage.CHAINS).exists():
            return False
        status = json.loads((folder / storage.STATUS).read_text(encoding="utf-8"))
        return bool(status["ess_bulk"] >= asked["sampling"]["ess"])
    except (OSError, ValueError, KeyError):
        return False


def _kept(folder: Path | None, name: str, key: str, make: Callable[[], Any]) -> Any:
    """What ``make`` returns, in plain values; from ``folder/name.json`` if that was made with the same ``key``.

    Raises `StorageError` if it cannot be written. A file that cannot be read is made again.
    """
    if folder is None:
        return _plain(make())
    path, digest = folder / f"{name}.json", hashlib.sha256(key.encode()).hexdigest()
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        if stored["key"] == digest:
            return stored["value"]
    except (OSError, ValueError, KeyError, TypeError):
        pass
    value = _plain(make())
    try:
        handle, temporary = tempfile.mkstemp(dir=folder, prefix=f".{name}.")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            json.dump({"key": digest, "value": value}, file, indent=1, allow_nan=False)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except OSError as error:
        raise StorageError(f"the result cannot be stored ({error.strerror})", str(path), "free some space") from None
    return value


def _plain(value: Any) -> Any:
    """What JSON can hold; nan becomes null, and infinity a number that no double exceeds."""
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, float):
        return None if np.isnan(value) else float(np.nan_to_num(value))
    return value


def _numbers(stored: dict[str, Any]) -> dict[str, Any]:
    """The inverse: null is nan."""
    return {k: np.nan if v is None else v for k, v in stored.items()}


def _arrays(stored: dict[str, Any], *names: str) -> dict[str, Any]:
    """`_numbers` with lists as arrays; what is given by name elsewhere is left out."""
    single = {k: v for k, v in _numbers(stored).items() if k not in names and k != "refitted"}
    return single | {n: np.array(stored[n], dtype=float) for n in names}


def _estimate(stored: dict[str, Any]) -> Estimate:
    values = _numbers(stored)
    return Estimate(**{**values, "parts": tuple(values["parts"])})
