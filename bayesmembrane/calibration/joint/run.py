"""A joint posterior sampled, and stored with what it says of every test.

joint.json, joint.npz   the answer: draws, how they were made, and where the runs of the tests lie
walk/                   run.toml with what was asked, and the walk segment by segment, to go on with
<label>/                a run like any other: the draws as they are of this test, with its predictions

However a joint run ends, the next call with the same folder goes on after its last segment, and finishes it.
"""

from __future__ import annotations

import platform
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from bayesmembrane.calibration.fingerprint import code_of
from bayesmembrane.calibration.joint.claim import WALK, Joint
from bayesmembrane.calibration.joint.posterior import JointPosterior
from bayesmembrane.calibration.joint.starts import try_jointly
from bayesmembrane.calibration.outcome import MOST_DRAWS, marginal, outcome, sampler_of, walk_answer
from bayesmembrane.calibration.posterior import Outcomes, Posterior
from bayesmembrane.calibration.prior import Mass
from bayesmembrane.calibration.resume import check_same
from bayesmembrane.calibration.ruled_out import ruled_out_gain
from bayesmembrane.calibration.run import Run, RunSettings, predictions_of
from bayesmembrane.calibration.sampling.growing import changed
from bayesmembrane.calibration.sampling.segments import Segments
from bayesmembrane.calibration.sampling.walk import (
    Callback,
    Meanwhile,
    Sampled,
    run_ensembles,
    started,
)
from bayesmembrane.calibration.store import ASKED, HOW_LONG, claimed, describe, write_run
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.files import make_folder
from bayesmembrane.ground.fingerprint import digest
from bayesmembrane.ground.interrupts import Stop, never
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.sealed import write_toml
from bayesmembrane.ground.showable import Showable
from bayesmembrane.ground.stored import read, store
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.mechanics import api

KIND = "joint"


@dataclass(frozen=True, eq=False, repr=False)
class JointRun(Showable):
    """A sampled joint posterior.

    Attributes
    ----------
    joint : what was sampled
    x : (E, D, K) coordinates of draws
    log_posterior : (E, D)
    status : how it was sampled, and the posterior of every natural parameter
    parts : the same draws as runs of every test, with goodness, bands and replicas
    mass : part of the prior that convexity in all tests leaves
    fingerprint : of all that the draws depend on
    folder : where it is stored, None if it is not
    """

    joint: Joint
    x: Array
    log_posterior: Array
    status: dict[str, Any]
    parts: tuple[Run, ...]
    mass: Mass
    fingerprint: str
    folder: Path | None

    @property
    def interrupted(self) -> bool:
        """True if it was stopped from outside; the same call goes on with it."""
        return bool(self.status["status"] == "interrupted")

    def draws(self) -> Array:
        """Coordinates of all draws, all ensembles together, shape (B, K)."""
        return self.x.reshape(-1, self.x.shape[-1])

    def natural(self) -> Array:
        """Natural parameters of all draws (B, m), in the order of ``joint.natural_names``."""
        return self.joint.natural(self.draws())

    def summary(self) -> dict[str, Any]:
        """Plain values of the JSON answer of ``sample`` on several measurements."""
        return {
            "run": str(self.folder) if self.folder else None,
            **self.status,
            "thickness_um": 1e6 * self.joint.thickness,
            "prior_mass": {"value": self.mass.value, "sd": self.mass.sd},
            "tests": {
                label: {"run": str(run.path) if run.path else None, "goodness": run.status["goodness"]}
                for label, run in zip(self.joint.labels, self.parts, strict=True)
            },
        }


def sample_jointly(
    joint: Joint,
    how: RunSettings | None = None,
    *,
    progress: Callback | None = None,
    solve: Solve = api.solve,
    stop: Stop = never,
) -> JointRun:
    """Sample p(parameters | all tests) until every coordinate is worth enough independent draws, and store it.

    As `calibration.run.sample`: a finished run of the same question that is worth as much is read back; one that was
    stopped, killed, or wanted less goes on after its last segment. ``how.rest`` and ``how.fork`` play no part. Raises
    `SettingsError` for hypotheses that the data cannot reach, `StorageError` if the folder cannot be written, is worked
    on by another process, or holds something else.
    """
    how = how or RunSettings()
    asked = describe_joint(joint, how)
    posterior = JointPosterior(joint, solve)
    if how.out is None:
        return _made(posterior, how, asked, _walked(posterior, how, None, progress, stop), None)
    folder = Path(how.out) / (how.name or run_name(joint, asked))
    held = _held(folder, asked, how)
    if held is not None:
        return held
    make_folder(folder)
    with claimed(folder / WALK, asked) as segments:
        sampled = _walked(posterior, how, segments, progress, stop)
        found = _made(posterior, how, asked, sampled, folder)
        store(folder, KIND, found, found.summary())
    return found


def describe_joint(joint: Joint, how: RunSettings) -> dict[str, Any]:
    """The content of run.toml; ``walk`` covers what decides how the walk goes, ``fingerprint`` how long it is, too."""
    chosen = {k: v for k, v in asdict(how.sampling).items() if v is not None}
    claims, data = [p.hypothesis for p in joint.parts], [p.measurement for p in joint.parts]
    asked: dict[str, Any] = {
        "seed": how.seed,
        "hypothesis": joint.settings(),
        "sampling": chosen,
        "data": {"sha256": joint.data_hash},
        "code": {"sha256": code_of(__name__, claims, data)},
    }
    fingerprint = digest(asked)
    walk = digest({**asked, "sampling": {k: v for k, v in chosen.items() if k not in HOW_LONG}})
    versions = {"python": platform.python_version(), **describe(data[0], claims[0], how.sampling, how.seed)["versions"]}
    return {**asked, "fingerprint": fingerprint, "walk": walk, "versions": versions}


