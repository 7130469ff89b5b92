"""The closed loop: calibrate, diagnose, add what is missing, calibrate again, until adequate or abstaining."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.calibration.prior import Mass
from bayesmembrane.calibration.run import Run, sample
from bayesmembrane.calibration.sampling.walk import Callback
from bayesmembrane.comparison.evidence.bridge import bridge
from bayesmembrane.comparison.evidence.target import PosteriorTarget
from bayesmembrane.comparison.leave_out.score import leave_one_out
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.thinning import thinned, thinning_sentence
from bayesmembrane.diagnosis.diagnose import Diagnosis, diagnose
from bayesmembrane.diagnosis.discrepancy import Discrepancy, discrepancy
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.noise.ar1 import AR1
from bayesmembrane.physics.noise.ar1_readings import AR1Readings

MOST_ROUNDS, LEADERS = 3, 3
BAND = 0.9
"""Part of new readings that a predictive band is to cover."""

Watch = Callable[[str], Callback | None]
"""What is told of the sampling of one hypothesis, by its label."""


@dataclass(frozen=True, eq=False)
class Stage:
    """One hypothesis, sampled.

    log_evidence, log_evidence_sd : ln Z by bridge sampling, divided by the prior's mass
    elpd_loo, loo_se : expected log predictive density of left-out points, and its standard error
    coverage : part of the measured points inside the 90 % predictive band
    """

    run: Run
    log_evidence: float
    log_evidence_sd: float
    elpd_loo: float
    loo_se: float
    coverage: float

    def summary(self) -> dict[str, Any]:
        """Plain values: the run's, and what the loop adds."""
        status = self.run.status
        return {
            "run": str(self.run.path) if self.run.path else self.run.name,
            "posterior": status["posterior"],
            "ess_bulk": status["ess_bulk"],
            "r_hat": status["r_hat"],
            "log_evidence": self.log_evidence,
            "log_evidence_sd": self.log_evidence_sd,
            "elpd_loo": self.elpd_loo,
            "loo_se": self.loo_se,
            "coverage_90": self.coverage,
        }


@dataclass(frozen=True, eq=False)
class Round:
    """What was diagnosed, with the posteriors before and after; ``after`` is ``before`` where nothing was added.

    leaders : posteriors of the first members of an ambiguous answer, in its order
    """

    diagnosis: Diagnosis
    before: Stage
    after: Stage
    leaders: tuple[Stage, ...] = ()

    def summary(self) -> dict[str, Any]:
        """The answer of ``diagnose`` with both posteriors and how the material moved."""
        return {
            **self.diagnosis.summary(),
            "before": self.before.summary(),
            "after": self.after.summary(),
            "leaders": [{"model": s.run.hypothesis.label(), **s.summary()} for s in self.leaders],
            "moved": moved(self.before.run, self.after.run),
        }


@dataclass(frozen=True, eq=False)
class Loop:
    """All rounds, the last one being adequate or abstaining; ``left`` is kept, unnamed, where it abstains.

    thinning : what is said of readings that were left out, since there were too many; else ""
    """

    rounds: tuple[Round, ...]
    left: Discrepancy | None
    thinning: str = ""

    @property
    def sentence(self) -> str:
        """How it ended."""
        steps = []
        for r in self.rounds:
            if r.after is r.before:
                continue
            old, new = r.before.run.hypothesis, r.after.run.hypothesis
            if new.material is not old.material:
                steps.append(f"{new.material.title} instead of {old.material.title}")
            steps += [e.title for e in new.effects if e.name not in {e.name for e in old.effects}]
        start = f"Changed: {', '.join(steps)}. " if steps else ""
        return f"{start}{self.rounds[-1].diagnosis.sentence} {self.thinning}".rstrip()


