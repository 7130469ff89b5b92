"""The closed loop: calibrate, diagnose, add what is missing, calibrate again, until adequate or abstaining."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.calibration.prior import Mass
from bayesmembrane.calibration.run import Run, RunSettings, sample
from bayesmembrane.calibration.sampling.walk import Callback, Settings
from bayesmembrane.calibration.sampling.weights import GOOD_K
from bayesmembrane.comparison.evidence.bridge import bridge
from bayesmembrane.comparison.evidence.target import PosteriorTarget
from bayesmembrane.comparison.leave_out.score import leave_one_out
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.thinning import thinned
from bayesmembrane.diagnosis.diagnose import diagnose
from bayesmembrane.diagnosis.explanation.case import Question, Tell
from bayesmembrane.diagnosis.left.discrepancy import Discrepancy, discrepancy
from bayesmembrane.diagnosis.other_tests import OtherTest, check, predicted
from bayesmembrane.diagnosis.reference.outliers import without_outliers
from bayesmembrane.diagnosis.result import Diagnosis, Thinned, thinning
from bayesmembrane.diagnosis.thresholds import LOOP, TINY
from bayesmembrane.ground.jobs import give_back
from bayesmembrane.ground.pieces import piece
from bayesmembrane.ground.showable import Showable
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.noise.ar1 import AR1
from bayesmembrane.physics.noise.ar1_readings import AR1Readings
from bayesmembrane.physics.noise.base import Noise

Watch = Callable[[str], Callback | None]
"""What is told of the sampling of one hypothesis, by its label."""


@dataclass(frozen=True, eq=False)
class Stage:
    """One hypothesis, sampled.

    log_evidence, log_evidence_sd : ln Z divided by the prior's mass, by the weights of the mixture that proposed the
        draws, or by bridge sampling where these cannot be relied on; its error, which then has what modes that the
        draws are known to have missed would add
    elpd_loo, loo_se : expected log predictive density of left-out points, and its standard error
    coverage : part of the measured points inside the 90 % predictive band
    """

    run: Run
    log_evidence: float
    log_evidence_sd: float
    elpd_loo: float
    loo_se: float
    coverage: float


@dataclass(frozen=True, eq=False)
class Round:
    """What was diagnosed, with the posteriors before and after; ``after`` is ``before`` where nothing was added.

    leaders : posteriors of the first members of an ambiguous answer, in its order
    """

    diagnosis: Diagnosis
    before: Stage
    after: Stage
    leaders: tuple[Stage, ...] = ()

    @property
    def changed(self) -> bool:
        """True if something was added, and sampled."""
        return self.after.run.hypothesis.label() != self.before.run.hypothesis.label()


@dataclass(frozen=True, eq=False, repr=False)
class Loop(Showable):
    """All rounds, the last one being adequate or abstaining; ``left`` is kept, unnamed, where it abstains.

    thinned : what was taken of a measurement with too many readings; else None
    others : tests that no fit saw, with what the first diagnosis predicts of them
    """

    rounds: tuple[Round, ...]
    left: Discrepancy | None
    thinned: Thinned | None = None
    others: tuple[OtherTest, ...] = ()


@dataclass(frozen=True)
class LoopSettings:
    """How a loop is closed.

    seed : of all draws
    out : folder in which every run is stored; None: nothing is
    ess : independent draws that each posterior is to be worth
    adapt_noise : True: all are sampled with AR(1) noise where the readings turn out to be correlated, for white noise
        would make the posterior too narrow
    most_rounds : after which it stops
    leaders : members of an ambiguous answer that are sampled, the most probable first; the others are fitted only
    solve : what solves films
    predict : other tests of the same material, which are predicted
    scatter : relative standard deviation by which forces of two specimens differ
    """

    seed: int = 0
    out: str | Path | None = None
    ess: float = 1000.0
    adapt_noise: bool = False
    most_rounds: int = LOOP.most_rounds
    leaders: int = LOOP.leaders
    solve: Solve = api.solve
    predict: tuple[Measurement, ...] = ()
    scatter: float = 0.0


def loop(
    measurement: Measurement,
    hypothesis: Hypothesis | Question,
    settings: LoopSettings | None = None,
    *,
    tell: Tell | None = None,
    watch: Watch | None = None,
) -> Loop:
    """Diagnose, sample, add what is named, and again.

    A `Question` may leave the energy open: the most probable one is sampled first. Named effects, a better energy, or
    what is firm of an answer without a name (`Diagnosis.firm`) make the next hypothesis; an answer without any of
    these ends the loop, and so does a hypothesis that was there before. Of an ambiguous answer that ends it as many are
    sampled as the settings say. More readings than `thinning.MOST` are thinned and single outliers set aside, for all
    of it. Raises what `sample` and `diagnose` raise.
    """
    how = settings or LoopSettings()
    for other in how.predict:
        check(measurement, other, how.scatter)
    part = thinned(measurement)
    question = hypothesis if isinstance(hypothesis, Question) else Question(hypothesis)
    kept, aside = without_outliers(part)
    closing = _Closing(kept, how, tell or (lambda _: None), watch)
    found = piece("diagnosis-0", lambda: closing.diagnosed(question))
    # Before anything is sampled: a test that no film follows ends it here.
    others = piece("others", partial(closing.predicted, found))
    noise = _noise_for(found, question.hypothesis) if closing.settings.adapt_noise else question.hypothesis.noise
    stage = closing.sampled(replace(found.null.hypothesis, noise=noise))
    seen, rounds = {stage.run.hypothesis.label()}, list[Round]()
    while True:
        last = len(rounds) + 1 >= closing.settings.most_rounds
        following = replace(_following(found, last), noise=noise)
        goes_on = following.label() not in seen
        after = closing.sampled(following) if goes_on else stage
        first = found.members[: closing.settings.leaders] if found.verdict == "ambiguous" and not goes_on else ()
        rivals = [closing.sampled(replace(j.candidate.hypothesis, noise=noise)) for j in first]
        # The readings that are left have no outliers: what was set aside at the start is told of every round.
        rounds.append(Round(replace(found, set_aside=aside), stage, after, tuple(rivals)))
        if not goes_on or last:
            break
        seen.add(following.label())
        again = partial(closing.diagnosed, replace(question, hypothesis=following, declared=True))
        stage, found = after, piece(f"diagnosis-{len(rounds)}", again)
    return Loop(tuple(rounds), closing.left(rounds[-1].diagnosis), thinning(measurement, part), others)


def _following(found: Diagnosis, last: bool) -> Hypothesis:
    """The next model: with what is named, or what is firm of an answer without a name; the given one without either.

    What is merely firm is not added in the ``last`` round, after which nobody asks what is beside it.
    """
    if found.explains or last or not found.firm:
        return found.hypothesis
    first, given = found.members[0].candidate.hypothesis, found.null.hypothesis
    return replace(first, effects=(*given.effects, *(e for e in first.effects if e.name in found.firm)))


@dataclass(frozen=True, eq=False)
class _Closing:
    """One loop while it is being closed."""

    measurement: Measurement
    settings: LoopSettings
    tell: Tell
    watch: Watch | None

    def diagnosed(self, claim: Question) -> Diagnosis:
        """What its hypothesis misses."""
        return diagnose(self.measurement, claim, seed=self.settings.seed, solve=self.settings.solve, tell=self.tell)

    def sampled(self, claim: Hypothesis) -> Stage:
        """The posterior of ``claim``; raises `KeyboardInterrupt` if it was stopped from outside."""
        self.tell(f"sampling {claim.label()}")
        give_back()
        progress = self.watch(claim.label()) if self.watch is not None else None
        s = self.settings
        walk = Settings(ess=s.ess, most_steps=LOOP.most_steps)
        how = RunSettings(seed=s.seed, out=s.out, ess=s.ess, settings=walk)
        run = sample(self.measurement, claim, how, progress=progress, solve=s.solve)
        if run.interrupted:
            raise KeyboardInterrupt
        return piece(f"stage-{claim.label()}", lambda: _stage(run, s.solve, s.seed))

    def predicted(self, first: Diagnosis) -> tuple[OtherTest, ...]:
        """The other tests, by all that the first diagnosis holds probable."""
        s = self.settings
        return tuple(predicted(first, other, s.scatter, s.seed) for other in s.predict)

    def left(self, last: Diagnosis) -> Discrepancy | None:
        """What is kept without a name, where the loop abstains: beside the first explanation, if there is one."""
        if last.verdict not in ("unknown", "ambiguous") or (last.best is not last.null and last.remaining.noise):
            return None
        return discrepancy(self.measurement, last.best.residual, last.noise)


def _noise_for(found: Diagnosis, hypothesis: Hypothesis) -> Noise:
    """AR(1) by the clock that the readings follow, if they remember."""
    if not found.noise.remembers:
        return hypothesis.noise
    return AR1Readings() if found.noise.clock == "readings" else AR1()


def moved(before: Run, after: Run) -> dict[str, dict[str, float]]:
    """Parameters that both runs have: change of the mean, and that over the standard deviation before."""
    a, b = before.status["posterior"], after.status["posterior"]
    if before.hypothesis.material is not after.hypothesis.material:
        return {}
    return {
        n: {"change": b[n]["mean"] - a[n]["mean"], "in_sd": (b[n]["mean"] - a[n]["mean"]) / max(a[n]["sd"], TINY)}
        for n in a
        if n in b
    }


def _stage(run: Run, solve: Solve, seed: int) -> Stage:
    posterior = Posterior(run.hypothesis, run.measurement, solve)
    loo = leave_one_out(posterior, run.groups, seed, integral=run.integral)
    return Stage(run, *(_by_weights(run) or _bridged(run, posterior, seed)), loo.elpd, loo.se, coverage(run))


def _by_weights(run: Run) -> tuple[float, float] | None:
    """ln Z and its error by the weights of a run's proposals; None where that says little."""
    found = run.status.get("importance")
    if found is None or found["k_hat"] > GOOD_K or found["log_evidence_sd"] > LOOP.sure:
        return None
    return float(found["log_evidence"]), float(found["log_evidence_sd"])


def _bridged(run: Run, posterior: Posterior, seed: int) -> tuple[float, float]:
    """The same by bridge sampling."""
    z = bridge(PosteriorTarget(posterior), run.draws(), seed=seed, effective=float(run.status["ess_bulk"]))
    mode = run.status["prior_mass"][run.hypothesis.convexity.name]
    mass = Mass(mode["value"], mode["sd"])
    sd = float(np.linalg.norm([z.sd, mass.sd / mass.value, z.missed]))
    return z.log_evidence - float(np.log(mass.value)), sd


def coverage(run: Run) -> float:
    """Part of the measured points inside the central 90 % of the posterior predictive."""
    draws = run.groups.posterior_predictive["force"].values
    draws = draws.reshape(-1, draws.shape[-1])
    low, high = np.quantile(draws, [(1 - LOOP.band) / 2, (1 + LOOP.band) / 2], axis=0)
    y = run.measurement.force
    return float(np.mean((y >= low) & (y <= high)))
