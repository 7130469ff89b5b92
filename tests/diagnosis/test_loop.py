"""The posteriors of a closed loop: their evidence, which costs nothing where the proposals tell it."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.calibration.run import Run, RunSettings, sample
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.diagnosis.diagnose import diagnose
from bayesmembrane.diagnosis.explanation.case import Question
from bayesmembrane.diagnosis.loop import LoopSettings, Stage, _bridged, _by_weights, _Closing, loop
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.diagnosis.thresholds import LOOP
from bayesmembrane.physics.hypothesis import Hypothesis, hypothesis
from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from tests.diagnosis.curves import SD, measured, triangle, white_noise


@pytest.fixture(scope="module")
def found() -> Run:
    stretch = np.linspace(1.1, 2.5, 12)
    force = 100 * (stretch - stretch**-2) + np.random.default_rng(41).standard_normal(12)
    band = Measurement(stretch, force, Uniaxial(), Specimen("band", 5e-4))
    return sample(band, hypothesis("gent"), RunSettings(2, settings=Settings(ess=1000.0), predictions=False))


def test_weights_equal_bridge(found: Run) -> None:
    told = _by_weights(found)
    assert told is not None
    bridged = _bridged(found, Posterior(found.hypothesis, found.measurement), 0)
    assert told[0] == pytest.approx(bridged[0], abs=6 * np.hypot(told[1], bridged[1]))


@pytest.mark.parametrize("bad", [{"k_hat": 0.8}, {"log_evidence_sd": 2 * LOOP.sure}])
def test_weights_that_say_little_are_left_to_bridge(found: Run, bad: dict[str, float]) -> None:
    told = {**found.status, "importance": {**found.status["importance"], **bad}}
    assert _by_weights(replace(found, status=told)) is None


def test_ensembles_have_no_weights(found: Run) -> None:
    assert _by_weights(replace(found, status={**found.status, "importance": None})) is None


def test_a_loop_goes_on_with_what_is_firm(monkeypatch: pytest.MonkeyPatch) -> None:
    """An offset that is in all that is probable is in the model of the second round, and in its posterior."""
    rig, stretch = Uniaxial(), np.concatenate([np.linspace(1.05, 2, 20), np.linspace(2, 1.05, 20)])
    force = 100 * (stretch - stretch**-2) + 8 + np.random.default_rng(4).standard_normal(40)
    m = Measurement(rig.length * (stretch - 1), force, rig, Specimen("band", 5e-4))
    claims, runs = list[Hypothesis](), list[Hypothesis]()

    def diagnosed(self: _Closing, claim: Question) -> Diagnosis:
        claims.append(claim.hypothesis)
        found = diagnose(m, claim)
        if len(claims) > 1:
            return replace(found, verdict="adequate", firm=())
        return replace(found, verdict="unknown", firm=("force_offset",))

    def sampled(self: _Closing, claim: Hypothesis) -> Stage:
        runs.append(claim)
        return Stage(SimpleNamespace(hypothesis=claim), 0.0, 0.1, 0.0, 1.0, 0.9)  # type: ignore[arg-type]

    monkeypatch.setattr(_Closing, "diagnosed", diagnosed)
    monkeypatch.setattr(_Closing, "sampled", sampled)
    found = loop(m, hypothesis("neo_hookean"))
    assert [[e.name for e in h.effects] for h in claims] == [[], ["force_offset"]]
    assert [[e.name for e in h.effects] for h in runs] == [[], ["force_offset"]]
    assert [r.changed for r in found.rounds] == [True, False]
    claims.clear()
    once = loop(m, hypothesis("neo_hookean"), LoopSettings(most_rounds=1))
    assert [r.changed for r in once.rounds] == [False]  # nobody would ask what is beside it


@pytest.mark.parametrize(
    ("verdict", "noise", "told"),
    [("ambiguous", False, True), ("unknown", False, True), ("named", False, False), ("ambiguous", True, False)],
)
def test_what_is_kept_without_a_name_is_what_the_answer_leaves(verdict: str, noise: bool, told: bool) -> None:
    """Not what the plain model leaves, where there are explanations of that; and not noise."""
    d = triangle(120)
    wave = np.sin(200 * d)
    m = measured(8 * d + 5 * SD * wave, d)
    large, small = (SimpleNamespace(residual=size * SD * wave) for size in (100, 5))
    left_by = SimpleNamespace(noise=noise)
    last = SimpleNamespace(verdict=verdict, null=large, best=small, noise=white_noise(m, SD), remaining=left_by)
    left = _Closing(m, LoopSettings(), lambda _: None, None).left(cast(Diagnosis, last))
    assert (left is not None) is told
    if left is not None:
        assert left.amplitude < 20 * SD
