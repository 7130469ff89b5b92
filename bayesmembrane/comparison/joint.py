"""Which energy several tests of one material support together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import cast

import numpy as np

from bayesmembrane.calibration.joint.claim import Joint
from bayesmembrane.calibration.joint.posterior import JointPosterior
from bayesmembrane.calibration.joint.run import JointRun, sample_jointly
from bayesmembrane.calibration.joint.starts import joint_starts
from bayesmembrane.calibration.posterior import Outcomes, Posterior
from bayesmembrane.calibration.run import RunSettings
from bayesmembrane.calibration.sampling.walk import Progress
from bayesmembrane.comparison.evidence.bridge import bridge
from bayesmembrane.comparison.evidence.estimate import BRIDGE, NESTED, together
from bayesmembrane.comparison.evidence.nested import nested
from bayesmembrane.comparison.evidence.target import EvidenceEstimate, PosteriorTarget, averaged
from bayesmembrane.comparison.jobs import AGAIN, AS_USUAL, FEW, NESTED_SD, NESTED_SD_MANY, STARTS, Judging, by_chance
from bayesmembrane.comparison.result import Comparison, Row, ranked
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.jobs import Tell, silent
from bayesmembrane.physics.hypothesis import Hypothesis


def compare_jointly(claims: Sequence[Joint], judging: Judging = AS_USUAL, *, progress: Tell = silent) -> Comparison:
    """ln Z of every claim about the same tests, by nested and by bridge sampling, one after the other.

    As `comparison.compare`, but for what is about single points and single ranges: there is no leave-one-out, no prior
    sensitivity and no evidence under other convexity modes. A claim that cannot be fitted has a row that says why.
    Ctrl-C stores what there is and raises KeyboardInterrupt; the same call goes on from there. Raises `SettingsError`
    for no claim, the same one twice, or claims about different data.
    """
    labels = [claim.label() for claim in claims]
    if not claims or len(set(labels)) < len(labels):
        raise SettingsError("there is no energy to compare, or one is there twice", remedy="name each material once")
    if len({claim.data_hash for claim in claims}) > 1:
        raise SettingsError("evidence can be compared on the same data only", remedy="give every claim the same tests")
    return ranked([_judged(claim, judging, progress) for claim in claims])


def named(claim: Joint) -> Hypothesis:
    """The claim as tables name it: the energy with the effects of any test."""
    effects = {e.name: e for part in claim.parts for e in part.hypothesis.effects}
    return replace(claim.parts[0].hypothesis, effects=tuple(effects.values()))


def _judged(claim: Joint, judging: Judging, tell: Tell) -> Row:
    label, mass = claim.label(), None

    def progress(p: Progress) -> None:
        tell(label, f"sampling: ESS {p.ess:.0f} of {p.wanted:.0f}")

    try:
        posterior = JointPosterior(claim)
        tell(label, "prior mass")
        mass = posterior.prior.mass(posterior.inside, judging.seed)
        if mass.value == 0.0:
            raise SettingsError(f'the convexity prior "{claim.convexity}" leaves nothing of {label} in all tests')
        how = RunSettings(judging.seed, judging.out, settings=judging.settings)
        run = sample_jointly(claim, how, progress=progress)
        if run.interrupted:
            raise KeyboardInterrupt
        bridged = _bridged(posterior, run, judging.seed, tell)
        climbed = _nested(posterior, run, judging.seed, tell)
        if by_chance(climbed, bridged):
            climbed = averaged(climbed, _nested(posterior, run, judging.seed + AGAIN, tell))
    except SettingsError as error:
        return Row(label, named(claim), prior_mass=mass, failure=str(error))
    return Row(
        label=label,
        hypothesis=named(claim),
        evidence=together({NESTED: climbed, BRIDGE: bridged}, mass),
        prior_mass=mass,
        run=run.folder,
        evaluations=int(run.status["evaluations"]) + climbed.evaluations + bridged.evaluations,
        seconds=float(run.status["seconds"]) + climbed.seconds + bridged.seconds,
        quality=run.parts[0].quality,
    )


def _target(posterior: JointPosterior) -> PosteriorTarget:
    # A target asks for the two logarithms, the size and the quantiles of the prior, and for nothing else.
    return PosteriorTarget(cast(Posterior, posterior))


def _bridged(posterior: JointPosterior, run: JointRun, seed: int, tell: Tell) -> EvidenceEstimate:
    tell(posterior.joint.label(), "bridge sampling")
    effective, lp = float(run.status["ess_bulk"]), run.log_posterior.ravel()
    return bridge(_target(posterior), run.draws(), seed=seed, effective=effective, log_posterior=lp)


def _nested(posterior: JointPosterior, run: JointRun, seed: int, tell: Tell) -> EvidenceEstimate:
    label = posterior.joint.label()
    tell(label, "nested sampling")
    rng = np.random.default_rng([seed, 7])
    starts = joint_starts(posterior, rng, 2, STARTS, Outcomes()).reshape(-1, posterior.size)
    tolerance = NESTED_SD if posterior.size <= FEW else NESTED_SD_MANY
    return nested(_target(posterior), seed, tolerance, lambda text: tell(label, text), (run.draws(), starts))
