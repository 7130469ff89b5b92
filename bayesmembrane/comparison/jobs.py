"""What is computed for one hypothesis of a comparison, and kept beside its run so that it is computed once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.calibration.fingerprint import code_of
from bayesmembrane.calibration.posterior import Outcomes, Posterior
from bayesmembrane.calibration.predictions import Wanted, rest_of
from bayesmembrane.calibration.prior import Mass
from bayesmembrane.calibration.run import Run, RunSettings, has_predictions, load_run, predictions_of, sample
from bayesmembrane.calibration.sampling.walk import Progress, Settings
from bayesmembrane.calibration.starts import candidates, starting_points
from bayesmembrane.calibration.store import describe, run_name
from bayesmembrane.comparison.convexity_modes import WITHIN, ByMode, by_convexity
from bayesmembrane.comparison.evidence.bridge import bridge
from bayesmembrane.comparison.evidence.estimate import BRIDGE, NESTED, SIGMAS, together
from bayesmembrane.comparison.evidence.nested import ARun, Keep, nested
from bayesmembrane.comparison.evidence.target import EvidenceEstimate, PosteriorTarget, averaged, of_fewest_coordinates
from bayesmembrane.comparison.leave_out.score import leave_one_out, leave_range_out
from bayesmembrane.comparison.parts import drop_pieces, kept, run_folder, serves
from bayesmembrane.comparison.prior_widths import prior_widths
from bayesmembrane.comparison.result import ByWeights, Row
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.errors import DataError, SettingsError
from bayesmembrane.ground.jobs import Tell, give_back
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.hypothesis import Hypothesis

Part = TypeVar("Part")

AGAIN = 1_000_003  # added to the seed
STARTS = 100
# Standard error that nested sampling aims at, up to so many dimensions and beyond: with bridge sampling beside it,
# 0.3 together is what an agreement asks for.
NESTED_SD, FEW, NESTED_SD_MANY = 0.15, 4, 0.25


@dataclass(frozen=True)
class Judging:
    """How hypotheses are judged.

    seed : of all that is drawn
    ess : effective sample size of the posterior draws
    modes : whether evidence under every convexity mode is wanted
    out : folder of the runs; what is stored there with the same data, settings and code is used again. None: no storage
    processes : None: one for each core; 1 stays in this one
    """

    seed: int = 0
    ess: float = 1000.0
    modes: bool = True
    out: str | Path | None = "chains"
    processes: int | None = None

    @property
    def settings(self) -> Settings:
        """How hypotheses are sampled."""
        return Settings(ess=self.ess)


AS_USUAL = Judging()


@dataclass(frozen=True, eq=False)
class Job:
    """One hypothesis on one measurement, and how it is to be judged.

    label : as tables name it
    whole : the measurement that ``measurement`` is the first part of, if the rest is to be predicted
    """

    label: str
    measurement: Measurement
    hypothesis: Hypothesis
    judging: Judging
    whole: Measurement | None = None


def judge(job: Job, tell: Tell) -> Row:
    """All that is to be known of one hypothesis, or why there is nothing.

    Raises KeyboardInterrupt once an interrupted run is stored.
    """
    mass: Mass | None = None
    try:
        posterior = Posterior(job.hypothesis, job.measurement)
        tell(job.label, "prior mass")
        mass = _mass(posterior, job.judging.seed)
        if mass.value == 0.0:
            raise SettingsError(_no_mass(job.hypothesis))
        run = _run(job, tell)
        _predict(job, run, tell)
        return _row(job, posterior, mass, run, tell)
    except (SettingsError, DataError) as error:
        return Row(job.label, job.hypothesis, prior_mass=mass, failure=str(error))


def _row(job: Job, posterior: Posterior, mass: Mass, run: Run, tell: Tell) -> Row:
    """What the draws of a run tell, and nested sampling beside it."""
    seed, key = job.judging.seed, f"{run.draws_name} {code_of(__name__, [job.hypothesis], [job.measurement])}"
    draws, worth = run.draws(), float(run.status["ess_bulk"])

    def part(name: str, doing: str, make: Callable[[], Part], more: str = "") -> Part:
        tell(job.label, doing)
        give_back()
        return kept(run.path, name, f"{key} {more}", make)

    def step(text: str) -> None:
        tell(job.label, text)
        give_back()

    first = cache(partial(first_candidates, posterior))

    def climb(name: str, doing: str, seed: int) -> EvidenceEstimate:
        def keep(piece: str, make: Callable[[], ARun]) -> ARun:
            return kept(run.path, f"{name}-{piece}", key, make)

        found = part(name, doing, lambda: _nested(posterior, draws, first(seed), seed, step, keep))
        drop_pieces(run.path, name)
        return found

    bridged = part("bridge", "bridge sampling", lambda: _bridged(posterior, run, seed))
    climbed = climb("nested", "nested sampling", seed)
    if by_chance(climbed, bridged):
        climbed = averaged(climbed, climb("again", "nested sampling, again", seed + AGAIN))
    loo = part("loo", "leave one out", lambda: leave_one_out(posterior, run.groups, seed, step, run.integral))
    widths = part("widths", "prior widths", lambda: prior_widths(posterior, draws, worth, seed))
    rest = None
    if job.whole is not None:
        whole = job.whole
        rest = part("range", "the rest", lambda: leave_range_out(posterior, draws, whole), whole.data_hash)
    modes: tuple[ByMode, ...] = ()
    if job.judging.modes:
        modes = part("modes", "convexity modes", lambda: _modes(posterior, run, bridged, mass, first(seed), seed))
    return Row(
        label=job.label,
        hypothesis=job.hypothesis,
        evidence=together({NESTED: climbed, BRIDGE: bridged}, mass),
        loo=loo,
        rest=rest,
        prior_mass=mass,
        widths=widths,
        modes=modes,
        run=run.path,
        evaluations=int(run.status["evaluations"]) + climbed.evaluations + bridged.evaluations,
        seconds=float(run.status["seconds"]) + climbed.seconds + bridged.seconds,
        quality=run.quality,
        by_weights=_by_weights(run, mass),
    )


def _by_weights(run: Run, mass: Mass) -> ByWeights | None:
    """ln Z by the weights of the run, divided by the mass as the other estimates are."""
    found = run.status.get("importance")
    if found is None:
        return None
    log_evidence, sd = mass.divides(float(found["log_integral"]), float(found["log_integral_sd"]))
    return ByWeights(log_evidence, sd, float(found["k_hat"]))


def _mass(posterior: Posterior, seed: int) -> Mass:
    """The part of the prior that its own convexity mode leaves; none of the points inside is a mass of zero."""
    return posterior.prior.mass(lambda x: posterior.log_prior(x) > -np.inf, seed)


def _no_mass(hypothesis: Hypothesis) -> str:
    return (
        f'The convexity prior "{hypothesis.convexity}" leaves none of the prior draws of {hypothesis.label()}, so that '
        "there is nothing to be fitted."
    )


def first_candidates(posterior: Posterior, seed: int) -> Array:
    """`candidates` (M, k), found without the run: for nested sampling, and for films that are not convex."""
    return candidates(posterior, np.random.default_rng([seed, 7]))


def nested_starts(posterior: Posterior, first: Array, seed: int) -> Array:
    """(M, k) where nested sampling begins besides the draws: around every valley of the ``first`` candidates."""
    rng = np.random.default_rng([seed, 15])
    return starting_points(posterior, rng, 2, STARTS, Outcomes(), first).reshape(-1, posterior.size)


def _nested(
    posterior: Posterior, draws: Array, first: Array, seed: int, tell: Callable[[str], None], keep: Keep
) -> EvidenceEstimate:
    """Nested sampling that begins around the draws, and around every valley that a descent from prior draws finds."""
    starts = nested_starts(posterior, first, seed)
    tolerance = NESTED_SD if posterior.size <= FEW else NESTED_SD_MANY
    target = of_fewest_coordinates(posterior)
    return nested(target, seed, tolerance, tell, (target.part(draws), target.part(starts)), keep)


def by_chance(climbed: EvidenceEstimate, bridged: EvidenceEstimate) -> bool:
    """Whether the estimators differ by so much that another look is worth while, and by no more than chance can do."""
    joint = float(np.hypot(climbed.sd, bridged.sd))
    return SIGMAS * joint < abs(climbed.log_evidence - bridged.log_evidence) < 2 * SIGMAS * joint


def _run(job: Job, tell: Tell) -> Run:
    """The run of a job, read back if it is stored."""

    def progress(p: Progress) -> None:
        tell(job.label, f"sampling: ESS {p.ess:.0f} of {p.wanted:.0f}")

    how = job.judging
    if how.out is not None:
        asked = describe(job.measurement, job.hypothesis, how.settings, how.seed)
        folder = run_folder(Path(how.out), run_name(job.measurement, job.hypothesis, asked), asked)
        if serves(folder, asked):
            return load_run(folder)
    wanted = RunSettings(how.seed, how.out, settings=how.settings, predictions=False)
    run = sample(job.measurement, job.hypothesis, wanted, progress=progress)
    if run.interrupted:
        raise KeyboardInterrupt
    return run


def _predict(job: Job, run: Run, tell: Tell) -> None:
    """Store what a report will show of a run, unless that is there."""
    if run.path is not None and not has_predictions(run):
        tell(job.label, "predictions")
        predictions_of(run, Wanted(rest=rest_of(job.measurement, job.whole)))


def _bridged(posterior: Posterior, run: Run, seed: int) -> EvidenceEstimate:
    """Bridge sampling on the draws of a run, ensemble by ensemble."""
    log_posterior = run.groups.sample_stats["lp"].values.ravel().astype(float)
    return bridge(
        PosteriorTarget(posterior),
        run.draws(),
        seed=seed,
        effective=float(run.status["ess_bulk"]),
        log_posterior=log_posterior,
        searched=of_fewest_coordinates(posterior),
    )


def _modes(
    posterior: Posterior, run: Run, found: EvidenceEstimate, mass: Mass, first: Array, seed: int
) -> tuple[ByMode, ...]:
    masses = {mode: Mass(m["value"], m["sd"]) for mode, m in run.status["prior_mass"].items()}
    own, m = posterior.hypothesis.convexity, posterior.measurement
    masses[own.name] = mass
    if own.looks_beyond and m.full_range > np.max(np.abs(m.deflection)) * (1 + 1e-9):
        masses[WITHIN] = posterior.prior.mass(partial(_within, posterior), seed)
    return by_convexity(posterior, run.draws(), (found.log_evidence, found.sd), masses, first, seed)


def _within(posterior: Posterior, x: Array) -> NDArray[np.bool_]:
    """(B,) whether films meet their own convexity mode up to the last point fitted."""
    return posterior.prior.met(x, posterior.forward, reached=False)
