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
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.calibration.prior import DRAWS, Mass
from bayesmembrane.calibration.run import Run, load_run, sample
from bayesmembrane.calibration.sampling.walk import Progress, Settings
from bayesmembrane.calibration.starts import starting_points
from bayesmembrane.calibration.store import ASKED, STATUS, claim, describe, is_finished, run_name
from bayesmembrane.comparison.convexity_modes import ByMode, by_convexity
from bayesmembrane.comparison.evidence.bridge import bridge
from bayesmembrane.comparison.evidence.estimate import BRIDGE, NESTED, SIGMAS, together
from bayesmembrane.comparison.evidence.nested import nested
from bayesmembrane.comparison.evidence.target import Estimate, PosteriorTarget, averaged
from bayesmembrane.comparison.leave_out.score import LeaveOneOut, LeaveRangeOut, leave_one_out, leave_range_out
from bayesmembrane.comparison.prior_widths import Widened, prior_widths
from bayesmembrane.comparison.result import Row
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.errors import DataError, SettingsError, StorageError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.hypothesis import Hypothesis

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


def judge(job: Job, tell: Tell) -> Row:
    """All that is to be known of one hypothesis, or why there is nothing.

    Raises KeyboardInterrupt once an interrupted run is stored.
    """
    mass: Mass | None = None
    try:
        posterior = Posterior(job.hypothesis, job.measurement)
        tell(job.label, "prior mass")
        mass = _mass(posterior, job.seed)
        if mass.value == 0.0:
            raise SettingsError(_no_mass(job.hypothesis))
        return _row(job, posterior, mass, _run(job, tell), tell)
    except (SettingsError, DataError) as error:
        return Row(job.label, job.hypothesis, prior_mass=mass, reason=str(error))


def _row(job: Job, posterior: Posterior, mass: Mass, run: Run, tell: Tell) -> Row:
    """What the draws of a run tell, and nested sampling beside it."""
    key = run.draws_name
    draws, worth = run.draws(), float(run.status["ess_bulk"])

    def kept(name: str, words: str, make: Callable[[], Any], more: str = "") -> Any:
        tell(job.label, words)
        return _kept(run.path, name, f"{key} {more}", make)

    def told(text: str) -> None:
        tell(job.label, text)

    def climb(seed: int) -> dict[str, Any]:
        return asdict(_nested(posterior, draws, seed, told))

    bridged = _estimate(kept("bridge", "bridge sampling", lambda: asdict(_bridged(posterior, run, job.seed))))
    climbed = _estimate(kept("nested", "nested sampling", lambda: climb(job.seed)))
    if by_chance(climbed, bridged):
        more = kept("again", "nested sampling, again", lambda: climb(job.seed + AGAIN))
        climbed = averaged(climbed, _estimate(more))
    loo = kept("loo", "leave one out", lambda: asdict(leave_one_out(posterior, run.data, job.seed, told)))
    widths = kept("widths", "prior widths", lambda: _all(prior_widths(posterior, draws, worth, job.seed)))
    rest, modes = None, []
    if job.whole is not None:
        whole = job.whole
        rest = kept("range", "the rest", lambda: asdict(leave_range_out(posterior, draws, whole)), whole.data_hash)
    if job.modes:
        modes = kept("modes", "convexity modes", lambda: _all(_modes(posterior, run, bridged, job.seed)))
    return Row(
        label=job.label,
        hypothesis=job.hypothesis,
        evidence=together({NESTED: climbed, BRIDGE: bridged}, mass),
        loo=LeaveOneOut(**_arrays(loo, "pointwise", "pareto_k"), refitted=tuple(loo["refitted"])),
        rest=None if rest is None else LeaveRangeOut(**_arrays(rest, "deflection", "predicted", "sd")),
        prior_mass=mass,
        widths=tuple(Widened(**_numbers(w)) for w in widths),
        modes=tuple(ByMode(**m) for m in modes),
        run=run.path,
        evaluations=int(run.status["evaluations"]) + climbed.evaluations + bridged.evaluations,
        seconds=float(run.status["seconds"]) + climbed.seconds + bridged.seconds,
        quality=run.quality,
    )


