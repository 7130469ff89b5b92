"""Loops with every kind of end, made once: one was diagnosed in earnest, the others are what it might have been."""

import math
from dataclasses import replace

import pytest

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.data.shipped import shipped
from bayesmembrane.diagnosis.diagnose import diagnose
from bayesmembrane.diagnosis.explanation.case import Question
from bayesmembrane.diagnosis.left.discrepancy import discrepancy
from bayesmembrane.diagnosis.loop import Loop, Round
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.diagnosis.separation import Experiment
from bayesmembrane.next_test.further import FurtherTest, Kind
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.annulus import Annulus
from tests.generator.datasets import THICKNESS, generate
from tests.report.sections.loops import SHORT, stage


@pytest.fixture(scope="session")
def named() -> Loop:
    """A curve with friction in it, diagnosed in earnest; then the same with friction in the model."""
    d = generate("friction", "neo_hookean", SHORT, "white", strength=1.5, seed=11)
    measurement = Measurement(
        1e-3 * d.deflection_mm, d.force_N, Annulus(0.010, 0.035), Specimen("synthetic <film>", THICKNESS), d.time_s
    )
    claim = hypothesis("neo_hookean")
    first = diagnose(measurement, claim)
    assert (first.verdict, first.effects) == ("named", ("friction",))
    before, after = stage(measurement, claim, 500.0), stage(measurement, first.hypothesis, 600.0)
    second = diagnose(measurement, first.hypothesis)
    assert second.verdict == "adequate"
    return Loop((Round(first, before, after), Round(second, after, after)), None)


@pytest.fixture(scope="session")
def unknown(named: Loop) -> Loop:
    """The same curve, had nothing explained it."""
    r = named.rounds[0]
    d = replace(r.diagnosis, verdict="unknown", effects=(), members=(), best=r.diagnosis.null)
    left = discrepancy(r.before.run.measurement, d.null.residual, d.noise)
    return Loop((Round(d, r.before, r.before),), left)


@pytest.fixture(scope="session")
def ambiguous(named: Loop) -> Loop:
    """The same curve, had a second candidate explained it."""
    r = named.rounds[0]
    nexts = (Experiment(FurtherTest(Kind.BLANK), math.inf), Experiment(FurtherTest(Kind.UNLOADING), 0.7))
    members = tuple(j for j in r.diagnosis.ranking if j.candidate.names)[:2]
    d = replace(r.diagnosis, verdict="ambiguous", members=members, experiments=nexts)
    return Loop((Round(d, r.before, r.before),), None)


@pytest.fixture(scope="session")
def going_on(named: Loop) -> Loop:
    """The same curve, had friction been sure and what is beside it not: with that nothing is missing."""
    first, second = named.rounds
    sets = {"friction": 0.6, "friction+mullins": 0.38, "hysteresis": 0.02}
    p = replace(first.diagnosis.probabilities, effects=sets)
    members, firm = first.diagnosis.ranking[:2], ("friction",)
    d = replace(first.diagnosis, verdict="ambiguous", members=members, probabilities=p, firm=firm)
    return Loop((replace(first, diagnosis=d), second), None)


@pytest.fixture(scope="session")
def sampled(ambiguous: Loop, named: Loop) -> Loop:
    """The same, both candidates sampled."""
    r = ambiguous.rounds[0]
    second = stage(r.before.run.measurement, r.diagnosis.members[1].candidate.hypothesis, 550.0)
    return Loop((replace(r, leaders=(named.rounds[0].after, second)),), None)


@pytest.fixture(scope="session")
def strip() -> Diagnosis:
    """A strip of tape that was loaded and unloaded, as measured."""
    measurement = read_measurement(shipped("vhb4910_0d03.csv"), shipped("vhb4910_0d03.toml"))
    return diagnose(measurement, Question(hypothesis("yeoh"), True, True))