def loop(
    measurement: Measurement,
    hypothesis: Hypothesis,
    *,
    seed: int = 0,
    out: str | Path | None = None,
    ess: float = 1000.0,
    solve: Solve = api.solve,
    tell: Callable[[str], None] | None = None,
    watch: Watch | None = None,
    most_rounds: int = MOST_ROUNDS,
    adapt_noise: bool = False,
) -> Loop:
    """Diagnose, sample, add what is named, and again; every run is stored in the folder ``out``.

    A named effect or a better energy makes the next hypothesis; `adequate`, `ambiguous` and `unknown` end the loop, and
    so does a hypothesis that was there before. Of an ambiguous answer the first `LEADERS` are sampled. With
    ``adapt_noise`` all are sampled with AR(1) noise where the readings turn out to be correlated: white noise would
    make the posterior too narrow. More readings than `thinning.MOST` are thinned, for all of it. Raises what
    `sample` and `diagnose` raise.
    """
    say = tell or (lambda _: None)
    whole, measurement = measurement, thinned(measurement)

    def staged(claim: Hypothesis) -> Stage:
        say(f"sampling {claim.label()}")
        progress = watch(claim.label()) if watch is not None else None
        run = sample(measurement, claim, seed=seed, out=out, ess=ess, progress=progress, solve=solve)
        if run.interrupted:
            raise KeyboardInterrupt
        return _stage(run, solve, seed)

    def diagnosed(claim: Hypothesis) -> Diagnosis:
        return diagnose(measurement, claim, seed=seed, solve=solve, tell=tell)

    rounds: list[Round] = []
    found = diagnosed(hypothesis)
    noise = hypothesis.noise
    if adapt_noise and found.noise.remembers:
        noise = AR1Readings() if found.noise.clock == "readings" else AR1()
    stage = staged(replace(hypothesis, noise=noise))
    seen = {stage.run.hypothesis.label()}
    while True:
        following = replace(found.hypothesis, noise=noise)
        goes_on = found.verdict in ("named", "material") and following.label() not in seen
        after = staged(following) if goes_on else stage
        leaders = found.members[:LEADERS] if found.verdict == "ambiguous" else ()
        sampled = tuple(staged(replace(j.candidate.hypothesis, noise=noise)) for j in leaders)
        rounds.append(Round(found, stage, after, sampled))
        if not goes_on or len(rounds) >= most_rounds:
            break
        seen.add(following.label())
        stage, found = after, diagnosed(following)
    last = rounds[-1].diagnosis
    abstains = last.verdict in ("unknown", "ambiguous")
    left = discrepancy(measurement, last.null.residual, last.noise) if abstains else None
    return Loop(tuple(rounds), left, thinning_sentence(whole, measurement))


def moved(before: Run, after: Run) -> dict[str, dict[str, float]]:
    """Parameters that both runs have: change of the mean, and that over the standard deviation before."""
    a, b = before.status["posterior"], after.status["posterior"]
    if before.hypothesis.material is not after.hypothesis.material:
        return {}
    return {
        n: {"change": b[n]["mean"] - a[n]["mean"], "in_sd": (b[n]["mean"] - a[n]["mean"]) / max(a[n]["sd"], 1e-300)}
        for n in a
        if n in b
    }


def _stage(run: Run, solve: Solve, seed: int) -> Stage:
    posterior = Posterior(run.hypothesis, run.measurement, solve)
    draws = run.draws()
    z = bridge(PosteriorTarget(posterior), draws, seed=seed, effective=float(run.status["ess_bulk"]))
    mode = run.status["prior_mass"][run.hypothesis.convexity.name]
    mass = Mass(mode["value"], mode["sd"])
    loo = leave_one_out(posterior, run.data, seed)
    return Stage(
        run,
        z.log_evidence - float(np.log(mass.value)),
        float(np.hypot(z.sd, mass.sd / mass.value)),
        loo.elpd,
        loo.se,
        coverage(run),
    )


def coverage(run: Run) -> float:
    """Part of the measured points inside the central 90 % of the posterior predictive."""
    draws = run.data.posterior_predictive["force"].values
    draws = draws.reshape(-1, draws.shape[-1])
    low, high = np.quantile(draws, [(1 - BAND) / 2, (1 + BAND) / 2], axis=0)
    y = run.measurement.force
    return float(np.mean((y >= low) & (y <= high)))