def _all(found: Sequence[Any]) -> list[dict[str, Any]]:
    return [asdict(each) for each in found]


def _mass(posterior: Posterior, seed: int) -> Mass:
    """The part of the prior that its own convexity mode leaves; as `JointPrior.survey`, without what it says of others.

    None of n draws inside is a mass of zero, with the error of one draw.
    """
    x = posterior.prior.draw(np.random.default_rng(seed), DRAWS)
    hits = int(np.count_nonzero(posterior.log_prior(x) > -np.inf))
    part = hits / DRAWS
    return Mass(part, float(np.sqrt(part * (1 - part) / DRAWS)) if hits else 1 / DRAWS)


def _no_mass(hypothesis: Hypothesis) -> str:
    return (
        f'The convexity prior "{hypothesis.convexity}" leaves none of the prior draws of {hypothesis.label()}, so that '
        "there is nothing to be fitted."
    )


def _nested(posterior: Posterior, draws: Array, seed: int, tell: Callable[[str], None]) -> Estimate:
    """Nested sampling that begins around the draws, and around every valley that a descent from prior draws finds."""
    rng = np.random.default_rng([seed, 7])
    starts = starting_points(posterior, rng, 2, STARTS, Counter()).reshape(-1, posterior.size)
    tolerance = NESTED_SD if posterior.size <= FEW else NESTED_SD_MANY
    return nested(PosteriorTarget(posterior), seed, tolerance, tell, (draws, starts))


def by_chance(climbed: Estimate, bridged: Estimate) -> bool:
    """Whether the estimators differ by so much that another look is worth while, and by no more than chance can do."""
    joint = float(np.hypot(climbed.sd, bridged.sd))
    return SIGMAS * joint < abs(climbed.log_evidence - bridged.log_evidence) < 2 * SIGMAS * joint


def _run(job: Job, tell: Tell) -> Run:
    """The run of a job, read back if it is stored."""

    def progress(p: Progress) -> None:
        tell(job.label, f"sampling: ESS {p.ess:.0f} of {p.wanted:.0f}")

    folder = folder_of(job)
    if folder is not None and _serves(folder, _asked(job)):
        return load_run(folder)
    options: dict[str, Any] = {"seed": job.seed, "out": job.out, "settings": job.settings, "progress": progress}
    run = sample(job.measurement, job.hypothesis, predictions=False, **options)
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


def _modes(posterior: Posterior, run: Run, found: Estimate, seed: int) -> tuple[ByMode, ...]:
    masses = {mode: Mass(m["value"], m["sd"]) for mode, m in run.status["prior_mass"].items()}
    return by_convexity(posterior, run.draws(), found.log_evidence, found.sd, masses, seed)


# ---- kept beside the run ---------------------------------------------------------------------------------------------


def _asked(job: Job) -> dict[str, Any]:
    return describe(job.measurement, job.hypothesis, job.settings, job.seed)


def folder_of(job: Job) -> Path | None:
    """The folder that the run of this job has, or will have: one with the same data, hypothesis, seed and code.

    A finished run may be worth more draws than were asked for, and may go by any name.
    """
    if job.out is None:
        return None
    asked = _asked(job)
    for path in sorted(job.out.glob(f"*/{ASKED}")):
        if _serves(path.parent, asked):
            return path.parent
    return claim(job.out / run_name(job.measurement, job.hypothesis, asked), asked)


def _serves(folder: Path, asked: dict[str, Any]) -> bool:
    """Whether a folder holds a finished run that answers what is asked."""
    try:
        held = tomllib.loads((folder / ASKED).read_text(encoding="utf-8"))
        same = all(held[part] == asked[part] for part in ("seed", "hypothesis", "code"))
        same = same and held["data"]["sha256"] == asked["data"]["sha256"]
        if not same or not is_finished(folder):
            return False
        status = json.loads((folder / STATUS).read_text(encoding="utf-8"))
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
