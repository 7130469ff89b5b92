"""What tests of loops share: a short cyclic protocol, posteriors of a few steps, and the diagnosis with a verdict."""

from bayesmembrane.calibration.run import RunSettings, sample
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.loop import Loop, Stage
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.physics.hypothesis import Hypothesis
from tests.generator.protocols import Protocol

SHORT = Protocol("short", (0.015, 0.030, 0.030), (1e-3,) * 3, 120)


def stage(measurement: Measurement, claim: Hypothesis, log_evidence: float) -> Stage:
    """A posterior of a few steps; its scores are not what is tested."""
    run = sample(measurement, claim, RunSettings(settings=Settings(ess=1.0, chunk=40, most_steps=40, walkers=16)))
    return Stage(run, log_evidence, 0.03, 0.9 * log_evidence, 4.0, 0.91)


def only(loop: Loop, verdict: str) -> Diagnosis:
    return next(r.diagnosis for r in loop.rounds if r.diagnosis.verdict == verdict)