def run_name(joint: Joint, asked: dict[str, Any]) -> str:
    """Tests, hypothesis and walk in one word: ``film-strip_yeoh_joint_3f2a9c41``."""
    return f"{'-'.join(joint.labels)[:60]}_{joint.label()[:60]}_joint_{asked['walk'][:8]}"


def _held(folder: Path, asked: dict[str, Any], how: RunSettings) -> JointRun | None:
    """What lies in ``folder``, if it is this walk, finished, and goes as far as is wanted."""
    try:
        found = read(folder, KIND)
    except StorageError:
        return None  # damaged, or its runs are: it is made again from the walk
    if not isinstance(found, JointRun) or found.status["walk"] != asked["walk"] or found.interrupted:
        return None
    far = found.status["ess_wanted"] >= how.sampling.ess
    if found.status["status"] == "step limit":
        far = found.status["steps"] >= how.sampling.most_steps
    return found if far else None


def _walked(
    posterior: JointPosterior, how: RunSettings, segments: Segments | None, progress: Callback | None, stop: Stop
) -> Sampled:
    """The walk, gone on with where something of it is stored."""
    # What walks asks for no more than `evaluate`, `given` and `size`.
    target, settings = cast(Posterior, posterior), how.sampling
    chains = None if segments is None else segments.read()
    if chains is not None and segments is not None:
        check_same(target, chains, segments.run)
    else:
        chains = started(target, settings, how.seed, try_jointly)
        if segments is not None:
            segments.write(chains)
    meanwhile = Meanwhile(stop=stop) if segments is None else Meanwhile(segments.write, stop)
    return run_ensembles(target, settings, how.seed, progress, chains, meanwhile)


# ---- what came out ---------------------------------------------------------------------------------------------------


def _made(
    posterior: JointPosterior, how: RunSettings, asked: dict[str, Any], sampled: Sampled, folder: Path | None
) -> JointRun:
    joint = posterior.joint
    x, lp = sampled.draws(MOST_DRAWS)
    parts = tuple(_part_run(posterior, i, how, asked, sampled, folder) for i in range(len(joint.parts)))
    beyond = ruled_out_gain(posterior, x, lp, how.seed)
    return JointRun(
        joint=joint,
        x=x,
        log_posterior=lp,
        status=_status(joint, x, lp, sampled, how) | {"walk": asked["walk"]} | {"checks": {"ruled_out": beyond}},
        parts=parts,
        mass=posterior.prior.mass(posterior.inside, how.seed),
        fingerprint=str(asked["fingerprint"]),
        folder=folder,
    )


def _part_run(
    posterior: JointPosterior,
    number: int,
    how: RunSettings,
    asked: dict[str, Any],
    sampled: Sampled,
    folder: Path | None,
) -> Run:
    """The joint draws as a run of one test, stored under its label, with predictions."""
    part, joint = posterior.joint.parts[number], posterior.joint
    data, status = outcome(posterior.parts[number], _seen_from(joint, number, sampled), how.sampling.ess, how.seed)
    own = describe(part.measurement, part.hypothesis, how.sampling, how.seed)
    mark = digest({"joint": asked["fingerprint"], "label": part.label})
    status["sampler"] = sampler_of(sampled.chains)
    own |= {"fingerprint": mark, "walk": mark, "joint": {"label": part.label, "tests": list(joint.labels)}}
    if folder is None:
        return Run(part.label, None, own, status, data)
    place = folder / part.label
    make_folder(place)
    write_toml(place / ASKED, own, "the run")
    write_run(place, data, status)
    run = Run(part.label, place, own, status, data)
    if how.predictions:
        predictions_of(run, None, posterior.solve)
    return run


def _seen_from(joint: Joint, number: int, sampled: Sampled) -> Sampled:
    """The walk in the coordinates of one test."""
    at, c = joint.places[number], sampled.convergence
    own = replace(c, tau=c.tau[at], ess=c.ess[at], r_hat=c.r_hat[at])
    x = changed(sampled.chains.x, lambda part: joint.of(number, part))
    # What a mixture proposed, and its weights, are those of all tests.
    chains = replace(sampled.chains, x=x, counts=Outcomes(dict(sampled.chains.counts)), mixture=None, offered=None)
    return replace(sampled, chains=chains, convergence=own)


def _status(joint: Joint, x: Array, lp: Array, sampled: Sampled, how: RunSettings) -> dict[str, Any]:
    prefix = f"{joint.material.name}."
    natural = joint.natural(x.reshape(-1, x.shape[-1]))
    best = natural[int(np.argmax(lp))]
    short = [name.removeprefix(prefix) for name in joint.natural_names]
    return walk_answer(sampled, joint.names, how.sampling.ess) | {
        "posterior": {n: marginal(natural[:, i]) for i, n in enumerate(short)},
        "best": {n: float(v) for n, v in zip(short, best, strict=True)},
    }
